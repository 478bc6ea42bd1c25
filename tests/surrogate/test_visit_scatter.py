"""The scatter from visit to visit is learned, and is in predicted sds; what damping is believed.

A visit's ln f is the pose's plus scatter, half of its variance common to all modes, half each
mode's own; EMA adds a noise whose sd it states.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from planner.dynamics.vibration import SimulatedModes
from planner.surrogate.importance import normal_points, sample
from planner.surrogate.modal_surrogate import (
    ModalObservations,
    fit_damping,
    fit_primary,
    fit_surrogate,
)
from tests.support.surrogates import observed, simulated, true_hz

ROBOTS, MODES, POOL, NEW_VISITS = 6, 4, 150, 100
EMA_SD = 1e-3  # of ln f
OFF = 0.003  # rms of ln f that an identified simulation is off by, smoothly over the poses


@cache
def robot(seed: int) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Poses x (POOL, 6) in [0, 1], and ln f (POOL, MODES): the truth's and two simulations'."""
    rng = np.random.default_rng(seed)
    x = rng.random((POOL, 6))
    truth = np.log([9.0, 13.0, 22.0, 31.0]) + 0.1 * _smooth(x, rng)
    identified = truth + OFF * _smooth(x, rng)
    offset = truth + 0.05 * rng.standard_normal(MODES) + OFF / 3 * _smooth(x, rng)
    return x, truth, {"identified": identified, "offset": offset}


def _smooth(x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(n, MODES) of rms 1: sums of waves over the box."""
    directions = 2.0 * rng.standard_normal((MODES, 8, x.shape[1]))
    waves = np.cos(np.einsum("mwd,nd->nmw", directions, x) + 2 * np.pi * rng.random((MODES, 8)))
    total = waves.sum(axis=2)
    return total / np.sqrt(np.mean(total**2, axis=0))


def visits(shape: tuple[int, int], scatter: float, rng: np.random.Generator) -> np.ndarray:
    """What visits add to ln f (n, k): half of the variance is common to a visit's modes."""
    common, own = rng.standard_normal((shape[0], 1)), rng.standard_normal(shape)
    return scatter * np.sqrt(0.5) * (common + own)


@dataclass(frozen=True, eq=False)
class Visited:
    """Measured poses, and new visits elsewhere: x (u, d), simulated ln f and what they show."""

    seen: ModalObservations
    x: np.ndarray
    simulated: np.ndarray
    shown: np.ndarray


def visited(number: int, simulation: str, n: int, scatter: float, seed: int) -> Visited:
    """A robot measured at n poses, and NEW_VISITS (less what there is not) at others."""
    x, truth, simulated = robot(number)
    rng = np.random.default_rng([seed, n, number])
    order = rng.permutation(POOL)
    used, new = order[:n], order[n : n + NEW_VISITS]
    low = simulated[simulation]
    measured = truth[used] + visits((n, MODES), scatter, rng)
    measured += EMA_SD * rng.standard_normal((n, MODES))
    shown = truth[new] + visits((len(new), MODES), scatter, rng)
    return Visited(observations(x[used], measured, low[used]), x[new], low[new], shown)


def observations(x: np.ndarray, measured: np.ndarray, low: np.ndarray) -> ModalObservations:
    """ln f (n, k) measured and simulated, as the surrogate wants them; damping says nothing."""
    n, k = measured.shape
    nothing, residue = np.full((n, k), np.nan), np.full((n, k, 3, 3), np.nan + 0j)
    hz = np.exp(measured)
    simulated = SimulatedModes(np.exp(low), nothing, residue)
    sds = np.full((n, k, 3, 3), np.nan)
    return ModalObservations(x, hz, EMA_SD * hz, nothing, nothing, residue, sds, simulated)


KNOWN = np.full(MODES, OFF), 0.99  # a simulation that was identified and fits


def scatter_percent(fitted):
    return 100 * np.sqrt(fitted.nugget_variance)


@pytest.mark.parametrize(("n", "scatter"), [(3, 0.003), (12, 0.01)])
def test_intervals_hold_new_visits_beside_an_identified_simulation(n, scatter):
    inside = []
    for number in range(ROBOTS):
        for seed in range(2):
            case = visited(number, "identified", n, scatter, seed)
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


MEASURED, ASKED = 10, 60


def cell(seed, follows):
    """Poses, the simulation's damping (n, 3), and the robot's, which follows it or does not."""
    rng = np.random.default_rng(seed)
    x = rng.random((MEASURED + ASKED, 2))
    over = np.exp(1.2 * (x[:, :1] - 0.5) + 0.5 * np.sin(4 * x[:, 1:]))
    simulated = 0.03 * over * np.array([1.0, 1.2, 1.5])
    true = 1.05 * simulated if follows else np.full_like(simulated, 0.035)
    scatter = 0.02 if follows else 0.35
    return x, simulated, true * np.exp(scatter * rng.standard_normal(true.shape))


def predicted(x, simulated, zeta):
    """ln ζ (ASKED, 3) and its sd by a simulation that was identified from the measured poses."""
    n = MEASURED
    f = np.broadcast_to(np.array([10.0, 20.0, 30.0]), (n, 3))
    residue = np.ones((n, 3, 3, 3))
    modes = SimulatedModes(f, simulated[:n], residue.astype(complex))
    seen = ModalObservations(
        x[:n], f, 0.01 * f, zeta[:n], 0.02 * zeta[:n], residue.astype(complex), residue, modes
    )
    return fit_damping(seen, identified=True).predict(x[n:], np.log(simulated[n:]))


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("follows", [False, True])
def test_damping_is_predicted_by_the_simulation_only_where_it_follows_it(seed, follows):
    x, simulated, zeta = cell(seed, follows)
    mean, sd = predicted(x, simulated, zeta)
    true = np.log(zeta[MEASURED:])
    off = np.sqrt(np.mean((mean - true) ** 2))
    if follows:
        assert off < 0.05
        assert sd.max() < 0.1
    else:
        constant = np.log(zeta[:MEASURED]).mean(axis=0)
        same = np.sqrt(np.mean((constant - true) ** 2))
        assert off < 1.1 * same  # 1.3 to 1.7 times, where the simulation is believed
