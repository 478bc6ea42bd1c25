"""Checks of a URDF's links: masses, centres of mass and moments that no such body has."""

import numpy as np

from planner.check.remark import CheckRemark, Severity
from planner.robot.link_bodies import LinkBody, guessed_masses
from planner.robot.robot import Robot

# Limits by which units are told; chosen between robots from 5 to 1,500 kg and a factor of 1000.
HEAVIEST_KG, LIGHTEST_KG = 2e4, 0.002
GYRATION = 0.02, 1.2  # radius of gyration over the size of a link; a ball of that size has 0.18
SMALL = 0.25  # of the size of what it is fixed to: less is a marker's, or weighs next to nothing
SMALLEST_SIZE_M = 0.02  # smaller links tell nothing
OUTSIDE = 0.5  # of its size may a centre of mass lie outside the box around a link
LONGEST_REACH_M, SHORTEST_REACH_M, NEVER_M = 12.0, 0.1, 100.0


def check_links(robot: Robot, links: tuple[LinkBody, ...]) -> list[CheckRemark]:
    """What looks wrong in the links of a robot."""
    found, guessed = _lengths(robot), guessed_masses(links)
    if guessed:
        remedy = "Put in what is known, or let recordings narrow it."
        found.append(CheckRemark("note", guessed, f"{robot.path.name}, [[link]]", remedy))
    for link in links:
        if link.joint:
            turned = sum(other.mass for other in links if other.joint == link.joint)
            found += _body(robot, link, turned) if link.mass else _stated(robot, link, links)
    return found


def _where(robot: Robot, link: LinkBody) -> str:
    return f"{robot.urdf_path.name}, link {link.name}"


def _lengths(robot: Robot) -> list[CheckRemark]:
    reach, where = robot.arm_m, f"{robot.urdf_path.name}, joint origins"
    if SHORTEST_REACH_M <= reach <= LONGEST_REACH_M:
        return []
    unit = "millimetres" if reach > LONGEST_REACH_M else "another unit"
    return [
        CheckRemark(
            "error" if reach > NEVER_M else "warning",
            f"The tool reaches {reach:.4g} m from the first joint, as if lengths were in {unit}.",
            where,
            "A URDF's lengths are in m.",
        )
    ]


def _stated(robot: Robot, link: LinkBody, links: tuple[LinkBody, ...]) -> list[CheckRemark]:
    """A link without a mass: a frame may be one, a part of the arm may not."""
    turned = [other for other in links if other.joint == link.joint]
    whole = any(other.mass > 0 for other in turned)
    if link.first and not whole:
        what = "an <inertial> of mass 0" if link.stated else "no <inertial>"
        text = f"What {link.joint} turns has no mass: {what}, here or on what is fixed to it"
        if any(block.joint == link.joint for block in robot.config.compliance):
            text = f"{text}, though [[compliance]] lets {link.joint} swing"
            return [_weightless(robot, link, text, "error")]
    elif (link.shapes or link.visuals) and link.size_m > SMALL * _largest_weighed(turned):
        what = "an <inertial> of mass 0" if link.stated else "no <inertial>"
        text = f"It has shapes but {what}, so that the simulation takes it for weightless"
    else:
        return []
    return [_weightless(robot, link, text, "warning")]


def _largest_weighed(turned: list[LinkBody]) -> float:
    """Size in m of the largest link that has a mass."""
    return max((other.size_m for other in turned if other.mass > 0), default=0.0)


def _weightless(robot: Robot, link: LinkBody, text: str, severity: Severity) -> CheckRemark:
    return CheckRemark(
        severity,
        f"{text}: simulated frequencies come out too high.",
        _where(robot, link),
        "Add its mass (kg), centre of mass (m) and moments of inertia (kg·m²), there or in "
        "robot.toml's [[link]]; planner new --urdf guesses them.",
    )


def _body(robot: Robot, link: LinkBody, turned: float) -> list[CheckRemark]:
    """A link with a mass; all that turns with it weighs `turned`."""
    found, where = [], _where(robot, link)
    if link.mass > HEAVIEST_KG or turned < LIGHTEST_KG:
        text = f"It has a mass of {link.mass:,.4g} kg."
        if link.mass > HEAVIEST_KG:
            text = f"It has a mass of {link.mass:,.0f} kg, {link.mass / 1000:.3g} t."
        remedy = "Masses are in kg, neither in g nor in t."
        found.append(CheckRemark("warning", text, where, remedy))
    low, mid, high = link.moments
    if low + mid < high * (1 - 1e-6) - 1e-12:
        text = (
            f"No body has principal moments of {low:.3g}, {mid:.3g} and {high:.3g} kg·m²: "
            f"each is at most the sum of the two others."
        )
        found.append(CheckRemark("warning", text, where, "Correct <inertia>."))
    if high == 0:
        text = f"Its {link.mass:.4g} kg have no moments of inertia, as if they were in one point."
        found.append(CheckRemark("warning", text, where, "State ixx, iyy, izz in kg·m²."))
    else:
        found += _gyration(robot, link, where)
    return found + _centre(robot, link, where)


def _largest_m(robot: Robot, link: LinkBody) -> float:
    """How large a link may be: half as large as the arm where no shape tells its size."""
    told = link.whole and link.size_m > SMALLEST_SIZE_M
    return link.size_m if told else max(link.size_m, 0.5 * robot.reach_m)


def _gyration(robot: Robot, link: LinkBody, where: str) -> list[CheckRemark]:
    """How far from its centre of mass the mass would have to be."""
    gyration = float(np.sqrt(link.moments[2] / link.mass))
    largest = _largest_m(robot, link)
    least, most = GYRATION[0] * link.size_m, GYRATION[1] * largest
    if least <= gyration <= most:
        return []
    word = "far outside" if gyration > most else "at the middle of"
    return [
        CheckRemark(
            "warning",
            f"Its largest moment of inertia, {link.moments[2]:.3g} kg·m², puts its "
            f"{link.mass:.4g} kg at {gyration:.3g} m from their centre, {word} a link of "
            f"{link.size_m if least > gyration else largest:.2g} m.",
            where,
            "Moments are in kg·m² about the centre of mass, neither in kg·mm² nor about the joint.",
        )
    ]


def _centre(robot: Robot, link: LinkBody, where: str) -> list[CheckRemark]:
    size = _largest_m(robot, link)
    over = np.maximum(link.low_m - link.com_m, link.com_m - link.high_m).max()
    if over <= OUTSIDE * size:
        return []
    place = ", ".join(f"{v:.4g}" for v in link.com_m)
    return [
        CheckRemark(
            "warning",
            f"Its centre of mass, ({place}) m, lies {over:.3g} m outside the link.",
            where,
            "It is given in m, in the link's own frame.",
        )
    ]
