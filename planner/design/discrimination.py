"""Which hit, or sensor, best discriminates between explanations that recordings leave tied.

T-optimal design (Atkinson & Fedorov 1975): for each pair of fits, the χ² misfit that remains when
one is refitted, by one linear step, to the FRFs that the other predicts, its present posterior
being the prior. (Hunter & Reiner 1965 compare without refitting, which counts differences that
refitting removes.)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from typing import Any, Self

import msgspec
import numpy as np
from scipy.linalg import block_diag

from planner.diagnosis.diagnose import Diagnosis
from planner.diagnosis.verdict import Place
from planner.fit.explanations import Key, key_of, probabilities
from planner.fit.fitted import StructureFit
from planner.fit.misfit import FrfMisfit
from planner.fit.posterior import RobotPosterior
from planner.fit.weights import Weights
from planner.measurement.nuisances import OF_HAMMER
from planner.recording.joints import JointUnits
from planner.recording.points import SENSOR, TCP, Layout
from planner.words import probable

LIKELY = 0.05  # probability from which an explanation counts as tied with the likeliest
MOST_TIED = 4  # compared: the likeliest
LINES = 48  # over the band at which FRFs are compared, evenly spaced
AXES = 3
MOST_POSES, SENSOR_POSES = 40, 12  # at which hits, and sensors, are compared, evenly taken
# A sensor is only worth being moved where it tells so much more than the same hit without it;
# chosen: odds of 20.
WORTH = float(np.log(20.0))
MOST_ODDS = 1e4  # what is said of a robot is never surer


@dataclass(frozen=True, eq=False)
class TiedExplanations:
    """A fit, and effects of it that matter; probabilities of those that are tied sum to 1."""

    places: tuple[Place, ...]
    probability: float
    fit: StructureFit


def tied(found: Diagnosis) -> tuple[TiedExplanations, ...]:
    """Explanations that recordings leave tied, likeliest first; one where nothing is tied.

    Those that differ only by what is too small to matter are one.
    """
    idle = {e.place for e in found.verdict.effects if not e.counts}
    weight = probabilities(found.explored.settled)
    groups: dict[Key, list[StructureFit]] = {}
    for fit in sorted(found.explored.settled, key=lambda f: -weight[key_of(f)]):
        key = tuple(place for place in key_of(fit) if place not in idle)
        groups.setdefault(key, []).append(fit)
    shares = {key: sum(weight[key_of(f)] for f in fits) for key, fits in groups.items()}
    kept = sorted((k for k in groups if shares[k] > LIKELY), key=lambda k: -shares[k])[:MOST_TIED]
    whole = sum(shares[key] for key in kept)
    return tuple(
        TiedExplanations(key or (("none", None),), shares[key] / whole, groups[key][0])
        for key in kept
    )


def separation(
    candidates: Sequence[TiedExplanations], q: np.ndarray, more: tuple[str, ...] = ()
) -> np.ndarray:
    """Expected logarithm of the odds (n, 3) that a hit along each tcp axis gives at q (n, dof).

    q in rad; sensors at the points `more` listen beside those of the recordings. The odds are those
    of the true candidate to each other one, averaged with their probabilities; 0 where there are
    fewer than two.
    """
    gain = np.zeros((len(q), AXES))
    share = np.array([c.probability for c in candidates])
    for place, row in enumerate(np.atleast_2d(q) if len(candidates) > 1 else ()):
        seen = [_Predicted.of(RobotPosterior.of(c.fit), row, more) for c in candidates]
        for true, other in permutations(range(len(candidates)), 2):
            weight = share[true] * share[other] / (1 - share[true])
            gain[place] += weight * seen[other].left_of(seen[true]) / 2
    return np.nan_to_num(gain)


@dataclass(frozen=True, eq=False)
class _Predicted:
    """FRF (1, r, 3, F) at a pose, its columns (1, D, r, 3, F), the precision (D, D) of what moves
    it, and a misfit to it."""

    frf: np.ndarray
    columns: np.ndarray
    precision: np.ndarray
    misfit: FrfMisfit

    @classmethod
    def of(cls, posterior: RobotPosterior, q: np.ndarray, more: tuple[str, ...]) -> "_Predicted":
        """At q (dof,) in rad; what hits, readback and visits leave open moves it too."""
        found, measured = posterior.found, posterior.found.misfit.data.measured
        lines = np.linspace(measured.frequency_hz.min(), measured.frequency_hz.max(), LINES)
        layout = Layout((TCP,), (*measured.layout.sensors, *more))
        structure = replace(posterior.structure, sensors=len(layout.sensors))
        sloped = structure.prior.carried.matrices(q, layout=layout, slopes=True)
        data = replace(posterior.at(q[None], lines, layout), matrices=sloped)
        misfit = FrfMisfit(structure, data, posterior.tolerances, posterior.size)
        # Of a sensor that is new nothing is known but its tolerances.
        same = [*range(posterior.structure.size - OF_HAMMER), -2, -1]
        x, precision = structure.mean.copy(), structure.precision.copy()
        x[same] = found.at.x[same]
        precision[np.ix_(same, same)] = (found.at.normal + found.at.precision)[np.ix_(same, same)]
        own = misfit.zero_nuisances()
        frf, columns, _ = misfit.columns(x, misfit.about(own, x))
        noise = float(np.median((measured.sd / found.misfit.data.weights.size)[measured.used]))
        there = replace(data.measured, accelerance=frf)
        size = Weights(there).size
        there = replace(there, sd=noise * size)
        misfit = replace(misfit, data=replace(data, measured=there))
        both = block_diag(precision, np.eye(own.shape[1]))
        return cls(frf, columns[:, :-1], both, misfit)

    def left_of(self, true: "_Predicted") -> np.ndarray:
        """χ² (3,), of a hit along each axis, that refitting to what `true` predicts leaves."""
        missed = (true.frf - self.frf)[:, None]
        given = np.concatenate([missed, self.columns], axis=1)
        white = true.misfit.whitened(given).reshape(given.shape[1], 2, -1, AXES, given.shape[-1])
        found = []
        for axis in range(AXES):
            r, *j = white[:, :, :, axis].reshape(len(white), -1)
            columns = np.array(j)
            pull = columns @ r
            inner = self.precision + columns @ columns.T
            found.append(float(r @ r - pull @ np.linalg.solve(inner, pull)))
        return np.array(found)


@dataclass(frozen=True, kw_only=True)
class DiscriminatingHit:
    """A hit at a pose along an axis ("x", "y", "z"); `log_odds` of what it would tell.

    `between` are the explanations, in words, that it tells apart; joint angles are in degrees.
    """

    pose: str
    joints_deg: tuple[float, ...]
    hit: str
    log_odds: float
    between: tuple[str, ...]
    joint_units: tuple[str, ...] | msgspec.UnsetType = msgspec.UNSET

    @classmethod
    def best(
        cls,
        tied: Sequence[TiedExplanations],
        joints: JointUnits,
        poses: tuple[list[str], np.ndarray],
        gain: np.ndarray,
        **more: Any,
    ) -> Self:
        """The hit of the largest `gain` (n, 3) at one of n poses, by name and in rad (n, dof)."""
        names, q = poses
        place, axis = np.unravel_index(np.argmax(gain), gain.shape)
        return cls(
            pose=names[place],
            joints_deg=tuple(round(float(v), 3) for v in joints.shown(q[place])),
            hit="xyz"[axis],
            log_odds=float(gain[place, axis]),
            between=tuple(in_words(t.places, t.probability) for t in tied),
            joint_units=joints.declared,
            **more,
        )

    @property
    def where(self) -> str:
        """Axis, the pose's angles and its name."""
        names = [""] * len(self.joints_deg)
        angles = JointUnits.declared_as(names, self.joint_units).listed(self.joints_deg)
        return f"along {self.hit} with the joints at {angles} ({self.pose})"


