"""Light damping from short records: what is cut off or windowed is part of what is fitted."""

from dataclasses import replace

import numpy as np
import pytest

from planner.frf.estimator import estimate
from planner.frf.synthesis import pole
from planner.modal.estimate_modes import estimate_modes
from planner.recording.records import Hit
from tests.support.simulated_hits import make_hit

BAND = (4.0, 60.0)
FREQUENCY_HZ = np.array([9.0, 14.0, 31.0, 47.0])
DAMPING, RECORD_S, RATE_1_S = 0.003, 2.0, 2.0


def struck(seed: int) -> tuple[Hit, ...]:
    """Twelve 2-s records of four modes of 0.3 % damping, which ring for half a minute."""
    rng = np.random.default_rng(seed)
    poles = pole(FREQUENCY_HZ, np.full(4, DAMPING))
    shape = rng.normal(size=(4, 3))
    shape /= np.linalg.norm(shape, axis=1, keepdims=True)
    residues = np.einsum("mi,mj->mij", shape, shape) * (1e-3 / (2j * poles.imag))[:, None, None]
    return tuple(
        make_hit(rng, axis, 0.01, record_s=RECORD_S, poles=poles, residues=residues)
        for axis in ("+x", "+y", "+z")
        for _ in range(4)
    )


def windowed(hit: Hit) -> Hit:
    """The same as an analyser with an exponential window delivers it."""
    window = np.exp(-RATE_1_S * np.arange(hit.force_n.size) / hit.sampling_rate_hz)
    quiet = np.median(hit.force_n)
    force = (hit.force_n - quiet) * window
    return replace(hit, force_n=force, acceleration_m_s2=hit.acceleration_m_s2 * window)


def identified(hits: tuple[Hit, ...], case: str) -> np.ndarray:
    """Damping ratios of the modes by one of the three ways."""
    if case == "no window":
        frf = estimate(hits, BAND)
    elif case == "window laid over the records here":
        frf = estimate(hits, BAND, exponential_rate_1_s=RATE_1_S)
    else:
        recorded = tuple(windowed(hit) for hit in hits)
        frf = replace(estimate(recorded, BAND), exponential_rate_1_s=RATE_1_S)
    modes = estimate_modes(frf, BAND).modes
    np.testing.assert_allclose([m.frequency_hz for m in modes], FREQUENCY_HZ, rtol=2e-3)
    return np.array([m.damping_ratio for m in modes])


@pytest.mark.parametrize(
    "case", ["no window", "window laid over the records here", "window of the analyser, told"]
)
def test_damping_of_a_third_of_a_percent_from_two_seconds(case):
    found = np.array([identified(struck(seed), case) for seed in range(4)])
    assert np.max(np.abs(found / DAMPING - 1)) < 0.10
