"""Answer of `check`: what a robot's description says, and what looks wrong in it."""

from typing import Any

import msgspec
import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text

from planner.check.description import SEVERITIES, CheckRemark
from planner.check.examine import Examination
from planner.report.answer import Done
from planner.report.pictures import Pictures
from planner.report.text import ending, number, table
from planner.robot.joint_laws import NUMBER_ENTRIES, LawTable
from planner.robot.link_bodies import LinkBody, mounted
from planner.robot.robot import Robot
from planner.words import counted, listed

COLOURS = {"error": "bold red", "warning": "yellow", "note": "dim"}


def robot_check(found: Examination, pictures: Pictures) -> Done:
    """Answer of `check`: what was found, errors first, and whether a campaign can begin ("ok")."""
    robot, poses = found.robot, _poses(found)

    def draw():
        from planner.report.robot_picture import robot_figure

        return {"robot": robot_figure(robot, found.q[0], found.links)}

    written = pictures.write(draw, robot.name)
    mass, moving = (sum(b.mass for b in found.links if b.joint or not own) for own in (False, True))
    keys = {
        "robot": robot.name, "robot_toml": str(robot.path.absolute()), "ok": not found.errors,
        "findings": found.remarks, "mass_kg": mass, "moving_mass_kg": moving,
        "reach_m": robot.reach_m, "band_hz": robot.config.band_hz,
        "links": [_link(body) for body in found.links], "joints": _joints(robot), "poses": poses,
        "laws": robot.config.law, **written, "joint_units": robot.joints.declared,
    }  # fmt: skip
    low, high = robot.config.band_hz
    most = 2 * high  # the others stand in the JSON
    asked = f"frequency in Hz (damping in %), up to {most:g} Hz"
    modes = table("simulated modes", "pose", asked)
    for pose in poses:
        at = ", ".join(robot.joints.text(i, v, 0) for i, v in enumerate(pose["joints_deg"]))
        modes.add_row(f"{pose['pose']}: {at}", _cell(pose, most))
    said = [Text(f"band_hz is {low:g} to {high:g} Hz."), *map(_law, robot.config.law)]
    said += [Text(f"{r.severity}: {r.sentence}", COLOURS[r.severity]) for r in found.remarks]
    parts = [_masses(found, mass, moving), *([modes] if poses else []), *said]
    return Done(keys, Group(*parts, _summary(found.remarks), *ending(written)))


def _masses(found: Examination, mass: float, moving: float) -> Table:
    """Links that have a mass or a shape; `mass` and what of it moves in kg."""
    robot = found.robot
    made = table(
        f"{robot.name}: {moving:.4g} kg move{_carried(found)}, {mass - moving:.4g} kg "
        f"stand still, reach at most {robot.reach_m:.3g} m",
        *("link", "moved by", "mass (kg)", "centre of mass (m)", "collision shapes"),
    )
    for link in found.links:
        if link.stated or link.shapes:
            place = ", ".join(f"{v:z.3f}" for v in link.com_m) if link.mass else "–"
            weight = f"{link.mass:.4g}" if link.stated else "–"
            weight += f" ± {_mass_sd(link):.2g}" if _mass_sd(link) else ""
            made.add_row(Text(link.name), link.joint or "–", weight, place, str(link.shapes))
    return made


def _joints(robot: Robot) -> list[dict[str, Any]]:
    """Limits and speed of each, in degrees and degrees a second; a slide's in mm and mm/s."""
    keys = "lower_deg", "upper_deg", "speed_deg_s"
    limits = robot.joints.shown([robot.lower_rad, robot.upper_rad, robot.velocity_rad_s]).T
    return [
        {"joint": name, **dict(zip(keys, row, strict=True)),
         "unit": "mm" if robot.slides(name) else msgspec.UNSET}
        for name, row in zip(robot.joint_names, limits, strict=True)
    ]  # fmt: skip


def _poses(found: Examination) -> list[dict[str, Any]]:
    """What the simulation says at the poses looked at: their modes, from the lowest."""
    joints = found.robot.joints
    if not found.frequency_hz.size:
        return []
    position, known = found.robot.forward_batch(found.q)[1], np.isfinite(found.frequency_hz)
    return [
        {"pose": pose, "joints_deg": joints.shown(found.q[i]).round(4),
         "position_m": position[i], "frequency_hz": found.frequency_hz[i, known[i]],
         "damping_ratio": found.damping_ratio[i, known[i]]}
        for i, pose in enumerate(found.poses)
    ]  # fmt: skip


def _carried(found: Examination) -> str:
    """What [[payload]] of robot.toml adds to the links that move, in words."""
    mass = sum(body.mass for body in found.robot.config.payload)
    if mass:
        return f", and {mass:.4g} kg of [[payload]]"
    tool = mounted(found.robot, found.links)
    if tool:
        own = sum(link.mass for link in tool)
        return f", {own:.4g} kg of it the URDF's {listed([link.name for link in tool])}"
    return ", no tool ([[payload]]) stated"


def _link(body: LinkBody) -> dict[str, Any]:
    """What turns it (null: nothing), mass, centre of mass (m) and principal moments."""
    return {
        "link": body.name, "joint": body.joint or None, "mass_kg": body.mass, "com_m": body.com_m,
        "moments_kg_m2": body.moments, "inertial": body.stated, "collision_shapes": body.shapes,
        "guessed": body.guessed, "mass_sd_kg": _mass_sd(body),
    }  # fmt: skip


def _mass_sd(body: LinkBody) -> float | None:
    return None if body.sd_percent is None else body.mass * body.sd_percent / 100


def _cell(pose: dict[str, Any], most_hz: float) -> str:
    both = zip(pose["frequency_hz"], pose["damping_ratio"], strict=True)
    pairs = [pair for pair in both if pair[0] <= most_hz]
    # Frequency and damping of a mode stay on one line.
    return "   ".join(f"{number(f, '.1f')}\u00a0({number(100 * d, '.1f')})" for f, d in pairs)


def _law(law: LawTable) -> Text:
    named = ((name, getattr(law, name)) for name in NUMBER_ENTRIES)
    numbers = ", ".join(f"{name} = {value:.4g}" for name, value in named if value is not None)
    return Text(f"{law.joint} is not linear ({law.kind}: {numbers}); modes above are without that.")


def _summary(findings: tuple[CheckRemark, ...]) -> Text:
    counts = [sum(f.severity == name for f in findings) for name in SEVERITIES]
    if not any(counts):
        return Text("Nothing looks wrong.", style="green")
    if not any(counts[:2]):
        return Text(f"Nothing looks wrong; {counted(counts[2], 'note')} above.", style="green")
    return Text(", ".join(map(counted, counts, SEVERITIES)) + ".")
