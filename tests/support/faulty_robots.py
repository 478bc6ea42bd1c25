"""Five robots for everyday campaigns, and what their simulations lack."""

import tomllib
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from shutil import copytree

import numpy as np

from planner.demo import shipped
from planner.proof.arms import in_a_cell
from planner.proof.cases import SCATTER
from planner.proof.deviation import AttachedResonator, BentLink, soft_floor
from planner.proof.fault_injection import InjectedFaults
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.proof.scene import PULSE_S, deviate, log_uniform, some_direction, triple
from planner.proof.springs import beam_end
from tests.support.arm_with_points import write_arm

KINDS = "nothing", "soft base", "bending link", "hose"
BENDS_M = 0.15  # least length of a link that bends
TCP_NODE = 17


@dataclass(frozen=True)
class Robot:
    """Files of a robot, its workspace (not stated: part of all ranges), band (Hz), who hits it."""

    toml: Path
    joints_deg: Sequence[tuple[float, float]] | None
    band_hz: tuple[float, float]
    hammer: Hammer


def known(name: str, folder: Path, rng: np.random.Generator) -> Robot:
    arm = in_a_cell(name)
    toml = arm.write(folder / "robot", int(rng.choice([1, 3])))
    rate = 1000.0 if name == "kr10" else 400.0
    hammer = Hammer(arm.peak_n, PULSE_S * 400 / rate, rate, record_s=1024 / rate)
    return Robot(toml, arm.joints_deg, arm.band_hz, hammer)


def _shipped(folder: Path, _: np.random.Generator) -> Robot:
    """The plane of the shipped campaign."""
    copytree(shipped("kr240_plane") / "robot", folder / "robot")
    return Robot(folder / "robot" / "robot.toml", None, (4.0, 60.0), Hammer())


def _pointed(folder: Path, _: np.random.Generator) -> Robot:
    box = (-60, 60), (-40, 30), (20, 100), (-50, 50)
    hammer = Hammer(250.0, 0.005, 512.0, record_s=2.0)
    toml = write_arm(folder / "robot", f'\n[[point]]\nname = "tcp"\nnode = {TCP_NODE}\n')
    return Robot(toml, box, (4.0, 90.0), hammer)


ARMS: dict[str, Callable[[Path, np.random.Generator], Robot]] = {
    "kr10": lambda folder, rng: known("kr10", folder, rng),
    "irb6640": lambda folder, rng: known("irb6640", folder, rng),
    "arm of four": _pointed,
    "kr240 plane": _shipped,
    "kr210": lambda folder, rng: known("kr210", folder, rng),
}


def scattered(rng: np.random.Generator) -> InjectedFaults:
    """Nothing but the scatter of springs and inertias."""
    return InjectedFaults(replace(SCATTER, seed=int(rng.integers(2**31))))


def added(
    injected: InjectedFaults, kind: str, size: float, robot: Robot, rng: np.random.Generator
) -> InjectedFaults:
    """One thing more that the simulation lacks."""
    root = urdf_of(robot.toml)[1]
    truth = load_truth(robot.toml, injected.deviation)
    damping_s = float(np.median([s.damping / s.stiffness for s in truth.springs]))
    links = links_moved(root, truth.joint_names)
    if kind == "soft base":
        first = truth.stiffness(truth.joint_names[1]) * log_uniform(rng, 0.7, 4.0) / size
        tilts = first, first * log_uniform(rng, 0.7, 1.4)
        injected = deviate(injected, extra=soft_floor(*tilts, damping_s))
    elif kind == "bending link":
        able = [n for n, link in links.items() if np.linalg.norm(beam_end(link, root)) > BENDS_M]
        joint = str(rng.choice(able[: len(able) - 1] or able))
        first = truth.stiffness(joint) * log_uniform(rng, 0.4, 2.0) / size
        bending = first, first * log_uniform(rng, 0.7, 1.4)
        twist = first * log_uniform(rng, 0.5, 3.0)
        injected = deviate(injected, beams=[BentLink(links[joint], bending, twist, damping_s)])
    elif kind == "hose":
        link = str(rng.choice(list(links.values())[1:]))
        moving = mass_that_moves(root)
        low, *_, high = truth.modes(np.mean([truth.lower_rad, truth.upper_rad], axis=0), 4)[0]
        small = AttachedResonator(
            link, triple(rng.uniform(0.3, 1.0) * beam_end(link, root)), triple(some_direction(rng)),
            size * moving * log_uniform(rng, 0.01, 0.05), log_uniform(rng, 0.9 * low, 1.1 * high),
            log_uniform(rng, 0.01, 0.05),
        )  # fmt: skip
        injected = deviate(injected, resonators=[small])
    return injected


def urdf_of(robot_toml: Path) -> tuple[Path, ElementTree.Element]:
    """Where the URDF of a robot.toml lies, and its root."""
    path = robot_toml.parent / tomllib.loads(robot_toml.read_text())["urdf"]
    return path, ElementTree.parse(path).getroot()


def mass_that_moves(root: ElementTree.Element) -> float:
    """Of all links but the one that stands on the floor, in kg."""
    carried = {child.get("link") for child in root.iterfind("joint/child")}
    moving = [link for link in root.findall("link") if link.get("name") in carried]
    return sum(float(m.get("value", 0)) for link in moving for m in link.iterfind("inertial/mass"))


def links_moved(root: ElementTree.Element, joints: tuple[str, ...]) -> dict[str, str]:
    """The link that each joint moves."""
    found = {j.get("name", ""): j.find("child") for j in root.findall("joint")}
    return {name: str(found[name].get("link")) for name in joints}
