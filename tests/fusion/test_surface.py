"""FRF-level fusion: every model on a surface whose simulation is off by a smooth factor."""

import numpy as np
import pytest

from planner.errors import InputError
from planner.surrogate.models import frf_surface
from planner.surrogate.models.frf_surface import SURFACES, Grid, fit_surface

LINES, POSES = np.linspace(5, 30, 40), np.linspace(0, 1, 9)


def simulated(lines, poses):
    natural = 12 * (1 + 0.3 * poses[None, :])
    return 1 / np.abs(natural**2 - lines[:, None] ** 2 + 2j * 0.1 * natural * lines[:, None])


def measured(lines, poses):
    return (
        3 * simulated(lines, poses) * np.exp(0.3 * np.sin(3 * poses[None, :] + lines[:, None] / 9))
    )


@pytest.mark.parametrize("model", SURFACES)
def test_between_measured_poses_the_surface_is_met(model, monkeypatch):
    monkeypatch.setattr(frf_surface, "INDUCING", 80)
    seen, wanted = POSES[::2], POSES[1::2]
    fine = np.linspace(0, 1, 17)
    low = Grid(LINES, fine, simulated(LINES, fine))
    fitted = fit_surface(Grid(LINES, seen, measured(LINES, seen)), low, model)
    median, sd = fitted.predict(LINES, wanted)
    off = np.log(median / measured(LINES, wanted))
    assert median.shape == sd.shape == (40, 4)
    assert (median > 0).all()
    known = np.log(3 * simulated(LINES, wanted) / measured(LINES, wanted))
    if model == "log GP":  # five poses alone say less than the simulation does
        assert np.sqrt(np.mean(off**2)) < 0.5
    else:
        assert np.sqrt(np.mean(off**2)) < 0.5 * np.sqrt(np.mean(known**2))


def test_what_cannot_be_fitted_is_said_in_words():
    good = Grid(LINES, POSES, simulated(LINES, POSES))
    with pytest.raises(InputError, match="AR1"):
        fit_surface(good, good, "kriging")
    holed = Grid(LINES, POSES, good.amplitude * np.where(np.arange(9) == 3, 0.0, 1.0))
    with pytest.raises(InputError, match="leave its line out"):
        fit_surface(holed, good)
