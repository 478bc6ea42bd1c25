"""Which hits are of one force level."""

from pathlib import Path

import numpy as np

from planner.dataset.dataset import Dataset, Visit
from planner.recording.force_levels import levels, peak_n
from planner.recording.records import Hit


def pushed(peak):
    force = np.zeros(64)
    force[8] = peak
    return Hit(Path("hit"), "+x", 400.0, force, np.zeros((3, 64)))


def scattered(rng, *usual, count=8):
    """Nobody hits alike twice."""
    return [peak * factor for peak in usual for factor in rng.uniform(0.75, 1.25, count)]


def test_a_level_is_one_though_nobody_hits_alike_twice():
    for seed in range(30):
        peaks = np.sort(scattered(np.random.default_rng(seed), 1000.0, count=20))
        assert len(levels(peaks)) == 1


def test_levels_with_gaps_between_them():
    for seed in range(30):
        rng = np.random.default_rng(seed)
        found = levels(np.sort(scattered(rng, 400.0, 1000.0, 2500.0)))
        assert [len(group) for group in found] == [8, 8, 8]


def test_forces_in_between_do_not_make_one_level_of_two():
    """Hits asked for between the levels so far fill the gap that told them apart."""
    for seed in range(30):
        rng = np.random.default_rng(seed)
        peaks = np.sort(
            scattered(rng, 1200.0, 3000.0) + scattered(rng, 1400.0, 1700.0, 2000.0, 2500.0, count=2)
        )
        assert len(levels(peaks)) > 1


def test_hits_are_of_the_level_whose_cluster_holds_them():
    for seed in range(30):
        rng = np.random.default_rng(seed)
        hits = tuple(pushed(peak) for peak in rng.permutation(np.geomspace(500, 3500, 24)))
        recorded = Dataset.of_visits((Visit("P1", np.zeros(6), 0.0, hits),), (5.0, 50.0))
        groups = levels(np.sort([peak_n(hit) for hit in hits]))
        for hit in hits:
            assert peak_n(hit) in groups[recorded.level(hit)]
