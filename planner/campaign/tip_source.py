"""What `couple` starts from: a file or a campaign, as receptances of the tested tool's tip."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.campaign.campaign import Campaign
from planner.campaign.posture_tip import posture_tip
from planner.campaign.store import is_campaign
from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.milling.coupling import ContactFit, TipReceptance, fit_contact
from planner.milling.cutter_frf import CutterFrf, read_frf
from planner.milling.tip_files import MEASURE, completed, read_tip
from planner.milling.tool import Tool
from planner.recording.folder import several_poses
from planner.robot.robot import Robot

LINES = 1e-6  # Hz by which lines of two files may differ


def tip_of(
    source: Path,
    tested: Tool | None,
    pose: str | None,
    robot: Path | None,
    noise: float,
    from_names: bool = False,
) -> tuple[TipReceptance, str]:
    """Receptances at the tip of the tested tool, and the name of the pose.

    `noise` is the relative sd of FRFs whose file states none, `from_names` as in `read_frfs`.
    Raises InputError in one sentence.
    """
    if is_campaign(source):
        return _campaign(source, pose)
    if several_poses([source]):
        return posture_tip(source, tested, pose), str(pose)
    found = read_tip(source, tested, pose, noise, from_names)
    if isinstance(found, TipReceptance):
        return found, pose or source.stem
    if robot is None:
        raise InputError(
            f"{source} holds motions alone, no rotations; {MEASURE}, or have the rotations "
            f"simulated: --robot ROBOT_TOML."
        )
    loaded = Robot.load(robot)
    q = found.joints_rad
    if q is None or len(q) != len(loaded.joint_names):
        raise InputError(
            f"{source} does not say the {len(loaded.joint_names)} joint angles of {robot}; write "
            f"it with predict --out."
        )
    return completed(found, Simulation(loaded), q), found.name


def _campaign(directory: Path, pose: str | None) -> tuple[TipReceptance, str]:
    campaign = Campaign(directory)
    q, lines = campaign.stands(pose), campaign.frequency_lines
    mean, sd = campaign.frf_at(q, lines)
    tip = tip_at(campaign, str(pose), q, lines, mean[0], sd[0])
    return replace(tip, simulated=campaign.state.simulated), str(pose)


def tip_at(
    campaign: Campaign, pose: str, q: np.ndarray, lines: np.ndarray, mean: np.ndarray,
    sd: np.ndarray,
) -> TipReceptance:  # fmt: skip
    """Of a campaign's accelerance (3, 3, F) and its sd at q (dof,), with its simulation's turns."""
    simulation = campaign.model.low.simulation
    if simulation is None:
        raise InputError(f"{campaign.directory} has no simulation for the rotations; {MEASURE}.")
    s2 = (2j * np.pi * lines) ** 2
    return completed(CutterFrf(pose, lines, mean / s2, sd / np.abs(s2)), simulation, q)


def within(tip: TipReceptance, band_hz: tuple[float, float] | None, source: Path) -> TipReceptance:
    """The lines of a band. Raises InputError where they do not cover it."""
    if band_hz is None:
        return tip
    low, high = band_hz
    f = tip.frequency_hz
    step = float(np.max(np.diff(f)))
    if not low < high or low < f[0] - step or high > f[-1] + step:
        raise InputError(
            f"{source} covers {f[0]:.4g} to {f[-1]:.4g} Hz, not {low:g} to {high:g} Hz; measure "
            f"that band, or ask for less."
        )
    chosen = (f >= low) & (f <= high)
    if np.count_nonzero(chosen) < 2:
        raise InputError(f"{source} has no two lines within {low:g} to {high:g} Hz; ask for more.")
    names = ("frequency_hz", "measured", "sd", "left", "right", "offset", "offset_sd")
    errors = None if tip.errors is None else tip.errors[:, chosen]
    return replace(tip, errors=errors, **{name: getattr(tip, name)[chosen] for name in names})


def fitted_contact(
    tip: TipReceptance, target: Tool, tested: Tool | None, seen: Path, pose: str | None
) -> ContactFit:
    """The target's contact from its FRFs in a file, of the same pose and lines as the source."""
    frf = read_frf(seen, pose if seen.suffix.lower() == ".npz" else None)
    place = np.searchsorted(frf.frequency_hz, tip.frequency_hz - LINES)
    place = np.minimum(place, len(frf.frequency_hz) - 1)
    if np.any(np.abs(frf.frequency_hz[place] - tip.frequency_hz) > 2 * LINES):
        raise InputError(
            f"{seen} does not hold the lines of the source, {tip.frequency_hz[0]:.4g} to "
            f"{tip.frequency_hz[-1]:.4g} Hz; export the same grid, or name a band by --band-hz."
        )
    return fit_contact(tip, target, tested, frf.receptance[..., place])
