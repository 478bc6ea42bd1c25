"""What a pose's modes would be without the sensors that sat on the robot: mass loading.

A sensor of mass m at a point that moves by φ per root of modal mass lowers f by about mφ²/2 of
itself. The simulation with and without the sensors' masses tells by how much.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.dynamics.mode_families import undamped_modes
from planner.dynamics.simulation import Simulation
from planner.inference.assignment import least_cost
from planner.measurement.measured_frfs import with_sensors
from planner.modal.mac import mac_matrix
from planner.modal.modes import Mode
from planner.recording.points import SENSOR, TCP, Layout

# A measured mode is taken for a simulated one within this share of its frequency; a difference of
# NEAR counts as much as shapes that have nothing in common.
FARTHEST, NEAR = 0.15, 0.05
DOUBT = 0.2  # of a correction: a simulation that is right about masses is wrong about shapes


@dataclass(frozen=True, eq=False)
class Unloaded:
    """Modes without the sensors' masses.

    `lowered` (k,) is by which share the sensors had lowered each frequency, NaN where the
    simulation has no such mode. `unlike` says how far simulated modes are from measured ones in
    all: 1 for each that has none.
    """

    modes: tuple[Mode, ...]
    lowered: np.ndarray
    unlike: float = 0.0


def unloaded(
    modes: Sequence[Mode], simulation: Simulation, q: np.ndarray, sensors: Sequence[str]
) -> Unloaded:
    """Of modes measured at q (dof,) while these sensors sat on the robot."""
    carried = [name for name in sensors if name in simulation.robot.sensor_mass_kg]
    if not modes or not carried:
        return Unloaded(tuple(modes), np.zeros(len(modes)))
    hz, shapes, lowered = _lowered(simulation, q, carried)
    off = np.log(np.array([mode.frequency_hz for mode in modes])[:, None] / (hz * (1 - lowered)))
    alike = mac_matrix(np.array([mode.shape for mode in modes]), shapes)
    worst = (FARTHEST / NEAR) ** 2 + 1
    cost = np.where(np.abs(off) < FARTHEST, (off / NEAR) ** 2 + 1 - alike, worst)
    pairs = list(zip(*least_cost(cost), strict=True))
    found, by = list(modes), np.full(len(modes), np.nan)
    for j, k in pairs:
        if cost[j, k] < worst:
            found[j], by[j] = _without(modes[j], float(lowered[k])), lowered[k]
    missing = worst * (len(modes) - len(pairs))
    unlike = (missing + sum(float(cost[j, k]) for j, k in pairs)) / worst
    return Unloaded(tuple(found), by, unlike)


def _without(mode: Mode, lowered: float) -> Mode:
    frequency = mode.frequency_hz / (1 - lowered)
    sd = float(np.hypot(mode.frequency_sd_hz, DOUBT * lowered * frequency))
    return replace(mode, frequency_hz=float(frequency), frequency_sd_hz=sd)


def _lowered(
    simulation: Simulation, q: np.ndarray, carried: Sequence[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bare frequencies (k,) in Hz, shapes at the tool's sensor (k, 3), shares (k,) lowered."""
    layout = Layout((TCP,), tuple(dict.fromkeys((SENSOR, *carried))))
    bare = simulation.elastic.matrices(q[None], layout=layout)
    stiffness = simulation.stiffness.real + bare.geometric
    hz, shapes, mass = undamped_modes(bare.mass, stiffness)
    there = np.array([[name in carried for name in layout.sensors]])
    loaded = with_sensors(bare, simulation.robot, layout, there)
    own_hz, own_shapes, _ = undamped_modes(loaded.mass, stiffness)
    _, partner = least_cost(-np.abs(shapes[0].T @ mass[0] @ own_shapes[0]))
    return hz[0], (bare.sensor[0, :3] @ shapes[0]).T, 1 - own_hz[0][partner] / hz[0]
