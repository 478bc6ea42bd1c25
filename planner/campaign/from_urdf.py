"""A campaign from a maker's URDF alone: robot.toml and campaign.toml by guesses that are named."""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
import tomlkit

from planner.campaign.campaign import Campaign
from planner.campaign.store import CONFIG, ROBOT, campaign_text
from planner.check.examine import spread_poses
from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.robot.arm_chain import ArmChain, arm_chain
from planner.robot.config import Compliance, LinkTable, Obstacle, Payload, RobotConfig
from planner.robot.default_properties import (
    PAYLOAD_KG_M3,
    SAME,
    default_inertias,
    default_springs,
    nothing_stated,
    total_stated,
)
from planner.robot.link_bodies import guessed_masses, link_bodies, lowest_m, mounted
from planner.robot.robot import Robot
from planner.robot.urdf import read_tree
from planner.robot.urdf_elements import link_inertia
from planner.robot.workspace import ranges_inside, tool_direction, workspace_in_front

MODES = 4  # asked for
POSES = 12  # of the workspace, at which modes are looked for to state a band
WIDER = 0.5, 2.0  # of the lowest and highest simulated frequency: springs may be off by 3
PAYLOAD_SHARE, PAYLOAD_SD = 1 / 6, 0.5  # of the robot's mass: 1/3 to 1/9 in data sheets
TOOL_SD, DAMPING_SD = 0.3, 4.0  # relative; of dampers e^sd is 5 in identification
EXAMPLE_M = 0.25  # from flange to tool tip, in robot.toml's comment
BELOW_M = 0.01  # how far below the base the floor lies
SAME_MASS = 0.05  # relative: data sheets count cables and oil, URDFs as they like


@dataclass(frozen=True)
class Guess:
    """What was guessed: a number with its sd, or a text or list with none."""

    what: str
    value: float | str | list[list[float]]
    sd: float | None
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Guessed:
    """A robot as it was guessed, its workspace, and what the engineer has to know."""

    robot: Robot
    joints_deg: list[list[float]]
    modes: int
    guesses: tuple[Guess, ...]
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class StatedMasses:
    """What the engineer knows, in kg: the robot's mass, its rated payload, the tool's mass."""

    robot: float | None = None
    payload: float | None = None
    tool: float | None = None


def new_from_urdf(
    directory: Path, urdf: Path, weights: StatedMasses, campaign_toml: Path | None
) -> tuple[Campaign, Guessed]:
    """Begin a campaign for the arm of a URDF; raises InputError with one sentence."""
    for option, value in (
        ("--mass-kg", weights.robot), ("--payload-kg", weights.payload),
        ("--tool-mass-kg", weights.tool),
    ):  # fmt: skip
        if value is not None and not 0 < value < 1e5:
            raise InputError(f"{option} is {value:g}; give kg, above 0.")
    with tempfile.TemporaryDirectory() as folder:
        robot_toml = Path(folder).resolve() / ROBOT / "robot.toml"
        robot_toml.parent.mkdir()
        guessed = guess(urdf.absolute(), weights, robot_toml, campaign_toml is None)
        robot_toml.write_text(_robot_text(guessed), encoding="utf-8")
        own = robot_toml.parents[1] / CONFIG
        if campaign_toml is None:
            said = "In front of the arm, guessed: put it where the tool works."
            modes = {"count": guessed.modes, "band_hz": list(guessed.robot.config.band_hz)}
            text = campaign_text(said, f"{ROBOT}/robot.toml", guessed.joints_deg, modes)
            own.write_text(text, encoding="utf-8")
        try:
            campaign = Campaign.new(directory, robot_toml, campaign_toml or own)
        except InputError as error:
            raise InputError(str(error).replace(f"{robot_toml.parents[1]}/", "")) from None
    return campaign, guessed


