"""The point where one more sensor would best tell apart what a diagnosis leaves tied."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from planner.design.discrimination import Tied, separation
from planner.design.next_hit import as_ratio, evenly, in_words
from planner.diagnosis.diagnose import Diagnosis
from planner.recording.joints import JointUnits
from planner.recording.points import SENSOR, TCP

MOST_POSES = 12  # at which the points are compared, evenly taken from those there are
# A sensor is only worth being moved where it tells so much more than the same hit without it;
# chosen: odds of 20.
WORTH = float(np.log(20.0))


@dataclass(frozen=True)
class ExtraSensor:
    """A `point` of robot.toml, and the hit at the tcp that a sensor there should listen to.

    `log_odds` is what that hit would tell, `log_odds_without` the best hit without the sensor;
    `between` are the explanations, in words. Joint angles are in degrees.
    """

    point: str
    pose: str
    joints_deg: tuple[float, ...]
    hit: str
    log_odds: float
    log_odds_without: float
    between: tuple[str, ...]
    joint_units: tuple[str, ...] | msgspec.UnsetType = msgspec.UNSET

    @property
    def sentence(self) -> str:
        """For the engineer."""
        names = [""] * len(self.joints_deg)
        angles = JointUnits.declared_as(names, self.joint_units).listed(self.joints_deg)
        return (
            f"A sensor at {self.point} would tell {' from '.join(self.between)}: hit along "
            f"{self.hit} at {self.pose} ({angles}); this should separate them "
            f"{as_ratio(self.log_odds)}, without the sensor {as_ratio(self.log_odds_without)}."
        )


def extra_sensor(
    found: Diagnosis, tied: Sequence[Tied], offered: Mapping[str, np.ndarray]
) -> ExtraSensor | None:
    """At which point of robot.toml that no sensor was at one would part most.

    Hits are at the poses that were measured or are `offered`, by name: joint angles (dof,) in rad.
    None where nothing is tied, no such point is stated, or none tells much more than the sensors
    that there were.
    """
    recorded, robot = found.recorded, found.search.prior.repertoire.stiff.robot
    there = found.best.misfit.data.measured.layout.sensors
    places = {robot.points.sensor(name) for name in robot.points.axes} - {*there, SENSOR, TCP}
    if len(tied) < 2 or not places:
        return None
    measured = dict(zip(recorded.poses, recorded.q, strict=True))
    names, q = evenly({**measured, **offered}, MOST_POSES)
    without = float(separation(tied, q).max())
    each = {place: separation(tied, q, (place,)) for place in sorted(places)}
    best = max(each, key=lambda place: each[place].max())
    most = float(each[best].max())
    if most < without + WORTH:
        return None
    pose, axis = np.unravel_index(np.argmax(each[best]), each[best].shape)
    return ExtraSensor(
        best,
        names[pose],
        tuple(round(float(v), 3) for v in robot.joints.shown(q[pose])),
        "xyz"[axis],
        most,
        without,
        tuple(in_words(t.places, t.probability) for t in tied),
        robot.joints.declared,
    )
