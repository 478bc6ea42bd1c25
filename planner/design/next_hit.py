"""The hit that best tells apart what a diagnosis leaves tied."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from planner.design.discrimination import Tied, separation
from planner.diagnosis.diagnose import Diagnosis
from planner.recording.joints import JointUnits
from planner.words import probable

MOST_POSES = 40  # of those offered, evenly taken
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


def next_hit(
    found: Diagnosis, tied: Sequence[Tied], offered: Mapping[str, np.ndarray]
) -> NextHit | None:
    """The best hit at one of the `offered` poses, by name: joint angles (dof,) in rad.

    None if nothing is tied or no pose is offered.
    """
    if not offered or len(tied) < 2:
        return None
    names, q = evenly(offered, MOST_POSES)
    gain = separation(tied, q)
    pose, axis = map(int, np.unravel_index(np.argmax(gain), gain.shape))
    # All explanations answer in proportion: the harder, the less noise.
    hardest = [float(found.recorded.level_n[-1])] if found.recorded.visits else []
    joints = found.search.prior.repertoire.stiff.robot.joints
    return NextHit(
        pose=names[pose],
        joints_deg=tuple(round(float(v), 3) for v in joints.shown(q[pose])),
        hit="xyz"[axis],
        force_n=tuple(_at_most(force) for force in hardest),
        log_odds=float(gain[pose, axis]),
        between=tuple(in_words(t.places, t.probability) for t in tied),
        joint_units=joints.declared,
    )


def evenly(poses: Mapping[str, np.ndarray], most: int) -> tuple[list[str], np.ndarray]:
    """At most so many of named poses, evenly taken: names (n,), joint angles (n, dof) in rad."""
    names = list(poses)
    kept = np.unique(np.linspace(0, len(names) - 1, most).round().astype(int))
    return [names[i] for i in kept], np.array([poses[names[i]] for i in kept])


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
