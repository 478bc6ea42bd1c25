"""FRF-level fusion on a surface whose simulation is off by a smooth factor; the GP over a grid.

`pytest -m slow tests/surrogate/test_surface.py` adds MFDGP.
"""

import time

import numpy as np
import pytest

from planner.errors import InputError
from planner.surrogate.kernels import parse
from planner.surrogate.models.frf_surface import Grid, fit_grid, fit_surface
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


@pytest.mark.parametrize(
    ("model", "logarithm"),
    [
        ("GP", False),
        ("NARGP", False),
        pytest.param("MFDGP", False, marks=pytest.mark.slow),
        ("GP", True),
    ],
)
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


def surface(a, b):
    return np.sin(6 * a[:, None]) * np.cos(3 * b[None, :]) + b[None, :]


def pairs(a, b):
    return np.column_stack([np.repeat(a, len(b)), np.tile(b, len(a))])


def test_it_is_the_dense_gp():
    a, b = np.linspace(0, 1, 7), np.linspace(0, 1, 5)
    y = surface(a, b) + 0.05 * np.random.default_rng(0).standard_normal((7, 5))
    fitted = fit_grid(a, b, y)
    points, query = pairs(a, b), np.random.default_rng(1).random((9, 2))

    def cov(p, q):
        ka = parse("rbf", 1).covariance(np, fitted.theta_a, p[:, :1], q[:, :1])
        return ka * parse("rbf", 1).covariance(np, fitted.theta_b, p[:, 1:], q[:, 1:])

    k = cov(points, points) + np.exp(2 * fitted.theta_a[1]) * np.eye(35)
    cross = cov(points, query)
    scaled = (y.reshape(-1) - fitted.units.centre) / fitted.units.scale
    mean, sd = fitted.predict(query)
    np.testing.assert_allclose(
        (mean - fitted.units.centre) / fitted.units.scale,
        cross.T @ np.linalg.solve(k, scaled),
        atol=1e-5,
    )
    variance = np.diag(cov(query, query) - cross.T @ np.linalg.solve(k, cross))
    np.testing.assert_allclose((sd / fitted.units.scale) ** 2, variance, atol=1e-5)
    dense = -0.5 * (scaled @ np.linalg.solve(k, scaled) + np.linalg.slogdet(2 * np.pi * k)[1])
    assert fitted.solved.value == pytest.approx(dense, rel=1e-4)


def test_twelve_thousand_points_take_seconds():
    a, b = np.linspace(0, 1, 251), np.linspace(0, 1, 51)
    y = surface(a, b) + 0.02 * np.random.default_rng(0).standard_normal((251, 51))
    start = time.process_time()
    fitted = fit_grid(a, b, y)
    spent = time.process_time() - start
    print(f"12,801 points: {spent:.2f} s of processor")
    query = np.random.default_rng(1).random((200, 2))
    mean, sd = fitted.predict(query)
    truth = np.sin(6 * query[:, 0]) * np.cos(3 * query[:, 1]) + query[:, 1]
    assert np.sqrt(np.mean((mean - truth) ** 2)) < 0.005
    assert np.mean(np.abs(mean - truth) < 1.96 * sd) > 0.85
    assert spent < 20
