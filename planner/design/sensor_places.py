"""Where another sensor, or another point to hit, would tell most of the simulation, per minute."""

from dataclasses import dataclass

import numpy as np

from planner.design.cost import Cost
from planner.design.frequency_posterior import ALL_AXES, FrequencyOutputs, Poses
from planner.design.parameter_information import parameter_reduction
from planner.design.parameter_sensitivity import OpenParameters
from planner.recording.points import SENSOR, TCP, Layout

TINY = 1e-12  # share of the variance that is always left


@dataclass(frozen=True)
class BetterPlaces:
    """A point to hit at a pose, and the `sensors` that should listen, by names of robot.toml.

    `sd_percent` is what open parameters are expected to leave of the workspace's frequencies (root
    mean square) then, `sd_percent_as_it_is` with the hits at the tool and the sensors there are;
    `minutes` what either takes. `added` is the sensor that is put there first, "" if none is.
    """

    pose: str
    hit_point: str
    sensors: tuple[str, ...]
    added: str
    minutes: float
    minutes_as_it_is: float
    sd_percent: float
    sd_percent_as_it_is: float
    sd_percent_now: float

    @property
    def sentence(self) -> str:
        """For the engineer."""
        what = [f"put a sensor at {self.added} too"] if self.added else []
        what += [f"hit at {self.hit_point}"] if self.hit_point != TCP else []
        return (
            f"At {self.pose} {' and '.join(what)}, where that can be done: what the simulation's "
            f"parameters leave open of the frequencies is expected to go from "
            f"{self.sd_percent_now:.2g} to {self.sd_percent:.2g} % in {self.minutes:.0f} min; with "
            f"hits at the tool and the sensors of the last pose to {self.sd_percent_as_it_is:.2g} "
            f"% in {self.minutes_as_it_is:.0f} min."
        )


def better_places(
    open_: OpenParameters,
    outputs: FrequencyOutputs,
    pose: tuple[str, Poses, np.ndarray],
    cost: Cost,
    travel: float,
    target_percent: float,
) -> BetterPlaces | None:
    """The hits with one sensor more, or at another point, that gain most per minute.

    The gain is that of the logarithm of what is left: so it adds up from pose to pose. A sensor
    stays, yet its minutes are all charged here. None where hits at the tool with the sensors there
    were gain as much, or reach the target.

    Args:
        open_: the simulation's parameters, and the sensors that listened last.
        outputs: posterior of the frequencies over the workspace.
        pose: its name, itself (n = 1) and its joint angles (dof,) in rad.
        cost: minutes of a hit, and of putting up a sensor.
        travel: minutes to get there.
        target_percent: the campaign's, of the frequencies' RMSE.
    """
    name, at, q = pose
    named, there = open_.simulation.robot.points, open_.noise.sensors
    free = [None, *sorted({named.sensor(one) for one in named.axes} - {*there, SENSOR})]
    hits = [TCP, *sorted({named.hit(one) for one in named.axes} - {TCP})]
    workspace = outputs.workspace
    open_now = outputs.parameter_variance(workspace.poses)
    now = float(np.sum(workspace.importance * open_now))

    def left(hit: str, added: str | None) -> tuple[float, float]:
        """Variance that is left, and the minutes that it takes."""
        sensors = (*there, added) if added else there
        told = open_.information(q[None], Layout((hit,), sensors))
        seen = Poses(at.x, at.low, at.slope, told)
        minutes = travel + cost.per_pose + cost.hitting(ALL_AXES)
        gain = float(parameter_reduction(outputs, seen, workspace)[0])
        return max(now - gain, TINY * now), minutes + (cost.per_sensor if added else 0.0)

    plain = TCP, None
    if 100 * np.sqrt(left(*plain)[0]) <= target_percent:
        return None
    each = {(hit, added): left(hit, added) for hit in hits for added in free}
    rate = {key: np.log(now / rest) / minutes for key, (rest, minutes) in each.items()}
    best = max(rate, key=rate.__getitem__)
    if best == plain:
        return None
    percent = {key: 100 * float(np.sqrt(rest)) for key, (rest, _) in each.items()}
    return BetterPlaces(
        name,
        best[0],
        (*there, best[1]) if best[1] else there,
        best[1] or "",
        each[best][1],
        each[plain][1],
        percent[best],
        percent[plain],
        100 * float(np.sqrt(now)),
    )
