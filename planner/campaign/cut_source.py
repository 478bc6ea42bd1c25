"""What `stability` and `couple` start from: files or a campaign, this tool or another."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from planner.campaign.campaign import Campaign
from planner.campaign.model_status import outside_remark
from planner.campaign.store import is_campaign
from planner.errors import InputError
from planner.milling.cut import Cut, cuts_at, no_pose, turned_to
from planner.milling.cutter_frf import CutterFrf, names_in, of_accelerance, read_frf
from planner.milling.cutter_modes import load_mode_file
from planner.milling.structure import OutOfBandError, Structure, of_frf, of_modes
from planner.recording.folder import several_poses

if TYPE_CHECKING:
    from planner.milling.coupling import ContactFit, TipReceptance
    from planner.milling.tool import Tool


@dataclass(frozen=True)
class StabilityRequest:
    """What `stability` is asked: a source, its pose, and one point of interest.

    With `tool` the FRFs are coupled to it first, as `couple` does: `reference` is the tested one,
    `robot` whose simulation tells how the tip turns, `noise` the relative sd of FRFs whose file
    states none. `peak_force_n` is that of hits for which a campaign's joints are linearised. A
    campaign's `path` is a table of poses or a program: then `origin` is its zero, `poses` how many
    are looked at; `turns`: about the tool's axis, too.
    """

    source: Path
    cut: Path
    pose: str | None
    point: str | None
    samples: int
    tool: Path | None
    reference: Path | None
    robot: Path | None
    noise: float
    from_names: bool  # FRFs' places from the names of their files
    peak_force_n: float | None
    path: Path | None
    origin: str | None
    poses: int
    turns: bool

    @property
    def wanted(self) -> tuple[float, float] | None:
        """Speed in rpm and depth in m of the point; InputError where they are none."""
        if self.point is None:
            return None
        try:
            rpm, depth = (float(part) for part in self.point.split(","))
        except ValueError:
            raise InputError(
                f"--point {self.point} is not RPM,DEPTH_M; give e.g. 5000,0.001."
            ) from None
        if not (1 <= rpm <= 1e6 and 0 <= depth < 1):
            raise InputError(
                f"--point {self.point}: the speed must be 1 rpm or more, the depth 0 to 1 m."
            )
        return rpm, depth

    @property
    def campaign(self) -> Campaign:
        """The source, with the stated force; InputError where a force would change nothing."""
        from planner.campaign.frf_model import UNCHANGED

        opened = Campaign(self.source)
        if self.peak_force_n is not None and not opened.cell.robot.config.law:
            raise InputError(f"--{UNCHANGED.replace('_', '-', 2)}")
        return opened.struck_with(self.peak_force_n)


@dataclass(frozen=True, eq=False)
class ToolChange:
    """The tool that is put on, and the tested one that is taken off, if any."""

    target: "Tool"
    tested: "Tool | None"
    remarks: tuple[str, ...] = ()

    @classmethod
    def of(cls, asked: StabilityRequest, cut: Cut) -> "ToolChange | None":
        """None where no tool is named; InputError where its file and the cut's disagree."""
        from planner.milling.tool import load_tool

        if asked.tool is None:
            if asked.reference or asked.robot or asked.noise:
                raise InputError(
                    "--reference, --robot and --noise go with --tool; name the tool that is put on."
                )
            return None
        target = load_tool(asked.tool)
        tested = None if asked.reference is None else load_tool(asked.reference)
        told = [_directions(cut, tool, file) for tool, file in
                ((target, asked.tool), (tested, asked.reference)) if tool is not None]  # fmt: skip
        return cls(target, tested, tuple(text for text in told if text))

    def coupled(self, tip: "TipReceptance", name: str) -> tuple[CutterFrf, tuple[str, ...]]:
        """FRFs of the target's tip, and remarks."""
        from planner.milling.coupling import couple

        found = couple(tip, self.target, self.tested)
        h, sd = found.accelerance[:3, :3], found.accelerance_sd[:3, :3]
        frf = of_accelerance(f"{name}, {self.target.name}", found.frequency_hz, h, sd)
        return replace(frf, simulated=found.simulated), (*self.remarks, *found.remarks)


TOWARDS = 0.99  # cosine of the angle between directions that are the same
BEYOND = 0.5  # cosine: more than 60° off the way back to the robot's last joint. Chosen.


def _directions(cut: Cut, tool: "Tool", file: Path | None) -> str:
    """What disagrees between the cut's axis and where a tool's file has the spindle, if anything.

    InputError where that file says to_spindle; older ones are taken as they are.
    """
    axis = np.array(cut.axis) / np.linalg.norm(cut.axis)
    if axis @ -np.array(tool.axis) >= TOWARDS:
        return ""
    spindle = [round(-v, 4) + 0.0 for v in tool.axis]
    text = (
        f"Seen from the tip the cut's axis has the spindle at {list(cut.axis)}, {file} at "
        f"{spindle}; correct the one that is wrong."
    )
    if tool.says_spindle:
        raise InputError(text)
    return text


