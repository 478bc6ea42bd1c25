"""The scatter from visit to visit is learned, by all modes together, and is in predicted sds."""

from dataclasses import replace

import numpy as np
import pytest

from planner.surrogate.importance import normal_points, sample
from planner.surrogate.modal_surrogate import fit_primary, fit_surrogate
from tests.support.surrogates import observed, simulated, true_hz
from tests.support.visit_scatter import (
    MODES,
    OFF,
    ROBOTS,
    observations,
    visited,
)

KNOWN = np.full(MODES, OFF), 0.99  # a simulation that was identified and fits


def scatter_percent(fitted):
    return 100 * np.sqrt(fitted.nugget_variance)


@pytest.mark.parametrize(("n", "scatter"), [(3, 0.003), (12, 0.01)])
def test_intervals_hold_new_visits_beside_an_identified_simulation(n, scatter):
    inside = []
    for robot in ROBOTS:
        for seed in range(4):
            case = visited(robot, "identified", n, scatter, seed)
            mean, sd = fit_primary(case.seen, *KNOWN).predict(case.x, case.simulated, nugget=True)
            inside.append(np.mean(np.abs(mean - case.shown) < 1.96 * sd))
    assert np.mean(inside) > 0.86


def test_a_pose_visited_again_tells_the_scatter():
    rng = np.random.default_rng(0)
    x, low = rng.random((4, 3)), np.log(rng.uniform(8, 40, (4, MODES)))
    twice, again = np.tile(x, (2, 1)), np.tile(low, (2, 1))
    bend = 0.05 * np.sin(3 * twice[:, :1] + np.arange(MODES))
    alike = observations(twice, again + bend, again)
    apart = observations(twice, again + bend + 0.01 * np.repeat([[1.0], [-1.0]], 4, axis=0), again)
    quiet, loud = (scatter_percent(fit_primary(seen)) for seen in (alike, apart))
    assert quiet.max() < 0.2
    assert loud.min() > 0.6
    assert loud.max() < 2.0


def test_modes_learn_the_scatter_from_one_another():
    case = visited("kr10", "offset", 8, 0.0, 1)
    one = np.arange(MODES) == 0
    hz = np.where(one[None, :] & (np.arange(8) > 1)[:, None], np.nan, case.seen.frequency_hz)
    with_others = fit_primary(replace(case.seen, frequency_hz=hz))
    low = np.log(case.seen.simulated.frequency_hz[:, :1])
    alone = fit_primary(observations(case.seen.x, np.log(hz[:, :1]), low))
    assert scatter_percent(with_others)[0] < 0.7 * scatter_percent(alone)[0]


def test_what_outputs_share_is_learned_from_all_of_them():
    # Three outputs say that the second coordinate is 2 ± 0.3, the fourth nothing at all.
    def score(z):
        told = -0.5 * ((z[:, :, 1] - 2.0) / 0.3) ** 2
        return told * np.array([1.0, 1.0, 1.0, 0.0])[:, None]

    normal = [normal_points(512, 3, seed) for seed in (1, 2)]
    together, evidence = sample(score, normal, 4, 64, shared=np.full(4, 0.7))
    apart, alone = sample(score, normal, 4, 64)
    np.testing.assert_array_equal(evidence, alone)
    # Exactly: µ given z_1 … z_3 is normal; z_4 is √0.7 µ.
    variance = 0.3 + 0.3**2 * np.ones(3)
    precision = 1 + np.sum(0.7 / variance)
    expected = np.sqrt(0.7) * np.sum(np.sqrt(0.7) * 2.0 / variance) / precision
    assert together[3, :, 1].mean() == pytest.approx(expected, abs=0.1)
    assert apart[3, :, 1].mean() == pytest.approx(0.0, abs=0.1)
    np.testing.assert_allclose(together[3, :, 0].std(), 1.0, atol=0.15)  # the others stay


def test_further_poses_narrow_the_mean_and_not_a_visit():
    x = np.random.default_rng(3).random((20, 2))
    seen = observed(12, 0)
    rng = np.random.default_rng(1)
    hz = seen.frequency_hz * np.exp(0.01 * rng.standard_normal(seen.frequency_hz.shape))
    fitted = fit_surrogate(replace(seen, frequency_hz=hz), residues=False)
    visit, mean = (fitted.predict(x, simulated(x), v) for v in (True, False))
    np.testing.assert_array_equal(visit.frequency_hz, mean.frequency_hz)
    added = visit.frequency_sd_hz**2 - mean.frequency_sd_hz**2
    share = np.sqrt(added) / visit.frequency_hz
    assert (share > 0.005).all()
    assert (share < 0.02).all()
    off = np.log(visit.frequency_hz / true_hz(x, 1.12))
    assert np.sqrt(np.mean(off**2)) < 0.02
