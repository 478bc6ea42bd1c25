"""The hit that best tells apart what a diagnosis leaves tied."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from planner.design.discrimination import DiscriminatingHit, best_hit
from planner.design.law_discrimination import best_forces, undecided
from planner.diagnosis.diagnose import Explained
from planner.diagnosis.laws.law_at_joints import Laws
from planner.recording.joints import JointUnits
from planner.words import probable

MOST_ODDS = 1e4  # what is said of a robot is never surer


@dataclass(frozen=True)
class NextHit:
    """Pose, axis ("x", "y", "z") and peak forces in N; `log_odds` of what it would tell.

    `between` are the explanations, in words, that it tells apart; joint angles are in degrees.
    """

    pose: str
    joints_deg: tuple[float, ...]
    hit: str
    force_n: tuple[float, ...]
    log_odds: float
    between: tuple[str, ...]
    joint_units: tuple[str, ...] | msgspec.UnsetType = msgspec.UNSET

    @property
    def sentence(self) -> str:
        """For the engineer."""
        names = [""] * len(self.joints_deg)
        angles = JointUnits.declared_as(names, self.joint_units).listed(self.joints_deg)
        force = " and ".join(f"{n:g}" for n in self.force_n)
        force = f" with about {force} N" if force else ""
        return (
            f"To tell apart {' from '.join(self.between)}: hit{force} along {self.hit} at "
            f"{self.pose} ({angles}); this hit should separate them {as_ratio(self.log_odds)}."
        )


def next_hit(explained: Explained, offered: Mapping[str, np.ndarray]) -> NextHit | None:
    """The best hit at one of the `offered` poses, by name: joint angles (dof,) in rad.

    None if nothing is tied or no pose is offered.
    """
    recorded = explained.recorded
    if not offered:
        return None
    for finding, _ in explained.whole.established:
        laws = finding.laws and undecided(finding.laws)
        if laws and len(laws.candidates) > 1:
            return _of_laws(finding.at, laws, recorded.level_n, offered)
    found = explained.judged.diagnosis
    tied = [(c.fit, c.probability) for c in found.undecided if c.fit is not None]
    if len(tied) < 2:
        return None
    fits, shares = [f for f, _ in tied], [p for _, p in tied]
    best = best_hit(found.problem, fits, shares, _angles(offered), found.temper)
    # Linear candidates answer in proportion: the harder, the less noise.
    hardest = [float(recorded.level_n[-1])] if recorded.visits else []
    names = [in_words(c.places, c.probability) for c in found.undecided if c.fit is not None]
    return _at(best, hardest, offered, names, found.problem.simulation.robot.joints)


def _of_laws(
    at: str | None,
    laws: Laws,
    level_n: np.ndarray,
    offered: Mapping[str, np.ndarray],
) -> NextHit:
    best = best_forces(laws, float(level_n[0]), float(level_n[-1]), _angles(offered))
    both = zip(laws.candidates, laws.probability, strict=True)
    names = [in_words([(c.law.effect, at)], p) for c, p in both]
    joints = laws.problem.simulation.robot.joints
    return _at(best.hit, list(best.force_n), offered, names, joints)


def _angles(offered: Mapping[str, np.ndarray]) -> np.ndarray:
    return np.array(list(offered.values()))


def _at(
    best: DiscriminatingHit,
    force_n: list[float],
    offered: Mapping[str, np.ndarray],
    between: list[str],
    joints: JointUnits,
) -> NextHit:
    name, q = list(offered.items())[best.pose]
    return NextHit(
        pose=name,
        joints_deg=tuple(round(float(v), 3) for v in joints.shown(q)),
        hit="xyz"[best.axis],
        force_n=tuple(_at_most(force) for force in force_n),
        log_odds=best.log_odds,
        between=tuple(between),
        joint_units=joints.declared,
    )


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
    return f"{' and '.join(said)} ({probable(probability)})"


def as_ratio(log_odds: float) -> str:
    """Natural logarithm of odds as "30 : 1", as an engineer reads them."""
    if log_odds > np.log(MOST_ODDS):
        return f"more than {MOST_ODDS:g} : 1"
    return f"about {float(f'{np.exp(max(log_odds, 0.0)):.2g}'):g} : 1"
