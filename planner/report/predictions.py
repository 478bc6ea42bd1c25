"""Answer of `predict`: modes and FRFs with their uncertainty at given poses."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import UNSET
from msgspec import UnsetType as Unset
from rich.console import Group
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.campaign.model_status import outside_remark
from planner.export.npz import save_frfs
from planner.frf.synthesis import frequency_lines
from planner.report.answer import Done
from planner.report.text import number, remarks, table, with_sd
from planner.words import counted

if TYPE_CHECKING:
    from planner.robot.robot import Robot
    from planner.surrogate.frf_bands import ModalPrediction


@dataclass(frozen=True)
class ExpectedMode:
    """A mode as the model predicts it.

    `sd_hz` is what a new visit to the pose would show, the scatter from visit to visit included;
    the modal analysis' own sd of that measurement is not. None: nothing tells them.
    """

    frequency_hz: float
    sd_hz: float | None
    damping_ratio: float
    damping_sd: float | None

    @classmethod
    def all_of(cls, prediction: "ModalPrediction", i: int) -> "tuple[ExpectedMode, ...]":
        """All modes of the i-th pose of a prediction."""
        p = prediction
        columns = p.frequency_hz[i], p.frequency_sd_hz[i], p.damping_ratio[i], p.damping_sd[i]
        return tuple(cls(*map(float, numbers)) for numbers in zip(*columns, strict=True))

    @property
    def cells(self) -> tuple[str, str]:
        """Frequency (Hz) and damping (%) as a table shows them; what is not known is no number."""
        if self.sd_hz is None or self.damping_sd is None:
            return number(self.frequency_hz, ".2f"), number(100 * self.damping_ratio, ".2f")
        damping = with_sd(100 * self.damping_ratio, 100 * self.damping_sd)
        if not self.damping_sd < self.damping_ratio:
            damping = "not known"
        return with_sd(self.frequency_hz, self.sd_hz), damping


def _pose(
    name: str, modes: tuple[ExpectedMode, ...], force_n: float, outside: bool = False
) -> dict[str, Any]:
    """The modes expected at a pose, from the lowest; whether it lies outside the workspace.

    Of hits of such a peak force; NaN: none was asked for.
    """
    force = UNSET if np.isnan(force_n) else float(force_n)
    return {"pose": name, "modes": modes, "outside": outside, "peak_force_n": force}


def predictions(
    campaign: Campaign,
    names: Sequence[str],
    q: Sequence[np.ndarray],
    npz: Path,
    force_n: np.ndarray,
) -> Done:
    """Answer of `predict`: modes at n poses q, (dof,) in rad each; FRFs are in the npz file.

    Of hits of peak force_n (n,), where joints are not linear: FRFs as such hits measure them, modes
    linearised. NaN is as those of the campaign. Raises InputError where the file cannot be written.
    """
    # status needs none of what these import
    from planner.campaign.frf_model import UNCHANGED, struck_modes
    from planner.dynamics.at_force import change_at_force

    angles, lines = np.array(q), campaign.frequency_lines
    prediction, (mean, sd) = campaign.model.predict(angles), campaign.frf_at(angles)
    said, asked = campaign.model.cautions, bool(np.any(np.isfinite(force_n)))
    if asked:
        struck = campaign.model.struck
        said += () if struck else (UNCHANGED,)
        if struck is not None:
            prediction = struck_modes(struck, prediction, angles, force_n)
            mean = mean + change_at_force(struck, angles, force_n, lines)
    outside, robot = ~campaign.cell.inside(angles), campaign.cell.robot
    save_frfs(npz, lines, mean, sd, names, robot, angles, outside, force_n if asked else None)
    poses = [
        _pose(name, ExpectedMode.all_of(prediction, i), force, bool(outside[i]))
        for i, (name, force) in enumerate(zip(names, force_n, strict=True))
    ]
    return _answer(poses, npz, said, measurements=len(campaign.state.used))


def robot_predictions(
    robot: "Robot",
    names: Sequence[str],
    poses: Sequence[np.ndarray],
    npz: Path,
    force_n: np.ndarray,
) -> Done:
    """The same of a robot.toml alone: nothing tells how sure that is.

    Raises InputError where its simulation is not possible there, or the file cannot be written.
    """
    from planner.campaign.frf_model import UNCHANGED
    from planner.dynamics.at_force import change_at_force, modes_at_force
    from planner.dynamics.simulation import Simulation

    simulation, band = Simulation(robot), robot.config.band_hz
    q = np.reshape(poses, (len(names), len(robot.joint_names)))
    lines, asked = frequency_lines(band), np.isfinite(force_n)
    mean = simulation.accelerance(q, lines) + change_at_force(simulation, q, force_n, lines)
    modes = simulation.frequencies(q, simulation.elastic.size)
    f, ratio = modes.frequency_hz, modes.damping_ratio
    if robot.config.law and asked.any():
        there = modes_at_force(simulation, q[asked], force_n[asked], f.shape[1])
        f[asked], ratio[asked] = there.frequency_hz, there.damping_ratio
    save_frfs(npz, lines, mean, None, names, robot, q, None, force_n if asked.any() else None)
    said = () if robot.config.law or not asked.any() else (UNCHANGED,)
    shown = []
    for name, force, *own in zip(names, force_n, f, ratio, strict=True):
        inside = ((hz, z) for hz, z in zip(*own, strict=True) if band[0] <= hz <= band[1])
        expected = tuple(ExpectedMode(float(hz), None, float(z), None) for hz, z in inside)
        shown.append(_pose(name, expected, force))
    return _answer(shown, npz, said, robot=str(robot.path.absolute()))


def _answer(
    poses: Sequence[dict[str, Any]], npz: Path, told: tuple[str, ...], measurements: int = 0,
    robot: str | Unset = UNSET,
) -> Done:  # fmt: skip
    """Of so many measured poses, or of a `robot`.toml that was asked alone."""
    keys = {
        "poses": poses, "npz": str(npz.resolve()), "measurements": measurements,
        "remarks": told, "robot": robot,
    }  # fmt: skip
    alone, title = robot is not UNSET, f"After {counted(measurements, 'measured pose')}"
    title = f"As {robot} states the robot" if alone else title
    rows = (
        (_title(pose) if k == 0 else "", str(k + 1), *mode.cells)
        for pose in poses
        for k, mode in enumerate(pose["modes"])
    )
    made = table(title, "pose", "mode", "frequency (Hz)", "damping (%)", rows=rows)
    # Nobody asked the model to be good there.
    said = outside_remark([pose["pose"] for pose in poses if pose["outside"]])
    lines = [*([Text(said, style="yellow")] if said else []), *remarks(told)]
    file = Text(f"FRFs (m/s²/N){'' if alone else ' with sd'}: {keys['npz']}")
    return Done(keys, Group(made, *lines, file))


def _title(pose: dict[str, Any]) -> str:
    """Its name, and what is special."""
    force = "" if pose["peak_force_n"] is UNSET else f", {pose['peak_force_n']:g} N"
    return f"{pose['pose']}{force}{' (outside)' if pose['outside'] else ''}"
