"""Whether what was measured at a point is that point's, where only the physics can tell.

FRFs of a sensor that the simulation describes far better at another point of robot.toml were
probably felt there; likewise hits.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.dynamics.gradient import response
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.measurement.measured_frfs import Measured, stack
from planner.recording.points import SENSOR, TCP, Layout

MOST_LINES = 200  # of a pose, that are compared
# FRFs fit another point far better where they then differ from the simulation by less than this
# share of what they do as named; and by less than CLOSE of themselves, for a simulation that
# describes neither tells nothing. Chosen: points of one link differ by less than FAR_BETTER.
FAR_BETTER, CLOSE = 0.5, 0.6


# Of points, of those that they fit and of whether they were hit: the poses where it is so, and
# relative differences to the simulation, as named and there.
Misplaced = dict[tuple[str, str, bool], list[tuple[str, float, float]]]


def misplaced(
    simulations: Sequence[Simulation],
    q: np.ndarray,
    frfs: Sequence[Frf],
    band: tuple[float, float],
    poses: Sequence[str],
) -> tuple[str, ...]:
    """A sentence for each point whose FRFs, measured at q (n, dof) of `poses`, fit another's far
    better. By that simulation which describes all points best, named as they fit it.
    """
    measured = stack(frfs, band, MOST_LINES, 0.0)
    points = [p.name for p in simulations[0].robot.config.point]
    names = simulations[0].robot.points
    hits = tuple(dict.fromkeys((TCP, *measured.layout.hits, *map(names.hit, points))))
    sensors = tuple(dict.fromkeys((SENSOR, *measured.layout.sensors, *map(names.sensor, points))))
    if len(points) < 2:
        return ()
    wide, own = Layout(hits, sensors), measured.layout
    tried = [_differences(simulation, q, measured, wide) for simulation in simulations]
    # How far all sensors are off, each at the point which fits it best.
    by_sensor, by_hit = min(tried, key=lambda sides: np.nansum(np.min(sides[0], axis=-1)))
    found: Misplaced = {}
    for differences, named, points_there, tool, hit in (
        (by_sensor, own.sensors, sensors, SENSOR, False),
        (by_hit, own.hits, hits, TCP, True),
    ):
        for i, k in np.argwhere(np.isfinite(differences[..., 0])):
            each = differences[i, k]
            stated, best = float(each[points_there.index(named[k])]), int(np.argmin(each))
            # The tool's own are as they are.
            if named[k] != tool and each[best] < min(FAR_BETTER * stated, CLOSE):
                case = poses[i], stated, float(each[best])
                found.setdefault((named[k], points_there[best], hit), []).append(case)
    return _questions(found)


def _differences(
    simulation: Simulation, q: np.ndarray, measured: Measured, wide: Layout
) -> tuple[np.ndarray, np.ndarray]:
    """Relative differences (n, named points, all points) of FRFs to a simulation, NaN: no FRF.

    Of all sensors as if at each point of `wide`, and of all hits.
    """
    own = measured.layout
    loaded = measured.loaded(simulation.elastic.matrices(q, layout=own), simulation.robot)
    matrices = replace(simulation.elastic.matrices(q, layout=wide), mass=loaded.mass)
    h = response(matrices, simulation.elasticity, measured.s)
    h = h.reshape(len(q), len(wide.sensors), 3, len(wide.hits), 3, -1)
    shape = len(q), len(own.sensors), 3, len(own.hits), 3, h.shape[-1]
    used = measured.used.reshape(shape)
    given = np.where(used, measured.accelerance.reshape(shape), 0.0)
    to_sensor = [wide.sensors.index(name) for name in own.sensors]
    to_hit = [wide.hits.index(name) for name in own.hits]

    def along(side: int, simulated: np.ndarray) -> np.ndarray:
        """(n, named, all) from FRFs of all points on axis `side`, one after another."""
        axes, found = tuple(axis for axis in range(1, 6) if axis != side), []
        power = np.sum(np.abs(given) ** 2, axis=axes)
        for point in range(simulated.shape[side]):
            off = given - np.take(simulated, [point], axis=side)
            left = np.sum(np.abs(np.where(used, off, 0.0)) ** 2, axis=axes)
            share = np.divide(left, power, out=np.full(left.shape, np.nan), where=power > 0)
            found.append(np.sqrt(share))
        return np.stack(found, axis=-1)

    return along(1, h[:, :, :, to_hit]), along(3, h[:, to_sensor])


def _questions(found: Misplaced) -> tuple[str, ...]:
    sentences, done = [], set()
    for (point, fits, hit), cases in found.items():
        if (point, fits, hit) in done:
            continue
        poses, *differences = zip(*cases, strict=True)
        where = ", ".join(dict.fromkeys(poses))
        named, there = (100 * float(np.median(v)) for v in differences)
        what = "hits at" if hit else "FRFs of"
        text = (
            f"{where}: {what} {point} fit {fits} far better (there they differ from the simulation"
            f" by {there:.0f} %, at {point} by {named:.0f} %)"
        )
        if (fits, point, hit) in found:
            done.add((fits, point, hit))
            text += f", and {fits}'s fit {point}: were the two exchanged?"
        else:
            text += f": was the {'hit' if hit else 'sensor'} there, or is a node wrong?"
        sentences.append(text)
    return tuple(sentences)
