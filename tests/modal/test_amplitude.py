"""Force levels: grouping, proportional structures, and structures that soften."""

import numpy as np
import pytest

from planner.frf.estimator import estimate
from planner.modal.estimate_modes import estimate_modes
from planner.modal.homogeneity import homogeneity
from planner.recording.records import Hit
from tests.support.simulated_hits import POLES, RESIDUES, make_hit

BAND = (4.0, 60.0)
LEVELS_N = (100.0, 400.0, 1600.0)


def struck(seed: int, softening: float = 0.0, levels: tuple[float, ...] = LEVELS_N):
    """Two hits per level and axis; `softening` lowers mode 1 by that share per factor of four."""
    rng = np.random.default_rng(seed)
    hits: list[Hit] = []
    for number, level in enumerate(levels):
        poles = POLES.copy()
        poles[0] *= 1 - softening * number
        for axis in ("+x", "+y", "+z"):
            for _ in range(2):
                peak = level * rng.uniform(0.8, 1.2)
                hits.append(make_hit(rng, axis, 0.01, peak_n=peak, poles=poles))
    return tuple(hits)


def judged(hits: tuple[Hit, ...]):
    """What is found, and said of it."""
    found = homogeneity(hits, estimate_modes(estimate(hits, BAND), BAND), BAND)
    return found or (None, "")


def test_one_level_has_nothing_to_compare():
    assert judged(struck(0, levels=(500.0,))) == (None, "")


@pytest.mark.parametrize("seed", range(2))
def test_a_mode_that_softens_is_told(seed):
    found, remark = judged(struck(seed, softening=0.02))
    assert found is not None
    assert not found.homogeneous
    assert found.p_value < 1e-3
    assert "not proportional" in remark
    assert "mode 1 moves" in remark
    low, high = found.levels[0], found.levels[-1]
    assert high.frequency_hz[0] / low.frequency_hz[0] == pytest.approx(0.96, abs=0.005)
    assert high.frequency_hz[1] / low.frequency_hz[1] == pytest.approx(1.0, abs=0.003)
    assert [level.hits for level in found.levels] == [6, 6, 6]


def aimed(seed: int, repeats: int = 2):
    """A linear structure hit by a hand that tilts by 2° in each direction."""
    rng = np.random.default_rng(seed)
    hits: list[Hit] = []
    for level in LEVELS_N:
        for axis in range(3):
            for _ in range(repeats):
                tilt = np.deg2rad(2.0) * rng.standard_normal(3) * (1 - np.eye(3)[axis])
                moved = RESIDUES.copy()
                moved[..., axis] += RESIDUES @ tilt
                peak = level * rng.uniform(0.8, 1.2)
                hits.append(make_hit(rng, "+" + "xyz"[axis], 0.01, peak_n=peak, residues=moved))
    return tuple(hits)


@pytest.mark.parametrize("hits", [struck, aimed])
@pytest.mark.parametrize("seed", range(2))
def test_a_linear_structure_is_homogeneous_though_hits_tilt(seed, hits):
    found, remark = judged(hits(seed))
    assert found is not None
    assert remark == ""
    assert found.homogeneous
    assert found.p_value > 1e-3


def test_without_repeats_it_is_said_what_would_tell():
    found, remark = judged(aimed(3, 1))
    assert found is not None
    assert found.homogeneous
    assert found.difference > 0.03
    assert "hit twice at each level" in remark
