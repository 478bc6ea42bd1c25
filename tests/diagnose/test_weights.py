"""What the weights must do whatever the robot."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from planner.diagnosis.effects.effect import Effect, Quantity
from planner.diagnosis.linear.evidence import weigh
from planner.diagnosis.thresholds import ALIKE, NOISE_OVERSTATED
from planner.inference.evidence import shared_noise, temper


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


@dataclass(frozen=True)
class Rough:
    """A fit far above the noise: `bent` is what its springs cost, in nats."""

    misfit_: float
    bent: float
    effect: Effect = field(default_factory=lambda: Effect(""))

    @property
    def per_value(self):
        return self.misfit_

    @property
    def misfit(self):
        frequency = np.tile(np.arange(100.0), (9, 1))
        measured = SimpleNamespace(frequency_hz=frequency, s=2j * np.pi * frequency)
        return SimpleNamespace(measured=measured, counts=np.full(9, 1000.0))

    @property
    def data(self):
        return SimpleNamespace(chi2=np.full(9, 1000.0 * self.misfit_))

    def log_evidence(self, temper):
        return -9000 * self.misfit_ / (2 * temper) - self.bent


def test_what_fits_nowhere_is_unknown_however_far_springs_were_bent_to_imitate_it():
    """A feedback loop (misfit 490): once the refit's bent springs were held against "unknown"."""
    fits = cast(Any, [Rough(492.0, 400.0), Rough(537.0, 140.0)])
    assert weigh(fits, [100.0, 1.0]).probabilities[-1] > 0.99


def test_what_fits_to_the_noise_is_not_unknown():
    fits = cast(Any, [Rough(200.0, 300.0), Rough(0.9, 150.0)])
    assert weigh(fits, [100.0, 1.0]).probabilities[1] > 0.99


@given(st.floats(0.001, 0.0095), st.floats(0.5, 0.99))
def test_what_changes_frfs_far_below_the_noise_is_not_named(gain, misfit):
    """As a spring that changed by 1 % with its joint's angle, at two poses: 0.7 % of χ²."""
    made_up = Effect("joint_4", (Quantity("cosine", "N·m/rad", 0.0, 1e4),))
    fits = cast(Any, [Rough(misfit, 10.0), Rough(misfit * (1 - gain), 10.0, made_up)])
    none, effect, _ = weigh(fits, [1.0, 0.02]).probabilities
    assert none > 0.9 > effect


@given(st.floats(0.02, 0.5), st.floats(0.5, 0.99))
def test_what_changes_them_by_more_counts_as_it_is(gain, misfit):
    made = Effect("joint_4", (Quantity("cosine", "N·m/rad", 0.0, 1e4),))
    with_own = weigh(
        cast(Any, [Rough(misfit, 10.0), Rough(misfit * (1 - gain), 10.0, made)]), [1, 1]
    )
    without = weigh(cast(Any, [Rough(misfit, 10.0), Rough(misfit * (1 - gain), 10.0)]), [1, 1])
    assert np.allclose(with_own.probabilities, without.probabilities)
