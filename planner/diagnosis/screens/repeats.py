"""Do force levels differ by more than hits of one level do among themselves?

Hits of a linear structure are exchangeable: which level they belong to says nothing of how they
are answered (see `inference.exchangeable`). Nothing is assumed of how large the misses are, nor of
the simulation, which only weighs.
"""

from collections.abc import Sequence
from math import factorial

import numpy as np

from planner.dataset.dataset import Dataset
from planner.dataset.level_columns import Column
from planner.diagnosis.laws.open_misses import (
    MissesAtVisit,
    OpenMisses,
    hit_columns,
    real_rows,
    whitening,
)
from planner.diagnosis.thresholds import BY_CHANCE, SHARED_OUT
from planner.inference import exchangeable
from planner.recording.records import Hit

AXES = "xyz"


def chance(recorded: Dataset, misses: OpenMisses) -> float | None:
    """The chance that levels of a linear structure differ so much; None where it can't be told.

    Told by repeats, and by what changes the more the harder the hits are, whichever tells more.
    None is where so few hits were repeated, or so few groups of hits have three levels, that even
    chance could make any difference.
    """
    told = [
        c for c in (_by_repeats(recorded, misses), _by_order(recorded, misses)) if c is not None
    ]
    return min(1.0, len(told) * min(told)) if told else None


Group = tuple[np.ndarray, np.ndarray]  # hits (n, m) in units of one noise, their levels (n,)


def _by_repeats(recorded: Dataset, misses: OpenMisses) -> float | None:
    """Hits shared out among the levels at random."""
    rng = np.random.default_rng(0)
    ways, measured, shared = 1.0, 0.0, np.zeros(SHARED_OUT)
    for seen, levels in _groups(recorded, misses, rng):
        if not 1 < len(np.unique(levels)) < len(levels):
            continue
        ways *= exchangeable.ways(levels)
        real, random = exchangeable.between(seen, levels, SHARED_OUT, rng)
        measured, shared = measured + real, shared + random
    if 1 / ways > BY_CHANCE:
        return None
    return exchangeable.chance(measured, shared)


def _by_order(recorded: Dataset, misses: OpenMisses) -> float | None:
    """Levels of each pose and axis in any order: all hits of a level may have missed alike."""
    rng = np.random.default_rng(0)
    ways, measured, shared = 1.0, 0.0, np.zeros(SHARED_OUT)
    for seen, levels in _groups(recorded, misses, rng):
        count = len(np.unique(levels))
        if count < 3:
            continue
        ways *= factorial(count) / 2  # there and back is one course
        means = np.array([seen[levels == level].mean(axis=0) for level in np.unique(levels)])
        real, random = exchangeable.ordered(means, SHARED_OUT, rng)
        measured, shared = measured + real, shared + random
    if 1 / ways > BY_CHANCE:
        return None
    return exchangeable.chance(measured, shared)


def _groups(recorded: Dataset, misses: OpenMisses, rng: np.random.Generator) -> list[Group]:
    """Hits of each visit along each axis that was hit at several levels."""
    out: list[Group] = []
    for number, hits in enumerate(hit_columns(recorded)):
        missed = misses.of_hits(number, hits)
        for axis in range(3):
            group = [hit for hit in hits if hit.axis == axis]
            if len({hit.level for hit in group}) > 1:
                out.append((_seen(group, missed, rng), _levels(group)))
    return evenly_scattered(out, rng)


def evenly_scattered(groups: Sequence[Group], rng: np.random.Generator) -> list[Group]:
    """Groups in which hits of every level scatter as much as those of the level that does most.

    Records may be noisier than is known of them: soft hits, of which the force is noisy too,
    differ more among themselves than hard ones. Levels without repeats scatter as the others do.
    """
    squares: dict[int, list[tuple[float, int]]] = {}
    for seen, levels in groups:
        for level in np.unique(levels).tolist():
            own = seen[levels == level]
            off = float(np.sum((own - own.mean(axis=0)) ** 2))
            squares.setdefault(level, []).append((off, (len(own) - 1) * own.shape[1]))
    sums = {level: np.sum(each, axis=0) for level, each in squares.items()}
    scatter = {level: off / count for level, (off, count) in sums.items() if count}
    most = max(scatter.values(), default=0.0)
    out: list[Group] = []
    for seen, levels in groups:
        lacking = np.array([most - scatter.get(level, most) for level in levels.tolist()])
        more = np.sqrt(lacking)[:, None] * rng.standard_normal(seen.shape)
        out.append((seen + more, levels))
    return out


def wanted(recorded: Dataset) -> str:
    """What to do where levels differ and repeats are missing: a sentence."""
    few = [
        f"pose {v.pose} along {''.join(axes)}"
        for v in recorded.visits
        if (axes := _once(v.hits, recorded))
    ]
    return (
        "FRFs of different force levels differ by more than noise. Either the structure is not "
        "linear, or hits missed the point or the axis; only repeats show which. Hit "
        f"twice at each level at {'; '.join(few[:3])}{' …' if len(few) > 3 else ''}."
    )


def _once(hits: Sequence[Hit], recorded: Dataset) -> list[str]:
    """Axes that were hit at several levels, at one of them once only."""
    out = []
    for axis in range(3):
        levels = [recorded.level(hit) for hit in hits if hit.axis_index == axis]
        counts = np.bincount(levels) if levels else np.zeros(0)
        if np.count_nonzero(counts) > 1 and np.any(counts == 1):
            out.append(AXES[axis])
    return out


def _seen(group: Sequence[Column], missed: MissesAtVisit, rng: np.random.Generator) -> np.ndarray:
    """Hits (n, m) as real rows in units of one noise for all, with misses left open.

    There is one weight for all: hits are to be exchangeable.
    """
    lines = missed.lines
    basis, uncertain = missed.left_open(group[:2])
    h = np.array([hit.accelerance[:, lines] for hit in group])
    values, variance = evenly_noisy(h, np.array([c.variance[:, lines] for c in group]), rng)
    variance = 2 * variance + uncertain
    weight = np.where(np.isfinite(variance), 1 / variance, 0.0)
    values = values * np.sqrt(weight)
    return whitening(basis, weight)(real_rows(values - values.mean(axis=0)))


def evenly_noisy(
    h: np.ndarray, variance: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """FRFs h (n, ...) with as much noise as the noisiest has, and that variance (...).

    Soft hits are noisier than hard ones. One of them beside two hard ones is a level that differs
    from the other for no reason but its noise.
    """
    most = variance.max(axis=0)
    lacking = np.where(np.isfinite(most), most - np.where(np.isfinite(most), variance, 0.0), 0.0)
    real, imaginary = rng.standard_normal((2, *h.shape))
    return h + np.sqrt(lacking / 2) * (real + 1j * imaginary), most


def _levels(group: Sequence[Column]) -> np.ndarray:
    return np.array([hit.level for hit in group])
