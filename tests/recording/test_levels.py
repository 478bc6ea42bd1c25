"""Which hits are of one force level."""

import numpy as np

from planner.recording.levels import levels


def scattered(rng, *usual, count=8):
    """Nobody hits alike twice."""
    return [peak * factor for peak in usual for factor in rng.uniform(0.75, 1.25, count)]


def test_a_level_is_one_however_people_scatter():
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
        found = levels(peaks)
        assert len(found) > 1
        np.testing.assert_array_equal(np.concatenate(found), peaks)
        low, high = (int(np.argmin([np.abs(g - p).min() for g in found])) for p in (1000, 3000))
        assert low < high
