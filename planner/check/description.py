"""Checks of what a URDF and robot.toml state of links, joints and frames; what a check finds."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from planner.robot.link_bodies import LinkBody, guessed_masses
from planner.robot.robot import Robot

Severity = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = "error", "warning", "note"  # worst first


@dataclass(frozen=True)
class CheckRemark:
    """An error stops a campaign, a warning is most likely a mistake, a note is for information.

    `what` is a whole sentence, `where` a file and entry, `remedy` what to do, a sentence too.
    """

    severity: Severity
    what: str
    where: str
    remedy: str = ""

    @property
    def sentence(self) -> str:
        """All of it in one line."""
        return f"{self.where}: {self.what} {self.remedy}".rstrip()


# Limits by which units are told; chosen between robots from 5 to 1,500 kg and a factor of 1000.
HEAVIEST_KG, LIGHTEST_KG = 2e4, 0.002
GYRATION = 0.02, 1.2  # radius of gyration over the size of a link; a ball of that size has 0.18
SMALL = 0.25  # of the size of what it is fixed to: less is a marker's, or weighs next to nothing
SMALLEST_SIZE_M = 0.02  # smaller links tell nothing
OUTSIDE = 0.5  # of its size may a centre of mass lie outside the box around a link
LONGEST_REACH_M, SHORTEST_REACH_M, NEVER_M = 12.0, 0.1, 100.0


def check_links(robot: Robot, links: tuple[LinkBody, ...]) -> Iterator[CheckRemark]:
    """What looks wrong in the links of a robot."""
    reach, guessed = robot.arm_m, guessed_masses(links)
    if not SHORTEST_REACH_M <= reach <= LONGEST_REACH_M:
        unit = "millimetres" if reach > LONGEST_REACH_M else "another unit"
        text = f"The tool reaches {reach:.4g} m from the first joint, as if lengths were in {unit}."
        where = f"{robot.urdf_path.name}, joint origins"
        severity = "error" if reach > NEVER_M else "warning"
        yield CheckRemark(severity, text, where, "A URDF's lengths are in m.")
    if guessed:
        remedy = "Put in what is known, or let recordings narrow it."
        yield CheckRemark("note", guessed, f"{robot.path.name}, [[link]]", remedy)
    for link in links:
        if link.joint:
            turned = [other for other in links if other.joint == link.joint]
            where = f"{robot.urdf_path.name}, link {link.name}"
            yield from (_body if link.mass else _without_mass)(robot, link, turned, where)


def _without_mass(
    robot: Robot, link: LinkBody, turned: list[LinkBody], where: str
) -> Iterator[CheckRemark]:
    """A frame may be without a mass, a part of the arm may not."""
    weighed, severity = [other.size_m for other in turned if other.mass > 0], "warning"
    what = "an <inertial> of mass 0" if link.stated else "no <inertial>"
    if link.first and not weighed:
        text = f"What {link.joint} turns has no mass: {what}, here or on what is fixed to it"
        if any(block.joint == link.joint for block in robot.config.compliance):
            text = f"{text}, though [[compliance]] lets {link.joint} swing"
            severity = "error"
    elif (link.shapes or link.visuals) and link.size_m > SMALL * max(weighed, default=0.0):
        text = f"It has shapes but {what}, so that the simulation takes it for weightless"
    else:
        return
    remedy = (
        "Add its mass (kg), centre of mass (m) and moments of inertia (kg·m²), there or in "
        "robot.toml's [[link]]; planner new --urdf guesses them."
    )
    yield CheckRemark(severity, f"{text}: simulated frequencies come out too high.", where, remedy)


def _body(
    robot: Robot, link: LinkBody, turned: list[LinkBody], where: str
) -> Iterator[CheckRemark]:
    """A link with a mass, and all that turns with it."""
    if link.mass > HEAVIEST_KG or sum(other.mass for other in turned) < LIGHTEST_KG:
        text = f"It has a mass of {link.mass:,.4g} kg."
        if link.mass > HEAVIEST_KG:
            text = f"It has a mass of {link.mass:,.0f} kg, {link.mass / 1000:.3g} t."
        yield CheckRemark("warning", text, where, "Masses are in kg, neither in g nor in t.")
    low, mid, high = link.moments
    if low + mid < high * (1 - 1e-6) - 1e-12:
        text = (
            f"No body has principal moments of {low:.3g}, {mid:.3g} and {high:.3g} kg·m²: "
            f"each is at most the sum of the two others."
        )
        yield CheckRemark("warning", text, where, "Correct <inertia>.")
    # How large a link may be: half as large as the arm where no shape tells its size.
    told = link.whole and link.size_m > SMALLEST_SIZE_M
    largest = link.size_m if told else max(link.size_m, 0.5 * robot.reach_m)
    if high == 0:
        text = f"Its {link.mass:.4g} kg have no moments of inertia, as if they were in one point."
        yield CheckRemark("warning", text, where, "State ixx, iyy, izz in kg·m².")
    else:
        yield from _gyration(link, largest, where)
    over = np.maximum(link.low_m - link.com_m, link.com_m - link.high_m).max()
    if over > OUTSIDE * largest:
        place = ", ".join(f"{v:.4g}" for v in link.com_m)
        text = f"Its centre of mass, ({place}) m, lies {over:.3g} m outside the link."
        yield CheckRemark("warning", text, where, "It is given in m, in the link's own frame.")


def _gyration(link: LinkBody, largest: float, where: str) -> Iterator[CheckRemark]:
    """How far from its centre of mass the mass would have to be."""
    gyration = float(np.sqrt(link.moments[2] / link.mass))
    least, most = GYRATION[0] * link.size_m, GYRATION[1] * largest
    if not least <= gyration <= most:
        word = "far outside" if gyration > most else "at the middle of"
        text = (
            f"Its largest moment of inertia, {link.moments[2]:.3g} kg·m², puts its "
            f"{link.mass:.4g} kg at {gyration:.3g} m from their centre, {word} a link of "
            f"{link.size_m if least > gyration else largest:.2g} m."
        )
        remedy = (
            "Moments are in kg·m² about the centre of mass, neither in kg·mm² nor about the joint."
        )
        yield CheckRemark("warning", text, where, remedy)


WIDEST_RAD = 20.0  # of a limit: three turns; 360 rad are 57
NEVER_RAD = 20 * np.pi  # ten turns to a side
FASTEST_RAD_S = 50.0  # hands of the fastest reach 42; heavy arms' slowest joints have 60°/s
LONGEST_M, FASTEST_M_S = 100.0, 10.0  # of a rail; in mm both are a thousand times as much
PARALLEL_DEG = 1.0
APART_M = 0.6  # between where the hammer hits and where the sensor sits
EARTH_M_S2 = 9.81


def check_joints(robot: Robot, planned: bool = False) -> Iterator[CheckRemark]:
    """What looks wrong in limits (rad, m of those that slide) and speeds (rad/s, m/s).

    With a workspace `planned` it is an error where no such joint can be: the limits keep nobody
    from driving there.
    """
    rows = zip(
        robot.joint_names, robot.lower_rad, robot.upper_rad, robot.velocity_rad_s, strict=True
    )
    for name, low, high, speed in rows:
        where, slides = f"{robot.urdf_path.name}, joint {name}", robot.slides(name)
        wrong = (_shifts if slides else _turns)(float(low), float(high), float(speed))
        away = max(abs(low), abs(high))
        never = planned and not slides and NEVER_RAD < away < np.inf
        for text, remedy in wrong:
            yield CheckRemark("error" if never else "warning", text, where, remedy)
        if not 0 < speed < np.inf:
            text = "It has no speed limit: what it takes to get to a pose cannot be told."
            unit = "m/s" if slides else "rad/s"
            yield CheckRemark("note", text, where, f"Add velocity in {unit} to <limit>.")
    linkage = robot.linkage
    following = sorted(set(range(len(linkage.names))) - set(linkage.leads))
    leader = {k: robot.joint_names[int(np.flatnonzero(linkage.spread[k])[0])] for k in following}
    if following:
        said = "; ".join(f"{linkage.names[k]} follows {leader[k]}" for k in following)
        text = f"{said}: never listed among the joints, and within their limits wherever these are."
        yield CheckRemark("note", text, f"{robot.urdf_path.name}, <mimic>")


def _turns(low: float, high: float, speed: float) -> Iterator[tuple[str, str]]:
    """What looks wrong, and its remedy, in limits (rad) and speed (rad/s)."""
    if max(abs(low), abs(high)) > WIDEST_RAD:
        turns = (high - low) / 2 / np.pi
        text = f"Its limits are {low:.4g} and {high:.4g} rad, {turns:.0f} turns apart."
        yield text, "A URDF's limits are in rad: 360 degrees are 6.283."
    if FASTEST_RAD_S < speed < np.inf:
        text = f"Its speed limit is {speed:.4g} rad/s, {speed / 2 / np.pi:.0f} turns a second."
        yield text, "A URDF's speeds are in rad/s, not in degrees a second."


def _shifts(low: float, high: float, speed: float) -> Iterator[tuple[str, str]]:
    """The same of a joint that slides: limits (m) and speed (m/s)."""
    if max(abs(low), abs(high)) > LONGEST_M:
        text = f"It slides from {low:.4g} to {high:.4g} m, as if its limits were in millimetres."
        yield text, "Limits of a prismatic joint are in m."
    if FASTEST_M_S < speed < np.inf:
        remedy = "Speeds of prismatic joints are in m/s, not in millimetres a second."
        yield f"Its speed limit is {speed:.4g} m/s.", remedy


def check_frames(robot: Robot) -> Iterator[CheckRemark]:
    """What looks wrong in the frames of tool and sensor, and in gravity."""
    config, where = robot.config, f"{robot.path.name}, sensor_frame"
    tcp, sensor = robot.model.frames[robot.tcp_id], robot.model.frames[robot.sensor_id]
    if tcp.parentJoint != sensor.parentJoint:
        text = (
            f'The sensor frame "{config.sensor_frame}" and the tcp frame "{config.tcp_frame}" '
            f"turn with different joints."
        )
        remedy = "Put the sensor beside the hit point unless it really sits there."
        yield CheckRemark("warning", text, where, remedy)
    else:
        between = tcp.placement.actInv(sensor.placement)
        angle = np.rad2deg(np.arccos(np.clip((np.trace(between.rotation) - 1) / 2, -1, 1)))
        if angle > PARALLEL_DEG:
            text = (
                f"The sensor frame is turned by {angle:.1f}° against the tcp frame; recordings "
                f"are read as if the two were parallel."
            )
            remedy = "Give both the same rpy, and turn the sensor's channels when recording."
            yield CheckRemark("warning", text, where, remedy)
        apart = float(np.linalg.norm(between.translation))
        if apart > APART_M:
            text = f"The sensor sits {apart:.3g} m from where the hammer hits."
            yield CheckRemark("warning", text, where, "Lengths are in m.")
    yield from _gravity(np.array(config.gravity), f"{robot.path.name}, gravity")


def _gravity(gravity: np.ndarray, where: str) -> Iterator[CheckRemark]:
    size = float(np.linalg.norm(gravity))
    remedy = "If it stands on the floor, give [0, 0, -9.81]."
    if abs(size / EARTH_M_S2 - 1) > 0.01:
        text = f"Gravity is {size:.4g} m/s²."
        yield CheckRemark("warning", text, where, "On Earth it is 9.81 m/s².")
    elif gravity[2] > 0.999 * size:
        text = "Gravity points up along the base's z axis: the robot hangs from a ceiling."
        yield CheckRemark("warning", text, where, remedy)
    elif gravity[2] > -0.999 * size:
        direction = ", ".join(f"{v:.2f}" for v in gravity / size)
        text = f"Gravity points along ({direction}) of the base: robot on a wall or a slope."
        yield CheckRemark("note", text, where, remedy)