def guess(urdf: Path, weights: StatedMasses, robot_toml: Path, planned: bool = True) -> Guessed:
    """What robot.toml and campaign.toml of an arm are to say."""
    root = read_tree(urdf)
    chain = arm_chain(root)
    if chain is None:
        raise InputError(f"{urdf} has no joint that moves; name the URDF of a robot arm.")
    name = root.get("name") or urdf.stem
    config = RobotConfig(
        name, str(urdf), chain.tcp, chain.sensor, held=chain.held, geometric_stiffness=True
    )
    robot = Robot.of(config, robot_toml)
    stated_kg = total_stated(robot)
    if weights.robot is None and nothing_stated(robot):
        raise InputError(
            f"{urdf} states no masses; give the robot's, from its data sheet, with --mass-kg."
        )
    # Far less are placeholders, or not all of its links: common. No links weigh far more.
    if weights.robot is not None and stated_kg > (1 + SAME) * weights.robot:
        raise InputError(
            f"--mass-kg is {weights.robot:g}, and the links of {robot.urdf_path} weigh "
            f"{stated_kg:.4g} kg together; give the robot's mass in kg, or leave it out to use the "
            f"URDF's masses."
        )
    links = default_inertias(robot, weights.robot)
    payload = weights.payload or PAYLOAD_SHARE * (weights.robot or stated_kg)
    carried = (_tool(chain.tcp, weights.tool, robot),) if weights.tool else ()
    floor = _floor(robot)
    config = msgspec.structs.replace(config, link=links, payload=carried, obstacle=(floor,))
    robot = default_springs(Robot.of(config, robot_toml), payload, chain.joints)
    low, high = workspace_in_front(robot) if planned else (robot.lower_rad, robot.upper_rad)
    band, modes = _band(robot, low, high)
    robot = Robot.of(msgspec.structs.replace(robot.config, band_hz=band), robot_toml)
    ranges = ranges_inside(robot, low, high, 1.0)
    guesses = tuple(_guesses(robot, chain, weights, payload, ranges if planned else None))
    remarks = (*_mass_conflict(robot, weights.robot, stated_kg), *_remarks(robot, chain, weights))
    return Guessed(robot, ranges, modes, guesses, remarks)


def _tool(tcp: str, mass: float, robot: Robot) -> Payload:
    """A cube of the tool's mass that lies on the tcp frame, on its far side from the arm."""
    side = (mass / PAYLOAD_KG_M3) ** (1 / 3)
    place = _off_the_arm(robot) * side / 2
    moment = round(mass * side**2 / 6, 5)
    x, y, z = (round(float(v), 4) + 0.0 for v in place)
    return Payload(tcp, mass, (x, y, z), (moment, 0.0, 0.0, moment, 0.0, moment))


def _off_the_arm(robot: Robot) -> np.ndarray:
    """Direction (3,) in the tcp frame in which the tool points."""
    q = robot.middle_rad
    return robot.forward(q)[0].T @ tool_direction(robot, q)


def _floor(robot: Robot) -> Obstacle:
    """A box below the lowest corner of the base, and of what its first joint moves."""
    first = robot.joint_names[min(robot.tool_joints)]
    top = min(0.0, lowest_m(robot, robot.middle_rad, ("", first))) - BELOW_M
    center = (0.0, 0.0, round(top - 0.05, 4))
    size = float(np.ceil(2 * robot.reach_m + 1))
    return Obstacle("floor", center, (size, size, 0.1))


def _band(robot: Robot, low: np.ndarray, high: np.ndarray) -> tuple[tuple[float, float], int]:
    """Where the lowest modes are expected, in Hz, and how many of them."""
    simulation = Simulation(robot)
    q = np.random.default_rng(2).uniform(low, high, (POSES, len(low)))
    found = simulation.frequencies(q, simulation.elastic.size).frequency_hz
    elsewhere = simulation.frequencies(spread_poses(robot), 1).frequency_hz
    modes = min(MODES, int(np.isfinite(found).sum(axis=1).min()))
    lowest = min(np.nanmin(found), np.nanmin(elsewhere, initial=np.inf))
    below, above = WIDER[0] * lowest, WIDER[1] * np.nanmax(found[:, :modes])
    return (float(f"{below:.2g}"), float(f"{above:.2g}")), modes


def _guesses(
    robot: Robot,
    chain: ArmChain,
    weights: StatedMasses,
    payload: float,
    ranges: list[list[float]] | None,
) -> Iterator[Guess]:
    config = robot.config
    if chain.sensor == chain.tcp:
        yield Guess("tcp_frame, where the hammer hits and the sensor sits", chain.tcp, None)
    else:
        yield Guess("tcp_frame, where the hammer hits", chain.tcp, None)
        yield Guess("sensor_frame, where the sensor sits", chain.sensor, None)
    if weights.payload is None:
        yield Guess("rated payload", round(payload, 3), round(PAYLOAD_SD * payload, 3), "kg")
    for table in config.link:
        mass = table.mass_kg or 0.0
        yield Guess(f"mass of {table.link}", mass, _part(mass, table.sd_percent), "kg")
    for body in config.payload:
        size = float(np.linalg.norm(body.com_m))
        yield Guess("tool's centre of mass beyond tcp_frame", size, TOOL_SD * size, "m")
    own, told = dict(zip(robot.joint_names, robot.joint_axes, strict=True)), set()
    for block in config.compliance:
        way = "about" if np.allclose(block.axis, own[block.joint]) else "across"
        where = f"{block.joint} {'along' if block.slide else way} its axis"
        if where in told:
            continue  # the guess is the same
        told.add(where)
        k, c = ("N/m", "N·s/m") if block.slide else ("N·m/rad", "N·m·s/rad")
        sd = _part(block.stiffness, block.stiffness_sd_percent)
        yield Guess(f"stiffness of {where}", block.stiffness, sd, k)
        yield Guess(f"damping of {where}", block.damping, DAMPING_SD * block.damping, c)
    floor = config.obstacle[0]
    yield Guess("height of the floor", round(floor.center_m[2] + floor.size_m[2] / 2, 4), None, "m")
    if ranges is not None:
        yield Guess("workspace joints_deg", ranges, None)


