"""What every averaged model of one output has to do, and what each becomes in the right limit."""

import numpy as np
import pytest

from planner.surrogate.kernels import perdikaris
from planner.surrogate.models.averaged import fit_averaged
from planner.surrogate.models.likelihood_gp import Exact, Samples

GRID = np.random.default_rng(8).random((40, 2))
SPREAD = 0.5


def low(x):
    return np.sin(4 * x[:, 0]) + x[:, 1]


def high(x):
    return 1.2 * low(x) + 0.3 * x[:, 1] + 2.0


MODELS = {
    "GP": lambda s: fit_averaged(s),
    "AR1": lambda s: fit_averaged(s, "matern52", Exact(low), SPREAD),
    "AR1-NARGP": lambda s: fit_averaged(s, perdikaris(2), Exact(low), SPREAD, sees_low=True),
}


def samples(n, seed=0, sd=0.01):
    rng = np.random.default_rng(seed)
    x = rng.random((n, 2))
    return Samples.of(x, high(x) + sd * rng.standard_normal(n), sd)


@pytest.fixture(params=MODELS)
def fit(request):
    return MODELS[request.param]


def test_any_number_of_points_duplicates_constants_and_gaps_work(fit):
    s = samples(4)
    doubled = Samples.of(np.vstack([s.x, s.x]), np.r_[s.y, s.y + 0.01], 0.01)
    constant = Samples.of(s.x, np.full(4, 3.0))
    holed = Samples.of(s.x, np.where(np.arange(4) == 1, np.nan, s.y), s.sd)
    assert len(holed.y) == 3
    for given in (samples(1), samples(2), samples(9), doubled, constant, holed):
        mean, sd = fit(given).predict(GRID)
        assert mean.shape == sd.shape == (40,)
        assert np.isfinite(mean).all()
        assert (sd > 0).all()


def test_a_noisy_point_pulls_less(fit):
    s = samples(8)
    off = s.y + np.where(np.arange(8) == 3, 1.0, 0.0)
    believed = fit(Samples.of(s.x, off, 0.01)).predict(s.x)[0][3]
    doubted = fit(Samples.of(s.x, off, np.where(np.arange(8) == 3, 2.0, 0.01))).predict(s.x)[0][3]
    assert abs(doubted - s.y[3]) < 0.5 * abs(believed - s.y[3])


def test_where_zero_lies_and_a_gp_s_unit_do_not_matter(fit):
    s = samples(7)
    mean, sd = fit(s).predict(GRID)
    scale = 1000 if fit is MODELS["GP"] else 1
    other = fit(Samples.of(s.x, scale * s.y - 5, scale * s.sd)).predict(GRID)
    np.testing.assert_allclose(other[0], scale * mean - 5, atol=1e-6 * scale)
    np.testing.assert_allclose(other[1], scale * sd, rtol=1e-4)


def test_ar1_nargp_follows_a_bent_relation_that_ar1_cannot():
    x = np.random.default_rng(3).random((14, 1))
    wave = Exact(lambda x: np.sin(8 * np.pi * x[:, 0]))  # Perdikaris et al. 2017, section 3.1

    def bent(x):
        return (x[:, 0] - 2**0.5) * wave.function(x) ** 2

    grid = np.linspace(0, 1, 101)[:, None]
    s = Samples.of(x, bent(x))
    off = [
        np.sqrt(np.mean((fit_averaged(s, *how).predict(grid)[0] - bent(grid)) ** 2))
        for how in ((perdikaris(1), wave, 0.7, True), ("matern52", wave, 0.7))
    ]
    assert off[0] < 0.25 * off[1]


def test_evidence_is_the_integral_over_the_prior():
    """Against plain draws from the prior, with own formulas."""
    s = samples(5, sd=0.1)
    rng = np.random.default_rng(0)
    scale, centre = np.std(s.y), np.mean(s.y)
    y, noise = (s.y - centre) / scale, s.sd / scale
    logs = []
    for _ in range(20000):
        sigma, nugget = np.exp(rng.standard_normal()), 1e-3 * np.exp(rng.standard_normal())
        scaled = s.x / (0.8 * 2**0.5 * np.exp(0.8 * rng.standard_normal(2)))
        r = np.sqrt(5 * np.sum((scaled[:, None] - scaled[None]) ** 2, axis=-1))
        k = sigma**2 * (1 + r + r**2 / 3) * np.exp(-r) + 1 + np.diag(noise**2 + nugget**2)
        logs.append(-0.5 * (y @ np.linalg.solve(k, y) + np.linalg.slogdet(2 * np.pi * k)[1]))
    expected = np.log(np.mean(np.exp(logs)))
    assert fit_averaged(s).model.log_evidence[0] == pytest.approx(expected, abs=0.1)