def structure_of(asked: StabilityRequest, cut: Cut) -> Structure:
    """From modes, FRFs, or a campaign at a pose."""
    source, change = asked.source, ToolChange.of(asked, cut)
    if is_campaign(source):
        campaign = asked.campaign
        q = campaign.posture(asked.pose)
        at = CampaignPoses(campaign, (str(asked.pose),), q[None], change)
        ((_, found),) = at.structures(cut)
        return _with(found, at.remarks(cut))
    if asked.peak_force_n is not None:
        raise InputError(
            f"--peak-force-n goes with a campaign, which {source} is not; predict its FRFs at that "
            f"force and name the npz."
        )
    no_pose(cut, source)
    if change is None and source.suffix.lower() == ".toml":
        if asked.pose is not None:
            raise InputError(f"{source} states modes of one pose; leave --pose out.")
        return of_modes(load_mode_file(source), cut)
    return _of_frfs(asked, change, asked.pose, cut)


def structures_of_file(asked: StabilityRequest, cut: Cut) -> list[tuple[str, Structure]]:
    """Every pose of an npz."""
    change, source = ToolChange.of(asked, cut), asked.source
    no_pose(cut, source)
    names = names_in(source)
    return [(name or source.stem, _of_frfs(asked, change, name, cut)) for name in names]


def _of_frfs(
    asked: StabilityRequest, change: ToolChange | None, pose: str | None, cut: Cut
) -> Structure:
    if change is None:
        return of_frf(read_frf(asked.source, pose, asked.from_names), cut)
    tip, name = tip_of(
        asked.source, change.tested, pose, asked.robot, asked.noise, asked.from_names
    )
    frf, remarks = change.coupled(tip, f"{asked.source}, pose {name}")
    return _with(of_frf(frf, cut), remarks)


@dataclass(frozen=True, eq=False)
class CampaignPoses:
    """p named poses q (p, dof) of a campaign in rad, with feeds (p, 3) in the base if known.

    FRFs there are those that it predicts, of the tool that is put on where there is a `change`.
    """

    campaign: Campaign
    names: tuple[str, ...]
    q: np.ndarray
    change: ToolChange | None
    feeds: np.ndarray | None = None

    def structures(self, cut: Cut) -> list[tuple[str, Structure]]:
        """By name, each in the plane of the cut there, whose feed is that of a program if known.

        Raises OutOfBandError where the cut would chatter outside the lines at one of them.
        """
        found = []
        for name, one in zip(self.names, self.in_band(cut), strict=True):
            if isinstance(one, OutOfBandError):
                raise one
            found.append((name, one))
        return found

    def in_band(self, cut: Cut) -> Iterator[Structure | OutOfBandError]:
        """The same, pose by pose; one where the cut would chatter outside the lines says so."""
        campaign, lines = self.campaign, self.campaign.frequency_lines
        rotation, position = campaign.cell.robot.forward_batch(self.q)
        if self.feeds is not None and cut.feed_in == "path":
            turned = zip(rotation, self.feeds, self.names, strict=True)
            cuts = [turned_to(cut, *row) for row in turned]
        else:
            cuts = cuts_at(cut, rotation, position, self.names)
        at_tip = tip_frfs(campaign, self.q, lines) if self.change is None else None
        for i, name in enumerate(self.names):
            where, remarks = f"{campaign.directory}, pose {name}", ()
            if at_tip is not None:
                frf = of_accelerance(where, lines, at_tip[0][i], at_tip[1][i])
            else:
                assert self.change is not None
                tip = tip_at(campaign, name, self.q[i], lines)
                frf, remarks = self.change.coupled(tip, where)
            frf = replace(frf, simulated=campaign.state.simulated)
            try:
                yield _with(of_frf(frf, cuts[i]), remarks)
            except OutOfBandError as error:
                yield error

    def remarks(self, cut: Cut) -> tuple[str, ...]:
        """On those that lie outside the workspace, and on the side of the tip that is cut from."""
        there = self.campaign.cell.inside(self.q)
        beyond = [name for name, one in zip(self.names, there, strict=True) if not one]
        said = outside_remark(beyond)
        return (*([said] if said else []), *beyond_the_tip(self.campaign, cut))


