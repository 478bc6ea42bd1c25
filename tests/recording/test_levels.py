"""Which hits are of one force level."""

from pathlib import Path

import numpy as np
import pytest

from planner.dataset.dataset import Dataset, Visit
from planner.recording.force_levels import levels
from planner.recording.records import Hit


def pushed(peak):
    force = np.zeros(64)
    force[8] = peak
    return Hit(Path("hit"), "+x", 400.0, force, np.zeros((3, 64)))


def scattered(rng, *usual, count=8):
    """Nobody hits alike twice."""
    return [peak * factor for peak in usual for factor in rng.uniform(0.75, 1.25, count)]


@pytest.mark.parametrize("seed", range(10))
def test_levels_are_told_apart_whether_or_not_forces_lie_in_between(seed):
    rng = np.random.default_rng(seed)
    assert len(levels(np.sort(scattered(rng, 1000.0, count=20)))) == 1
    found = levels(np.sort(scattered(rng, 400.0, 1000.0, 2500.0)))
    assert [len(group) for group in found] == [8, 8, 8]
    # Hits asked for between the levels so far fill the gap that told them apart.
    between = scattered(rng, 1400.0, 1700.0, 2000.0, 2500.0, count=2)
    assert len(levels(np.sort(scattered(rng, 1200.0, 3000.0) + between))) > 1
    hits = tuple(pushed(peak) for peak in rng.permutation(np.geomspace(500, 3500, 24)))
    recorded = Dataset.of_visits((Visit("P1", np.zeros(6), 0.0, hits),), (5.0, 50.0))
    groups = levels(np.sort([hit.pulse.peak_n for hit in hits]))
    assert all(hit.pulse.peak_n in groups[recorded.level(hit)] for hit in hits)