def _mass_conflict(robot: Robot, mass_kg: float | None, stated_kg: float) -> Iterator[str]:
    """Which masses are used where URDF and data sheet both state some, and differ."""
    if mass_kg is None or not stated_kg or abs(mass_kg / stated_kg - 1) < SAME_MASS:
        return
    guessed = [table.link for table in robot.config.link]
    stated = [link for link in robot.links.values() if link_inertia(link).mass > 0]
    name = robot.urdf_path.name
    both = f"The links of {name} weigh {stated_kg:.4g} kg together, --mass-kg says {mass_kg:g} kg: "
    if not guessed:
        yield (
            f"{both}the URDF's masses are used, because they tell the links apart. Where --mass-kg "
            f"is right, correct them in [[link]] of robot.toml."
        )
    elif len(guessed) < len(stated):
        yield (
            f"{both}the URDF's masses are used, and those of {', '.join(guessed)} are guessed: "
            f"{total_stated(robot):.4g} kg in all."
        )
    else:
        yield (
            f"{both}--mass-kg is used and shared out by size, because the URDF's masses look like "
            f"placeholders."
        )


def _part(value: float, percent: float | None) -> float:
    return float(f"{value * (percent or 0.0) / 100:.4g}")


def _remarks(robot: Robot, chain: ArmChain, weights: StatedMasses) -> Iterator[str]:
    """What the engineer has to know, and what to put right first."""
    if chain.held:
        held = ", ".join(entry.rpartition("_")[0] for entry in chain.held)
        yield (
            f"The arm is the longest chain of moving joints, {chain.joints[0]} to "
            f"{chain.joints[-1]}; {held} stay where [held] of robot.toml says."
        )
    first = f'tcp_frame = "{chain.tcp}", where the hammer hits (robot.toml says how to move it)'
    if not weights.tool and not mounted(robot, link_bodies(robot)):
        first += " and the tool ([[payload]] there, or --tool-mass-kg here)"
    asked = ["[workspace] of campaign.toml", "floor, table and fence as [[obstacle]]"]
    asked += [] if weights.payload else ["the rated payload, by which springs are guessed"]
    yield f"Put right first: {first}; then {'; '.join(asked)}."
    springs = {block.joint for block in robot.config.compliance}
    bare = [joint for joint in chain.joints if joint not in springs]
    if bare:
        yield (
            f"{', '.join(bare)} has no spring: it moves next to nothing as long as --tool-mass-kg, "
            f"or [[payload]] of robot.toml, does not say what it carries."
        )
    guessed = guessed_masses(link_bodies(robot))
    if guessed:
        yield f"{guessed} See [[link]] of robot.toml."


def _robot_text(guessed: Guessed) -> str:
    """robot.toml, with a comment on what is guessed."""
    config = guessed.robot.config
    x, y, z = (round(float(v), 4) + 0.0 for v in EXAMPLE_M * _off_the_arm(guessed.robot))
    both = ' and sensor_frame = "tcp"' if config.sensor_frame == config.tcp_frame else ""
    said = (
        "Begun by planner new --urdf: numbers here are guesses by size and payload until they are",
        "put right. First: tcp_frame and sensor_frame, the tool ([[payload]]), obstacles.",
        f"To move the tcp {EXAMPLE_M:g} m beyond {config.tcp_frame}, where a tool's tip is, write",
        f'tcp_frame = "tcp"{both} below, and at the end of this file:',
        "[[point]]", 'name = "tcp"', f'link = "{config.tcp_frame}"',
        f"position_m = [{x}, {y}, {z}]",
    )  # fmt: skip
    stated = {name: getattr(config, name) for name in ("name", "urdf", "tcp_frame", "sensor_frame")}
    stated |= {"band_hz": list(config.band_hz), "held": config.held}
    blocks = ("payload", "obstacle", "link", "compliance")
    stated |= {name: [_entries(block) for block in getattr(config, name)] for name in blocks}
    comment = "".join(f"# {line}\n" for line in said)
    return comment + tomlkit.dumps({name: value for name, value in stated.items() if value})


def _entries(block: Compliance | LinkTable | Payload | Obstacle) -> dict:
    """What robot.toml states of a block: springs that slide by their own names."""
    fields = msgspec.structs.fields(block)
    told = {f.name: v for f in fields if (v := getattr(block, f.name)) != f.default}
    if told.pop("slide", False):
        told["stiffness_n_m"] = told.pop("stiffness")
        told["damping_n_s_m"] = told.pop("damping")
    return {k: list(v) if isinstance(v, tuple) else v for k, v in told.items()}
