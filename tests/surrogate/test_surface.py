"""FRF-level fusion: every model on a surface whose simulation is off by a smooth factor."""

import numpy as np
import pytest

from planner.errors import InputError
from planner.surrogate.models.frf_surface import SURFACES, Grid, fit_surface
from planner.surrogate.models.mfdgp import Training

LINES, POSES = np.linspace(5, 30, 20), np.linspace(0, 1, 9)
QUICK = Training(300, 300, inducing=30)


def simulated(lines, poses):
    natural = 12 * (1 + 0.3 * poses[None, :])
    return 1 / np.abs(natural**2 - lines[:, None] ** 2 + 2j * 0.1 * natural * lines[:, None])


def measured(lines, poses):
    return (
        3 * simulated(lines, poses) * np.exp(0.3 * np.sin(3 * poses[None, :] + lines[:, None] / 9))
    )


@pytest.mark.parametrize("logarithm", [False, True])
@pytest.mark.parametrize("model", SURFACES)
def test_between_measured_poses_the_surface_is_met(model, logarithm):
    seen, wanted = POSES[::2], POSES[1::2]
    fine = np.linspace(0, 1, 9)
    low = Grid(LINES, fine, simulated(LINES, fine))
    fitted = fit_surface(
        Grid(LINES, seen, measured(LINES, seen)), low, model, QUICK, logarithm=logarithm
    )
    told, sd = fitted.predict(LINES, wanted)
    true = measured(LINES, wanted)
    assert told.shape == sd.shape == (20, 4)
    assert (sd > 0).all()
    assert not logarithm or (told > 0).all()
    off = np.sqrt(np.mean((told - true) ** 2)) / np.std(true)
    assert off < (0.5 if model == "NARGP" else 0.9)  # five poses alone say less than simulation


def test_what_cannot_be_fitted_is_said_in_words():
    good = Grid(LINES, POSES, simulated(LINES, POSES))
    with pytest.raises(InputError, match="NARGP"):
        fit_surface(good, good, "kriging")
    holed = Grid(LINES, POSES, good.amplitude * np.where(np.arange(9) == 3, 0.0, 1.0))
    with pytest.raises(InputError, match="leave its line out"):
        fit_surface(holed, good, "GP")