@dataclass(frozen=True, kw_only=True)
class NextHit(DiscriminatingHit):
    """The hit that best tells apart what a diagnosis leaves tied, and its peak forces in N."""

    force_n: tuple[float, ...]

    @property
    def sentence(self) -> str:
        """For the engineer."""
        force = " and ".join(f"{n:g}" for n in self.force_n)
        force = f" with about {force} N" if force else ""
        return (
            f"To tell apart {' from '.join(self.between)}: hit{force} {self.where}; this hit "
            f"should separate them {as_ratio(self.log_odds)}."
        )


@dataclass(frozen=True, kw_only=True)
class ExtraSensor(DiscriminatingHit):
    """A `point` of robot.toml, and the hit at the tcp that a sensor there should listen to.

    `log_odds_without` is what the best hit without the sensor would tell.
    """

    point: str
    log_odds_without: float

    @property
    def sentence(self) -> str:
        """For the engineer."""
        return (
            f"A sensor at {self.point} would tell {' from '.join(self.between)}: hit {self.where}; "
            f"this should separate them {as_ratio(self.log_odds)}, without the sensor "
            f"{as_ratio(self.log_odds_without)}."
        )


def next_hit(
    found: Diagnosis, tied: Sequence[TiedExplanations], offered: Mapping[str, np.ndarray]
) -> NextHit | None:
    """The best hit at one of the `offered` poses, by name: joint angles (dof,) in rad.

    None if nothing is tied or no pose is offered.
    """
    if not offered or len(tied) < 2:
        return None
    poses = _evenly(offered, MOST_POSES)
    force_n: tuple[float, ...] = ()
    if found.recorded.visits:
        # All explanations answer in proportion: the harder, the less noise. In two digits, rounded
        # down: nobody is asked to hit harder than before.
        hardest = float(found.recorded.level_n[-1])
        unit = 10.0 ** (np.floor(np.log10(hardest)) - 1)
        force_n = (float(np.floor(hardest / unit) * unit),)
    joints = found.search.prior.effect_library.stiff.robot.joints
    return NextHit.best(tied, joints, poses, separation(tied, poses[1]), force_n=force_n)


