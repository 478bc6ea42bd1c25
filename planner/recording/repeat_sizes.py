"""Repeats of a hit that differ by a factor: one of the files is in another unit, or mis-scaled."""

import numpy as np

from planner.recording.screening import SILENCE

# ln of sizes by which repeats differ: hands and force levels by some 30 % at most. Chosen.
OTHER_SIZE = np.log(2.0)
# ln of what FRFs grow by where a file is in another unit than its repeats, and how near that is.
UNITS = {-np.log(9.80665): "g instead of m/s²", np.log(4.44822): "lbf instead of N"}
NEAR_UNIT = 0.1


def other_sizes(frfs: np.ndarray, upright: np.ndarray) -> np.ndarray:
    """ln of how much larger FRFs (n, N) are than half of all or more; 0 where no half differs.

    They differ both as they are and `upright` (n, N), without what tilts of the hits explain.
    """
    size, straight = (
        np.log(np.maximum(np.linalg.norm(f, axis=1), SILENCE)) for f in (frfs, upright)
    )
    other = np.minimum(_apart(size), _apart(straight)) > OTHER_SIZE
    odd = 2 * other.sum(axis=1) >= len(frfs)
    return np.array([
        size[i] - np.median(size[other[i]]) if odd[i] else 0.0 for i in range(len(frfs))
    ])  # fmt: skip


def _apart(size: np.ndarray) -> np.ndarray:
    """By how much each two (n, n) of (n,) differ."""
    return np.abs(size[:, None] - size)


def outvoted(sizes: np.ndarray) -> bool:
    """Whether most of three hits and more are of the usual size, so that the others are wrong."""
    return bool(len(sizes) > 2 and 2 * np.count_nonzero(sizes) < len(sizes))


def other_size(size: float, others: str) -> str:
    """What is said of a hit that is larger than `others`, by the ln of how much, and which unit."""
    own = [unit for grown, unit in UNITS.items() if abs(size - grown) < NEAR_UNIT]
    theirs = [f"those in {unit}" for grown, unit in UNITS.items() if abs(size + grown) < NEAR_UNIT]
    unit, way = "".join(own or theirs), "larger" if size > 0 else "smaller"
    unit = unit or "another unit or sensitivity"
    return f"is {np.exp(abs(size)):.2g} times {way} than {others}: {unit}?"
