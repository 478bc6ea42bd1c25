"""Where another sensor, or hits at another point too, tell most of the simulation per minute.

I-optimal in the linearised model (Chaloner & Verdinelli 1995), as `parameter_variance` is.
"""

from dataclasses import dataclass

import numpy as np

from planner.design.cost import Cost
from planner.design.frequency_posterior import ALL_AXES, FrequencyOutputs, Poses
from planner.design.parameter_sensitivity import OpenParameters
from planner.design.reductions import parameter_reduction
from planner.recording.points import SENSOR, TCP, Layout

TINY = 1e-12  # share of the variance that is always left


@dataclass(frozen=True)
class BetterPlaces:
    """A point to hit at a pose besides the tool, and the `sensors` that should listen, by name.

    "" is no such point, and `added` the sensor that is put there first, "" if none is. `sd_percent`
    is what open parameters are expected to leave of the workspace's frequencies (root mean square)
    then, `sd_percent_as_it_is` with hits at the tool alone and the sensors there are; `minutes`
    what either takes.
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
        what += [f"hit at {self.hit_point} too"] if self.hit_point else []
        return (
            f"At {self.pose} {' and '.join(what)}, if you can: the frequencies' sd should fall "
            f"from {self.sd_percent_now:.2g} to {self.sd_percent:.2g} % in {self.minutes:.1f} min. "
            f"Without that: to {self.sd_percent_as_it_is:.2g} % in {self.minutes_as_it_is:.1f} min."
        )


def better_places(
    open_: OpenParameters,
    outputs: FrequencyOutputs,
    pose: tuple[str, Poses, np.ndarray],
    cost: Cost,
    travel: float,
    target_percent: float,
) -> BetterPlaces | None:
    """One sensor more, or hits at another point too, that gain most per minute.

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
    free = ["", *sorted({named.sensor(one) for one in named.axes} - {*there, SENSOR})]
    points = ["", *sorted({named.hit(one) for one in named.axes} - {TCP})]
    workspace = outputs.workspace
    open_now = outputs.parameter_variance(workspace.poses)
    now = float(np.sum(workspace.importance * open_now))

    def left(point: str, added: str) -> tuple[float, float]:
        """Variance that is left, and the minutes that it takes."""
        sensors = (*there, added) if added else there
        hits = (TCP, point) if point else (TCP,)
        told = sum(open_.information(q[None], Layout((hit,), sensors)) for hit in hits)
        seen = Poses(at.x, at.low, at.slope, np.asarray(told))
        gain = float(parameter_reduction(outputs, seen, workspace)[0])
        minutes = travel + cost.per_pose + len(hits) * cost.hitting(ALL_AXES)
        return max(now - gain, TINY * now), minutes + (cost.per_sensor if added else 0.0)

    plain = "", ""
    each = {plain: left(*plain)}
    if 100 * np.sqrt(each[plain][0]) <= target_percent:
        return None
    others = [(point, added) for point in points for added in free if point or added]
    each |= {place: left(*place) for place in others}
    rate = {key: np.log(now / rest) / minutes for key, (rest, minutes) in each.items()}
    best = max(rate, key=rate.__getitem__)
    if best == plain:
        return None
    percent = {key: 100 * float(np.sqrt(rest)) for key, (rest, _) in each.items()}
    return BetterPlaces(
        name,
        best[0],
        (*there, best[1]) if best[1] else there,
        best[1],
        each[best][1],
        each[plain][1],
        percent[best],
        percent[plain],
        100 * float(np.sqrt(now)),
    )
