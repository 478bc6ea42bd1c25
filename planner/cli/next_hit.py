"""The hit that best tells apart what the recordings leave tied, for `planner diagnose`."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from planner.acquire.separate import Telling, most_telling
from planner.acquire.separate_laws import forces_n, law_separation
from planner.cli.material import Material
from planner.diagnose.diagnose import TIED
from planner.diagnose.explain import Explained
from planner.diagnose.finding import Finding
from planner.diagnose.visits import Recorded as Visits

OF_LAWS = 60  # poses that are looked at for nonlinear joints: each takes tens of milliseconds


def next_hit(explained: Explained, visits: Visits | None, given: Material) -> dict[str, Any] | None:
    """Pose, axis and peak forces; None if nothing is tied or no pose is offered."""
    if not len(given.offered):
        return None
    for finding, _ in explained.whole.established:
        if finding.laws is not None and sum(p > TIED for p in finding.laws.probability) > 1:
            assert visits is not None
            return _of_laws(finding, visits.level_n, given)
    found = explained.judged.diagnosis
    tied = [(c.fit, c.probability) for c in found.undecided if c.fit is not None]
    if len(tied) < 2:
        return None
    fits, shares = [f for f, _ in tied], [p for _, p in tied]
    best = most_telling(found.problem, fits, shares, given.offered, found.temper)
    # Linear candidates answer in proportion: the harder, the less noise.
    hardest = [float(visits.level_n[-1])] if visits is not None else []
    names = [in_words(c.places, c.probability) for c in found.undecided if c.fit is not None]
    return _proposal(best, hardest, given, names)


def _of_laws(finding: Finding, level_n: np.ndarray, given: Material) -> dict[str, Any]:
    assert finding.laws is not None
    both = zip(finding.laws.candidates, finding.laws.probability, strict=True)
    tied = [(c, p) for c, p in both if p > TIED]
    laws = replace(
        finding.laws, candidates=tuple(c for c, _ in tied), probability=tuple(p for _, p in tied)
    )
    force = forces_n(float(level_n[0]), float(level_n[-1]))
    n = len(given.offered)
    looked_at = np.unique(np.linspace(0, n - 1, OF_LAWS).round().astype(int))
    gain = np.nan_to_num(law_separation(laws, given.offered[looked_at], force))
    row, axis, level = (int(i) for i in np.unravel_index(int(np.argmax(gain)), gain.shape))
    best = Telling(int(looked_at[row]), axis, float(gain[row, axis, level]))
    names = [in_words([(c.law.effect, finding.at)], p) for c, p in tied]
    return _proposal(best, [float(force[level]), float(force[-1])], given, names)


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
