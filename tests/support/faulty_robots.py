"""Five robots for everyday campaigns, and what their simulations lack: of any size, drawn once."""

import tomllib
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from shutil import copytree

import numpy as np

from planner.demo import shipped
from planner.proof import descriptions
from planner.proof.arms import in_a_cell
from planner.proof.cases import SCATTER
from planner.proof.deviation import AttachedResonator, BentLink, soft_floor
from planner.proof.fault_injection import InjectedFaults
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.proof.scene import PULSE_S, deviate, log_uniform, some_direction, triple
from planner.proof.springs import beam_end
from tests.support.arm_with_points import NODES, write_arm
from tests.support.outside import HAMMER

KINDS = "nothing", "soft base", "bending link", "hose"
SIZES = 0.01, 1.0  # of what is lacking, 1 being large: log-uniform, drawn once
MOST_MODES = 4  # that are counted
BENDS_M = 0.15  # least length of a link that bends
TCP_NODE = 17


@dataclass(frozen=True)
class Robot:
    """Files of a robot, its workspace as text of campaign.toml, band (Hz), and who hits it.

    `nodes` are the analyser's numbers of the points.
    """

    toml: Path
    workspace: str
    band_hz: tuple[float, float]
    hammer: Hammer
    nodes: Mapping[str, int] = field(default_factory=dict)


def known(name: str, folder: Path, rng: np.random.Generator) -> Robot:
    arm = in_a_cell(name)
    toml = arm.write(folder / "robot", int(rng.choice([1, 3])))
    rate = 1000.0 if name == "kr10" else 400.0
    hammer = Hammer(arm.peak_n, PULSE_S * 400 / rate, rate, record_s=1024 / rate)
    return Robot(toml, f"joints_deg = {[list(r) for r in arm.joints_deg]}", arm.band_hz, hammer)


def _shipped(folder: Path, _: np.random.Generator) -> Robot:
    """The plane of the shipped campaign."""
    copytree(shipped("kr240_plane") / "robot", folder / "robot")
    table = tomllib.loads((shipped("kr240_plane") / "campaign.toml").read_text())
    text = "\n".join(f"{key} = {value}" for key, value in table["workspace"].items())
    return Robot(folder / "robot" / "robot.toml", text, (4.0, 60.0), Hammer())


def _pointed(folder: Path, _: np.random.Generator) -> Robot:
    box = [[-60, 60], [-40, 30], [20, 100], [-50, 50]]
    hammer = Hammer(250.0, 0.005, 512.0, record_s=2.0)
    toml = write_arm(folder / "robot", f'\n[[point]]\nname = "tcp"\nnode = {TCP_NODE}\n')
    return Robot(toml, f"joints_deg = {box}", (4.0, 90.0), hammer, {**NODES, "tcp": TCP_NODE})


DRAWN_HZ = (3.0, 60.0)
DRAWN_AXES = ((0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0))
DRAWN_DEG = [[-60, 60], [-80, -10], [10, 90], [-90, 90], [-60, 60]]


def _drawn(folder: Path, rng: np.random.Generator) -> Robot:
    """An arm of five joints that was drawn for this campaign alone, without meshes."""
    rng = np.random.default_rng(int(rng.integers(2**31)))
    urdf = _drawn_urdf(rng)
    lines = descriptions.head("generated", "arm.urdf", "tcp", "tcp", DRAWN_HZ)
    for number, axis in enumerate(DRAWN_AXES, 1):
        stiffness = log_uniform(rng, 2e4, 8e4) / (5 if number > 3 else 1)
        lines.append(descriptions.compliance(f"joint_{number}", axis, stiffness, 4e-4))
    toml = descriptions.write_robot(folder / "robot", "arm.urdf", urdf, lines)
    return Robot(toml, f"joints_deg = {DRAWN_DEG}", DRAWN_HZ, HAMMER)


def _drawn_urdf(rng: np.random.Generator) -> str:
    masses = np.sort(rng.uniform(1.5, 12.0, len(DRAWN_AXES)))[::-1]
    parts = [descriptions.link("link_0")]
    for i, (mass, axis) in enumerate(zip(masses, DRAWN_AXES, strict=True), 1):
        x, z = (0.0, 0.25) if i == 1 else (rng.uniform(0, 0.12), rng.uniform(0.05, 0.2))
        if i > 2:
            x, z = rng.uniform(0.25, 0.5), rng.uniform(-0.03, 0.03)
        centre = np.round([rng.uniform(0.08, 0.2), *rng.uniform(-0.03, 0.03, 2)], 3)
        moments = np.round(mass * np.array([0.008, 0.02, 0.02]), 5)
        names, place = (f"joint_{i}", f"link_{i - 1}", f"link_{i}"), np.round((x, 0, z), 3)
        inertial = descriptions.inertial(np.round(mass, 3), centre, moments)
        parts.append(descriptions.link(f"link_{i}", inertial))
        parts.append(descriptions.joint(*names, place, axis, (-2.9, 2.9)))
    parts.append(descriptions.frame("tcp", f"link_{len(masses)}", (0.18, 0.03, 0.05)))
    return descriptions.urdf("generated", parts)


ROBOTS: dict[str, Callable[[Path, np.random.Generator], Robot]] = {
    "kr240 plane": _shipped,
    "kr10": lambda folder, rng: known("kr10", folder, rng),
    "irb6640": lambda folder, rng: known("irb6640", folder, rng),
    "arm of four": _pointed,
    "drawn arm": _drawn,
}


def lacking(kind: str, robot: Robot, rng: np.random.Generator) -> tuple[InjectedFaults, float]:
    """What the simulation lacks, beside the scatter of springs and inertias, and its size."""
    injected, size = scattered(rng), log_uniform(rng, *SIZES)
    return added(injected, kind, size, robot, rng), size


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
