"""What the weights must do whatever the robot."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear
from scipy.stats import multivariate_normal

from planner.diagnosis.linear.discrepancy import InnerProducts, Worth
from planner.diagnosis.linear.evidence import shares_of
from planner.diagnosis.thresholds import ALIKE, DISCREPANCIES, NOISE_OVERSTATED
from planner.identification.objective import FARTHEST
from planner.inference.evidence import shared_noise, temper
from planner.measurement.nuisances import OpenNumbers

POSES = 9


@given(st.floats(0.5, 1e6), st.floats(1.0, 10.0))
def test_temper_grows_with_the_misfit(misfit, shared):
    now = temper(misfit, ALIKE, shared=shared, least=NOISE_OVERSTATED)
    assert now >= min(misfit, 1.0) * shared
    assert temper(1.1 * misfit, ALIKE, shared=shared, least=NOISE_OVERSTATED) >= now


@given(st.floats(0.05, 2.0), st.floats(0.1, 5.0))
def test_shared_noise_is_the_sum_over_lags(spacing_hz, rate_1_s):
    lag = np.arange(-200_000, 200_001)
    a = 2 * np.pi * spacing_hz / (2 * rate_1_s)
    direct = np.sum(1 / (1 + (a * lag) ** 2))
    assert abs(shared_noise(spacing_hz, rate_1_s) / direct - 1) < 1e-2
    assert shared_noise(spacing_hz, 0.0) == 1.0


def worth(evidence: float, size: float) -> Worth:
    """Of a fit whose discrepancy is known to have one of the sizes."""
    place = DISCREPANCIES.index(size)
    by_size = np.full(len(DISCREPANCIES), -1e9)
    by_size[place] = evidence
    scores = np.full((len(DISCREPANCIES), POSES), -2 * evidence / POSES)
    return Worth(by_size, scores, 1.0, size, np.zeros(14), np.zeros((len(by_size), 0)))


def shares(
    *fits: tuple[float, float, float], prior=None, bent: np.ndarray | float = 0.0
) -> np.ndarray:
    """Of fits with log evidence, size of the discrepancy, and what is left."""
    left = np.array([one[2] for one in fits])
    made = [worth(evidence, size) for evidence, size, _ in fits]
    return shares_of(made, left, prior or [100.0] + [1.0] * (len(fits) - 1), 0.03, 1e-3, bent=bent)


@given(
    st.lists(
        st.tuples(st.floats(-1e6, 0), st.sampled_from(DISCREPANCIES), st.floats(0, 2)), min_size=1
    )
)
def test_probabilities_sum_to_one(fits):
    found = shares(*fits)
    assert len(found) == len(fits) + 1
    assert np.all(found >= 0)
    assert found.sum() == pytest.approx(1.0)


def test_what_is_as_small_as_every_simulation_errs_is_nothing():
    assert shares((-900.0, 1e-3, 0.004))[0] > 0.99
    assert shares((-900.0, 1e-2, 0.01))[0] > 0.98  # it does not matter


def test_what_takes_little_of_what_does_not_matter_is_not_named():
    """Something unknown, a third of a percent of |H|, of which an effect imitates a little."""
    none, effect, unknown = shares((-1070.0, 1e-2, 0.003), (-900.0, 1e-2, 0.0026))
    assert none > max(effect, unknown)


def test_an_effect_that_takes_nearly_all_is_named_however_surely():
    none, effect, unknown = shares((-900.0, 0.1, 0.3), (-500.0, 1e-3, 0.004))
    assert effect > 0.999
    assert none + unknown < 1e-3


def test_what_leaves_most_of_it_is_beside_something_unknown():
    """An effect takes a third of the mismatch; poses do not agree on its parameters."""
    assert shares((-900.0, 0.1, 0.3), (-500.0, 0.1, 0.2))[-1] > 0.99


def test_what_does_not_say_more_than_each_pose_for_itself_is_not_named():
    """Twelve nats, as a spring gains that is free to change by 1 % with its joint's angle."""
    none, effect, _ = shares((-900.0, 1e-3, 0.01), (-899.0, 1e-3, 0.009))
    assert none > 0.95 > effect


@given(st.floats(0.03, 1.0), st.floats(1.0, 3.0))
def test_the_more_is_left_the_likelier_is_something_unknown(left, factor):
    now = shares((-900.0, 3e-3, left))[-1]
    assert shares((-900.0, 3e-3, factor * left))[-1] >= now - 1e-9


def test_what_bends_the_simulation_far_is_beside_something_unknown():
    """An effect that takes most of the mismatch once springs lie far from where they are stated."""
    fits = (-900.0, 0.1, 0.3), (-500.0, 1e-2, 0.04)
    assert shares(*fits)[1] > 0.5
    assert shares(*fits, bent=np.array([[20.0], [12.0]]))[-1] > 0.99