def extra_sensor(
    found: Diagnosis, tied: Sequence[TiedExplanations], offered: Mapping[str, np.ndarray]
) -> ExtraSensor | None:
    """At which point of robot.toml that no sensor was at one would part most.

    Hits are at the poses that were measured or are `offered`, by name: joint angles (dof,) in rad.
    None where nothing is tied, no such point is stated, or none tells much more than the sensors
    that there were.
    """
    recorded, robot = found.recorded, found.search.prior.effect_library.stiff.robot
    there = found.best.misfit.data.measured.layout.sensors
    places = {robot.points.sensor(name) for name in robot.points.axes} - {*there, SENSOR, TCP}
    if len(tied) < 2 or not places:
        return None
    measured = dict(zip(recorded.poses, recorded.q, strict=True))
    poses = _evenly({**measured, **offered}, SENSOR_POSES)
    without = float(separation(tied, poses[1]).max())
    each = {place: separation(tied, poses[1], (place,)) for place in sorted(places)}
    point = max(each, key=lambda place: each[place].max())
    if float(each[point].max()) < without + WORTH:
        return None
    told = {"point": point, "log_odds_without": without}
    return ExtraSensor.best(tied, robot.joints, poses, each[point], **told)


def _evenly(poses: Mapping[str, np.ndarray], most: int) -> tuple[list[str], np.ndarray]:
    """At most so many of named poses, evenly taken: names (n,), joint angles (n, dof) in rad."""
    names = list(poses)
    kept = np.unique(np.linspace(0, len(names) - 1, most).round().astype(int))
    return [names[i] for i in kept], np.array([poses[names[i]] for i in kept])


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
