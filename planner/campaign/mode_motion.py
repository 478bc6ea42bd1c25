"""How modes move a posed robot: by the simulation everywhere, and as measured at its sensors."""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from planner.campaign.labels import LabelledPose
from planner.dataset.measure import MeasuredPose
from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import oscillatory
from planner.frf.frf import Frf
from planner.modal.mac import mac
from planner.modal.residues import lsfd, rank_one, realign
from planner.recording.points import TCP, Layout
from planner.robot.link_bodies import Skeleton, placements
from planner.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class PointShapes:
    """Shapes of modes at points: motion (k, n, 3), complex, along the world's axes.

    NaN where a mode or a direction is not known. The scale of each mode is free.
    """

    names: tuple[str, ...]
    place_m: np.ndarray  # (n, 3)
    motion: np.ndarray


def simulated_shapes(
    simulation: Simulation, q: np.ndarray, drawn: Skeleton, layout: Layout, count: int
) -> tuple[PointShapes, PointShapes]:
    """Shapes of the `count` lowest modes at the skeleton's points and at a layout's sensors.

    Both on the scale by which the point of the skeleton that moves most moves by 1.
    """
    robot, elastic = simulation.robot, simulation.elastic
    frames = [*(robot.frame_id("link", name) for name in drawn.names), *robot.layout_ids(layout)[1]]
    along = elastic.matrices(q, sensors=drawn.names)
    sensors = elastic.matrices(q, layout=layout).sensor
    every = replace(along, sensor=np.concatenate([along.sensor, sensors], axis=1))
    found = oscillatory(simulation.solved(every), count).residue[0]
    rotation, place = placements(robot, q, frames)
    motion, split = np.full((count, len(frames), 3), np.nan + 0j), len(drawn.names)
    for k, residue in enumerate(found):
        if np.all(np.isfinite(residue)):
            shape = _in_world(rotation, rank_one(residue)[0])
            shape = shape * realign(shape[:split].ravel())
            largest = np.max(np.linalg.norm(np.abs(shape[:split]), axis=-1))
            motion[k] = shape / (largest or 1.0)
    return (
        PointShapes(drawn.names, place[:split], motion[:, :split]),
        PointShapes(layout.sensors, place[split:], motion[:, split:]),
    )


def measured_shapes(robot: Robot, pose: LabelledPose, measured: MeasuredPose | None) -> PointShapes:
    """Shapes of the labelled modes at all sensors that heard hits at the tcp."""
    whole = None if measured is None else measured.whole
    sensors = Layout().sensors if whole is None else whole.layout.sensors
    rotation, place = placements(robot, pose.q, robot.layout_ids(Layout(sensors=sensors))[1])
    motion = np.full((len(pose.modes), len(sensors), 3), np.nan + 0j)
    found = [mode for mode in pose.modes if mode is not None]
    shapes = [mode.shape for mode in found]
    if measured is not None and whole is not None and len(sensors) > 1:
        # Modes without a label are fitted too: their part is none of the others'.
        labelled = [mode.frequency_hz for mode in found]
        others = measured.modal.modes if measured.modal is not None else ()
        others = [m for m in others if not np.any(np.isclose(m.frequency_hz, labelled, rtol=1e-6))]
        shapes = _shapes(whole, np.array([mode.pole for mode in (*found, *others)]))[: len(found)]
    labels = [k for k, mode in enumerate(pose.modes) if mode is not None]
    for k, shape in zip(labels, shapes, strict=True):
        motion[k] = _in_world(rotation, shape)
    return PointShapes(sensors, place, motion)


def _shapes(frf: Frf, poles: np.ndarray) -> list[np.ndarray]:
    """Shape (r,) of each pole over all rows of an FRF that hits at the tcp gave; NaN elsewhere."""
    rows = len(frf.accelerance)
    residue = np.full((rows, 3, len(poles)), np.nan + 0j)
    blocks = [3 * i for i, name in enumerate(frf.layout.hits) if name == TCP]
    for row, block, axis in itertools.product(range(rows), blocks, range(3)):
        entry = frf.accelerance[row, block + axis]
        if np.all(np.isfinite(entry)) and not np.any(np.isfinite(residue[row, axis])):
            residue[row, axis] = lsfd(
                frf.frequency_hz, entry[None, None], poles, rate_1_s=frf.exponential_rate_1_s
            )[0, 0]
    known = np.isfinite(residue[..., 0])
    columns = known.sum(axis=0) == known.sum(axis=0).max()
    heard = known[:, columns].all(axis=1)
    shapes = []
    for k in range(len(poles)):
        shape = np.full(rows, np.nan + 0j)
        shape[heard] = rank_one(residue[np.ix_(heard, columns)][..., k])[0]
        shapes.append(shape)
    return shapes


def _in_world(rotation: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """(n, 3) along the world's axes of a shape (3n,) in the frames of its points."""
    local = shape.reshape(-1, 3)
    known = np.isfinite(local)
    world = np.einsum("pij,pj->pi", rotation, np.where(known, local, 0.0))
    return np.where(np.any(known, axis=1)[:, None], world, np.nan)


def agreement(measured: PointShapes, simulated: PointShapes) -> np.ndarray:
    """MAC (k, l) of measured and simulated shapes at the same points; NaN where one is unknown."""
    a = measured.motion.reshape(len(measured.motion), -1)
    b = simulated.motion.reshape(len(simulated.motion), -1)
    out = np.full((len(a), len(b)), np.nan)
    for k, j in np.ndindex(out.shape):
        known = np.isfinite(a[k]) & np.isfinite(b[j])
        if np.any(known):
            out[k, j] = mac(a[k, known], b[j, known])
    return out


def matched(measured: PointShapes, simulated: PointShapes) -> PointShapes:
    """The measured shapes on the scale, and with the phase, of the simulated ones."""
    size = np.ones(len(measured.motion), complex)
    for k, (own, other) in enumerate(zip(measured.motion, simulated.motion, strict=True)):
        known = np.isfinite(own) & np.isfinite(other)
        power = np.sum(np.abs(own[known]) ** 2)
        if power > 0:
            size[k] = np.sum(own[known].conj() * other[known]) / power
    return replace(measured, motion=size[:, None, None] * measured.motion)


def measured_alone(measured: PointShapes) -> PointShapes:
    """The measured shapes with the point that moves most moving by 1, at the first instant."""
    motion = measured.motion.copy()
    for own in motion:
        known = own[np.isfinite(own)]
        own *= realign(known) / np.max(np.abs(known)) if known.size else 1.0
    return replace(measured, motion=motion)