def test_little_is_left_of_what_matters_only_where_refitting_bends_little():
    fits = (-900.0, 1e-2, 0.01), (-500.0, 3e-2, 0.009)
    assert shares(*fits)[0] > 0.9
    assert shares(*fits, bent=np.array([[15.0], [12.0]]))[-1] > 0.9


def test_evidence_is_that_of_one_normal_distribution():
    """Linear model: residuals, numbers open pose by pose, in common, and parameters; dense."""
    rng = np.random.default_rng(3)
    values, free, chain, springs, poses, temper_ = 14, 3, 2, 2, 3, 1.7
    sd, x, mean = rng.uniform(0.5, 2, free), rng.normal(size=free), rng.normal(size=free)
    r = rng.normal(size=(poses, values))
    b, d = rng.normal(size=(poses, 2, values)), rng.normal(size=(poses, springs, values))
    c, j = rng.normal(size=(poses, chain, values)), rng.normal(size=(poses, free, values))
    rows = np.concatenate([r[:, None], b, d, c, j], axis=1)
    misfit = SimpleNamespace(
        free=np.ones(free, bool), sd=sd, mean=mean, counts=np.array([42]),
        sides=(np.full(free, -np.inf), np.full(free, np.inf)),
    )  # fmt: skip
    made = InnerProducts(
        cast(Any, SimpleNamespace(misfit=misfit, x=x)),
        rows @ np.swapaxes(rows, 1, 2), np.array([0, 0, 1.0, 5.0]), OpenNumbers(0, chain),
    )  # fmt: skip

    def dense(size: float) -> float:
        # r holds where x is as it is: the priors' means are elsewhere.
        expected = r - np.einsum("kpv,p->kv", j, x - mean)
        whole = temper_ * np.eye(poses * values)
        for k in range(poses):
            own = slice(k * values, (k + 1) * values)
            loose = size * np.array([1.0, 5.0])[:, None] * d[k]
            whole[own, own] += b[k].T @ b[k] + loose.T @ loose
        common = np.concatenate([np.swapaxes(c, 0, 1), sd[:, None, None] * np.swapaxes(j, 0, 1)])
        flat = common.reshape(chain + free, -1)
        return float(multivariate_normal.logpdf(expected.ravel(), cov=whole + flat.T @ flat))

    told = [made.at(size, temper_).evidence - dense(size) for size in (0.0, 0.01, 0.3)]
    assert np.ptp(told) < 1e-8


def test_evidence_counts_no_values_beyond_those_that_are_looked_at():
    """A parameter that the data pull to 30 prior sds: χ² is the least within the range."""
    rng = np.random.default_rng(5)
    values, free, poses = 20, 3, 2
    sd, mean = rng.uniform(0.5, 2, free), np.zeros(free)
    x = 0.9 * FARTHEST * sd * np.array([-1.0, 0.0, 0.1])
    j = rng.normal(size=(poses, free, values))
    pulled = sd * np.array([-30.0, 0.3, -0.2])
    r = np.einsum("kpv,p->kv", j, x - pulled) + 0.1 * rng.normal(size=(poses, values))
    rows = np.concatenate([r[:, None], j], axis=1)
    misfit = SimpleNamespace(
        free=np.ones(free, bool), sd=sd, mean=mean, counts=np.array([40]),
        sides=(-FARTHEST * sd, FARTHEST * sd),
    )  # fmt: skip
    made = InnerProducts(
        cast(Any, SimpleNamespace(misfit=misfit, x=x)),
        rows @ np.swapaxes(rows, 1, 2), np.zeros(0), OpenNumbers(0, 0),
    )  # fmt: skip
    white = np.concatenate([np.concatenate(j, axis=1).T * sd, np.eye(free)])
    away = x / sd
    target = np.concatenate([-r.ravel(), -away])
    best = lsq_linear(white, target, (-FARTHEST - away, FARTHEST - away))
    told = made.at(0.0, 1.0)
    end = made.end(told.best)
    np.testing.assert_allclose((end - x) / sd, best.x, atol=1e-8)
    assert abs(end[0] / sd[0] + FARTHEST) < 1e-9
    least = 2 * best.cost - np.sum((away + best.x) ** 2)
    np.testing.assert_allclose([told.scores.sum(), told.chi2], least, rtol=1e-9)
    volume = np.linalg.slogdet(white.T @ white)[1]
    assert abs(told.evidence + best.cost + volume / 2) < 1e-6 * best.cost
    # Where x stays, all of it is left.
    assert abs(told.stays + (r.ravel() @ r.ravel() + away @ away + volume) / 2) < 1e-6 * best.cost
