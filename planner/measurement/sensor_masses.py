"""Modes of a survey without the masses of its sensors, and what is said about it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from planner.dataset.measure import MeasuredPose, of_tool
from planner.dynamics.simulation import Simulation
from planner.measurement.sensor_loading import DOUBT, Unloaded, unloaded
from planner.modal.modes import Mode


@dataclass(frozen=True)
class WithoutSensors:
    """Modes of all poses, by how many percent sensors had lowered them, and remarks.

    `lowered_percent` is by frequency, pose by pose; None where the simulation has no such mode.
    """

    modes: tuple[tuple[Mode, ...], ...]
    lowered_percent: tuple[dict[float, float | None], ...] = field(default=())
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
