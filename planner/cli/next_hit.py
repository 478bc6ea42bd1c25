"""The hit that best tells apart what the recordings leave tied, for `planner diagnose`."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from planner.cli.material import Material
from planner.design.discrimination import Telling, most_telling
from planner.design.law_discrimination import most_telling_forces, undecided
from planner.diagnosis.diagnose import Explained
from planner.diagnosis.laws.law_at_joints import Laws


def next_hit(explained: Explained, given: Material) -> dict[str, Any] | None:
    """Pose, axis and peak forces; None if nothing is tied or no pose is offered."""
    if not len(given.offered):
        return None
    for finding, _ in explained.whole.established:
        laws = finding.laws and undecided(finding.laws)
        if laws and len(laws.candidates) > 1:
            return _of_laws(finding.at, laws, explained.recorded.level_n, given)
    found = explained.judged.diagnosis
    tied = [(c.fit, c.probability) for c in found.undecided if c.fit is not None]
    if len(tied) < 2:
        return None
    fits, shares = [f for f, _ in tied], [p for _, p in tied]
    best = most_telling(found.problem, fits, shares, given.offered, found.temper)
    # Linear candidates answer in proportion: the harder, the less noise.
    recorded = explained.recorded
    hardest = [float(recorded.level_n[-1])] if recorded.visits else []
    names = [in_words(c.places, c.probability) for c in found.undecided if c.fit is not None]
    return _proposal(best, hardest, given, names)


def _of_laws(at: str | None, laws: Laws, level_n: np.ndarray, given: Material) -> dict[str, Any]:
    best = most_telling_forces(laws, float(level_n[0]), float(level_n[-1]), given.offered)
    both = zip(laws.candidates, laws.probability, strict=True)
    names = [in_words([(c.law.effect, at)], p) for c, p in both]
    return _proposal(best.hit, list(best.force_n), given, names)


def _proposal(
    best: Telling, force_n: list[float], given: Material, between: list[str]
) -> dict[str, Any]:
    return {
        "pose": given.names[best.pose],
        "joints_deg": [round(float(v), 3) for v in np.rad2deg(given.offered[best.pose])],
        "hit": "xyz"[best.axis],
        "force_n": [_at_most(force) for force in force_n],
        "log_odds": best.log_odds,
        "between": between,
    }


def _at_most(force_n: float) -> float:
    """Two digits of it, rounded down: nobody is asked to hit harder than before."""
    unit = 10.0 ** (np.floor(np.log10(force_n)) - 1)
    return float(np.floor(force_n / unit) * unit)


def in_words(places: Sequence[tuple[str, str | None]], probability: float) -> str:
    """A candidate's effects at their places, and its probability."""
    said = [
        "no effect at all"
        if name == "none"
        else "something unknown"
        if at is None
        else f"{name.replace('_', ' ')} at {at}"
        for name, at in places
    ]
    return f"{' and '.join(said)} ({100 * probability:.0f} %)"
