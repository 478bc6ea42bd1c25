"""Answer of `check`: what a robot's description says, and what looks wrong in it."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import msgspec
from rich.console import Group
from rich.text import Text

from planner.check.description import SEVERITIES, CheckRemark
from planner.check.examine import (
    CheckedJoint,
    CheckedLink,
    CheckedPose,
    Examination,
    checked_joints,
    checked_links,
    checked_poses,
)
from planner.recording.joints import JointUnits
from planner.report.answer import NOT_IN_JSON, Answer
from planner.report.text import number, table
from planner.robot.joint_laws import NUMBER_ENTRIES, LawTable
from planner.words import counted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {"error": "bold red", "warning": "yellow", "note": "dim"}
SHOWN_TO = 2.0  # times the end of the band; the others stand in the JSON


@dataclass(frozen=True)
class RobotCheckReport(Answer):
    """Answer of `check`; `ok` is whether a campaign can begin, errors come first in `findings`."""

    robot: str
    robot_toml: str
    ok: bool
    findings: tuple[CheckRemark, ...]
    mass_kg: float
    moving_mass_kg: float
    reach_m: float
    band_hz: tuple[float, float]
    links: tuple[CheckedLink, ...]
    joints: tuple[CheckedJoint, ...]
    poses: tuple[CheckedPose, ...]
    laws: tuple[LawTable, ...] = ()
    plots: tuple[str, ...] = ()
    rrd: str | None = None
    joint_units: Any = msgspec.UNSET
    found: Examination | None = field(default=None, repr=False, metadata=NOT_IN_JSON)

    @classmethod
    def of(cls, found: Examination) -> "RobotCheckReport":
        """Of what was found."""
        robot = found.robot
        return cls(
            robot=robot.name,
            robot_toml=str(robot.path.absolute()),
            ok=not found.errors,
            findings=found.remarks,
            mass_kg=sum(b.mass for b in found.links),
            moving_mass_kg=sum(b.mass for b in found.links if b.joint),
            reach_m=robot.reach_m,
            band_hz=robot.config.band_hz,
            links=checked_links(found),
            joints=checked_joints(found),
            poses=checked_poses(found),
            laws=robot.config.law,
            joint_units=robot.joints.declared,
            found=found,
        )

    def drawings(self) -> "dict[str, Figure]":
        """The robot at home."""
        if self.found is None:
            return {}
        from planner.report.robot_picture import robot_figure

        return {"robot": robot_figure(self.found.robot, self.found.q[0], self.found.links)}

    def text(self) -> Group:
        """Masses, modes, then what was found, worst first."""
        still = self.mass_kg - self.moving_mass_kg
        masses = table(
            f"{self.robot}: {self.moving_mass_kg:.4g} kg move{self._carried()}, {still:.4g} kg "
            f"stand still, reach at most {self.reach_m:.3g} m",
            *("link", "moved by", "mass (kg)", "centre of mass (m)", "collision shapes"),
        )
        for link in self.links:
            if link.inertial or link.collision_shapes:
                place = ", ".join(f"{v:z.3f}" for v in link.com_m) if link.mass_kg else "–"
                mass = f"{link.mass_kg:.4g}" if link.inertial else "–"
                mass += f" ± {link.mass_sd_kg:.2g}" if link.mass_sd_kg else ""
                cells = link.joint or "–", mass, place, str(link.collision_shapes)
                masses.add_row(Text(link.link), *cells)
        most = SHOWN_TO * self.band_hz[1]
        asked = f"frequency in Hz (damping in %), up to {most:g} Hz"
        modes = table("simulated modes", "pose", asked)
        names = [joint.joint for joint in self.joints]
        joints = JointUnits.declared_as(names, self.joint_units)
        for pose in self.poses:
            at = ", ".join(joints.text(i, v, 0) for i, v in enumerate(pose.joints_deg))
            modes.add_row(f"{pose.pose}: {at}", _cell(pose, most))
        low, high = self.band_hz
        said = [Text(f"band_hz is {low:g} to {high:g} Hz."), *map(_law, self.laws)]
        said += map(_line, self.findings)
        parts = [masses, *([modes] if self.poses else []), *said, _summary(self.findings)]
        return Group(*parts, *self.end)

    def _carried(self) -> str:
        """What [[payload]] of robot.toml adds to the links that move, in words."""
        carried = self.found.robot.config.payload if self.found else ()
        mass = sum(body.mass for body in carried)
        return f", and {mass:.4g} kg of [[payload]]" if mass else ", no tool ([[payload]]) stated"


def _cell(pose: CheckedPose, most_hz: float) -> str:
    both = zip(pose.frequency_hz, pose.damping_ratio, strict=True)
    pairs = [pair for pair in both if pair[0] <= most_hz]
    # Frequency and damping of a mode stay on one line.
    return "   ".join(f"{number(f, '.1f')}\u00a0({number(100 * d, '.1f')})" for f, d in pairs)


def _law(law: LawTable) -> Text:
    named = ((name, getattr(law, name)) for name in NUMBER_ENTRIES)
    numbers = ", ".join(f"{name} = {value:.4g}" for name, value in named if value is not None)
    return Text(f"{law.joint} is not linear ({law.kind}: {numbers}); modes above are without that.")


def _line(remark: CheckRemark) -> Text:
    return Text(f"{remark.severity}: {remark.sentence}", style=COLOURS[remark.severity])


def _summary(findings: tuple[CheckRemark, ...]) -> Text:
    counts = [sum(f.severity == name for f in findings) for name in SEVERITIES]
    if not any(counts):
        return Text("Nothing looks wrong.", style="green")
    if not any(counts[:2]):
        return Text(f"Nothing looks wrong; {counted(counts[2], 'note')} above.", style="green")
    said = ", ".join(
        f"{n} {name}{'s' if n != 1 else ''}" for n, name in zip(counts, SEVERITIES, strict=True)
    )
    return Text(said + ".")
