"""What modes would be without the sensors that sat on the robot: mass loading.

A sensor of mass m at a point that moves by φ per root of modal mass lowers f by about mφ²/2 of
itself. The simulation with and without the sensors' masses tells by how much.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.dataset.measure import MeasuredPose, of_tool
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
    unlike: float


def unloaded(
    modes: Sequence[Mode], simulation: Simulation, q: np.ndarray, sensors: Sequence[str]
) -> Unloaded:
    """Of modes measured at q (dof,) while these sensors sat on the robot."""
    carried = [name for name in sensors if name in simulation.robot.sensor_mass_kg]
    if not modes or not carried:
        return Unloaded(tuple(modes), np.zeros(len(modes)), 0.0)
    hz, shapes, lowered = _lowered(simulation, q, carried)
    off = np.log(np.array([mode.frequency_hz for mode in modes])[:, None] / (hz * (1 - lowered)))
    alike = mac_matrix(np.array([mode.shape for mode in modes]), shapes)
    worst = (FARTHEST / NEAR) ** 2 + 1
    cost = np.where(np.abs(off) < FARTHEST, (off / NEAR) ** 2 + 1 - alike, worst)
    pairs = list(zip(*least_cost(cost), strict=True))
    found, by = list(modes), np.full(len(modes), np.nan)
    for j, k in pairs:
        if cost[j, k] < worst:
            hz_alone = float(modes[j].frequency_hz / (1 - lowered[k]))
            sd = float(np.hypot(modes[j].frequency_sd_hz, DOUBT * lowered[k] * hz_alone))
            found[j] = replace(modes[j], frequency_hz=hz_alone, frequency_sd_hz=sd)
            by[j] = lowered[k]
    missing = worst * (len(modes) - len(pairs))
    unlike = (missing + sum(float(cost[j, k]) for j, k in pairs)) / worst
    return Unloaded(tuple(found), by, unlike)


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


@dataclass(frozen=True)
class WithoutSensors:
    """Modes of all poses, by how many percent sensors had lowered them, and remarks.

    `lowered_percent` is by frequency, pose by pose; None where the simulation has no such mode.
    """

    modes: tuple[tuple[Mode, ...], ...]
    lowered_percent: tuple[dict[float, float | None], ...] = ()
    remarks: tuple[str, ...] = ()

    def of(self, pose: int, mode: Mode) -> float | None:
        """By how many percent a mode of a pose was lowered."""
        found = self.lowered_percent[pose] if self.lowered_percent else {}
        return found.get(mode.frequency_hz, 0.0)


def without_sensors(
    names: Sequence[str],
    modes: Sequence[Sequence[Mode]],
    simulations: Sequence[Simulation],
    q: np.ndarray,
    measured: Sequence[MeasuredPose],
) -> WithoutSensors:
    """Modes of poses `names` at q (n, dof), as they are where robot.toml states no masses.

    By that of the simulations whose modes are most like the measured ones.
    """
    as_they_are = WithoutSensors(tuple(map(tuple, modes)))
    masses = simulations[0].robot.sensor_mass_kg if simulations else {}
    if not masses:
        return as_they_are
    sets = [_sets(one) for one in measured]
    each = list(zip(modes, q, sets, strict=True))
    tried = [
        [unloaded(own, simulation, row, there[0]) for own, row, there in each]
        for simulation in simulations
    ]
    found = min(tried, key=lambda poses: sum(one.unlike for one in poses))
    if not any(np.any(one.lowered != 0) for one in found):
        return as_they_are
    lowered = tuple(
        {
            mode.frequency_hz: None if np.isnan(share) else float(100 * share)
            for mode, share in zip(one.modes, one.lowered, strict=True)
        }
        for one in found
    )
    told = _remarks(names, found, masses, sets)
    return WithoutSensors(tuple(one.modes for one in found), lowered, told)


def _sets(measured: MeasuredPose) -> tuple[tuple[str, ...], ...]:
    """Sensors that hits at the tool were heard by together, those of the tool's modes first.

    As `Frf.of_tool` chooses: where most axes were hit, then most often. Of exported FRFs all.
    """
    axes: dict[tuple[str, ...], list[str]] = {}
    for hit in measured.hits:
        if of_tool((hit,)):
            axes.setdefault(hit.layout.sensors, []).append(hit.axis[-1])
    if not axes:
        return (measured.whole.layout.sensors,) if measured.whole is not None else ((),)
    return tuple(sorted(axes, key=lambda own: (-len(set(axes[own])), -len(axes[own]))))


def _remarks(
    names: Sequence[str],
    found: Sequence[Unloaded],
    masses: dict[str, float],
    sets: Sequence[tuple[tuple[str, ...], ...]],
) -> tuple[str, ...]:
    there = {name for own in sets for name in own[0]}
    carried = ", ".join(f"{name} ({kg:g} kg)" for name, kg in masses.items() if name in there)
    every = np.concatenate([one.lowered for one in found])
    most = float(np.nanmax(every))
    told = [
        f"Sensors at {carried} lower frequencies by up to {100 * most:.2f} %: they are given as"
        f" without them, by the simulation with and without these masses; {100 * DOUBT:.0f} % of"
        " each correction is in its sd. Damping and residues are as measured."
    ]
    for name, own in zip(names, sets, strict=True):
        kinds = {tuple(sorted(n for n in group if n in masses)) for group in own}
        if len(kinds) > 1:
            on = " and ".join(n for n in own[0] if n in masses) or "none of these"
            told.append(
                f"{name}: sensors were moved between hits, which changes the frequencies; the"
                f" tool's modes are from hits with the sensors of {on} on."
            )
    count = int(np.count_nonzero(np.isnan(every)))
    if count:
        told.append(f"{count} modes that the simulation does not have are left as measured.")
    return tuple(told)