def tip_frfs(campaign: Campaign, q: np.ndarray, lines: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Accelerance (p, 3, 3, F) in m/s²/N of the tcp by forces there, and sd, at q (p, dof) in rad.

    What is predicted where the sensor sits is carried to the tcp by as much as the simulation has
    both apart; without one it is taken as it is.
    """
    mean, sd = campaign.frf_at(q, lines)
    simulation, robot = campaign.model.low.simulation, campaign.cell.robot
    if simulation is None or robot.sensor_at_tcp:
        return mean, sd
    there = simulation.accelerance(q, lines)
    tip = simulation.frfs(q, lines, sensors=(robot.config.tcp_frame,))[:, 0, :, 0]
    size, was = (np.linalg.norm(h, axis=(1, 2), keepdims=True) for h in (tip, there))
    return mean + tip - there, sd * size / np.where(was > 0, was, 1.0)


def beyond_the_tip(campaign: Campaign, cut: Cut) -> tuple[str, ...]:
    """A remark where a cut's axis has the spindle on that side of the tip where the robot is not.

    The limits of one and the other differ: teeth come round the other way.
    """
    robot = campaign.cell.robot
    place = robot.model.frames[robot.tcp_id].placement  # from the last joint
    arm, axis = -place.rotation.T @ place.translation, np.array(cut.axis)
    if axis @ arm >= -BEYOND * np.linalg.norm(axis) * np.linalg.norm(arm):
        return ()
    return (
        f"axis = {list(cut.axis)} of cut.toml has the spindle beyond the tip, seen from the robot; "
        f"if it sits between robot and tip, write axis = {[0.0 - v for v in cut.axis]}: the limits "
        f"are others.",
    )


def _with(structure: Structure, remarks: tuple[str, ...]) -> Structure:
    return replace(structure, remarks=(*remarks, *structure.remarks))


LINES = 1e-6  # Hz by which lines of two files may differ


def tip_of(
    source: Path, tested: "Tool | None", pose: str | None, robot: Path | None, noise: float,
    from_names: bool = False,
) -> "tuple[TipReceptance, str]":  # fmt: skip
    """Receptances at the tip of the tested tool, and the name of the pose.

    `noise` is the relative sd of FRFs whose file states none, `from_names` as in `read_frfs`.
    Raises InputError in one sentence.
    """
    from planner.milling.coupling import TipReceptance
    from planner.milling.tip_files import MEASURE, read_tip

    if is_campaign(source):
        campaign = Campaign(source)
        q, lines = campaign.posture(pose), campaign.frequency_lines
        tip = tip_at(campaign, str(pose), q, lines)
        return replace(tip, simulated=campaign.state.simulated), str(pose)
    if several_poses([source]):
        from planner.campaign.posture_tip import posture_tip

        return posture_tip(source, tested, pose), str(pose)
    found = read_tip(source, tested, pose, noise, from_names)
    if isinstance(found, TipReceptance):
        return found, pose or source.stem
    if robot is None:
        raise InputError(
            f"{source} holds motions alone, no rotations; {MEASURE}, or have the rotations "
            f"simulated: --robot ROBOT_TOML."
        )
    from planner.dynamics.simulation import Simulation
    from planner.milling.tip_files import completed
    from planner.robot.robot import Robot

    loaded, q = Robot.load(robot), found.joints_rad
    if q is None or len(q) != len(loaded.joint_names):
        raise InputError(
            f"{source} does not say the {len(loaded.joint_names)} joint angles of {robot}; write "
            f"it with predict --out."
        )
    return completed(found, Simulation(loaded), q), found.name


def tip_at(campaign: Campaign, pose: str, q: np.ndarray, lines: np.ndarray) -> "TipReceptance":
    """Of what the campaign's sensor shows at q (dof,) in rad at `lines` (F,) in Hz.

    `completed` carries it to the tip and adds the turns, both by the simulation. InputError where
    there is none.
    """
    from planner.milling.tip_files import MEASURE, completed

    simulation = campaign.model.low.simulation
    if simulation is None:
        raise InputError(f"{campaign.directory} has no simulation for the rotations; {MEASURE}.")
    (mean,), (sd,) = campaign.frf_at(q[None], lines)
    s2 = (2j * np.pi * lines) ** 2
    return completed(CutterFrf(pose, lines, mean / s2, sd / np.abs(s2)), simulation, q)


def within(
    tip: "TipReceptance", band_hz: tuple[float, float] | None, source: Path
) -> "TipReceptance":
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
    tip: "TipReceptance", target: "Tool", tested: "Tool | None", seen: Path, pose: str | None
) -> "ContactFit":
    """The target's contact from its FRFs in a file, of the same pose and lines as the source."""
    from planner.milling.coupling import fit_contact

    frf = read_frf(seen, pose if seen.suffix.lower() == ".npz" else None)
    place = np.searchsorted(frf.frequency_hz, tip.frequency_hz - LINES)
    place = np.minimum(place, len(frf.frequency_hz) - 1)
    if np.any(np.abs(frf.frequency_hz[place] - tip.frequency_hz) > 2 * LINES):
        raise InputError(
            f"{seen} does not hold the lines of the source, {tip.frequency_hz[0]:.4g} to "
            f"{tip.frequency_hz[-1]:.4g} Hz; export the same grid, or name a band by --band-hz."
        )
    return fit_contact(tip, target, tested, frf.receptance[..., place])
