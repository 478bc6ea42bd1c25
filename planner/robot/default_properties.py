"""Masses and springs of a robot whose maker states none.

Masses go by the size of its parts, so that they add up. A gear is chosen by the torque that it
carries, and gives by about a milliradian under that, whoever makes it: cycloidal and strain wave
gears of 50 to 3,000 N·m rated torque are between 0.9 and 1.1 mrad (rated torque over torsional
stiffness, as their catalogues state both).
"""

from collections.abc import Mapping

import coal
import msgspec
import numpy as np
import pinocchio as pin

from planner.robot.config import Compliance, LinkTable
from planner.robot.elastic_model import ElasticModel
from planner.robot.link_bodies import BodyShape, bodies
from planner.robot.robot import Robot
from planner.robot.shapes import shapes_of
from planner.robot.urdf_elements import link_inertia

# Small parts are denser, gears and bearings to their covers: mass goes with volume to this power.
# Fitted to 82 published robots whose makers state inertias (6 to 7 joints, 3 to 1,700 kg), by whose
# convex hulls links 1 to 5 then come out within 26 to 36 % (rms of the logarithm).
DENSER = 0.8
SD_PERCENT = 30.0
# Of bodies without shapes: cube root of volume over the arm's length, where what is left of the arm
# beyond its joint is b of that. Medians of 203 published robots' hulls: 0.18, 0.18, 0.15, 0.12,
# 0.08, 0.03 for b = 1, 0.91, 0.52, 0.35, 0.07, 0.
LEAST, MORE = 0.04, 0.15
SAME = 0.6  # two sds: stated masses that differ from the guess by more are no masses
# So many times off what is usual at its place no body is: a mass that a maker put in for none, a
# shape that is only part of a flange. Stated masses scatter by a factor of 1.4 at links 1 to 5, of
# 2.5 at flanges.
NO_BODY = 20.0


def total_stated(robot: Robot) -> float:
    """What the URDF's <inertial>s add up to, in kg."""
    return sum(link_inertia(link).mass for link in robot.links.values())


def nothing_stated(robot: Robot) -> bool:
    """Whether no joint moves anything with a mass."""
    return not any(inertia.mass > 0 for inertia in list(robot.model.inertias)[1:])


def default_inertias(robot: Robot, mass_kg: float | None) -> tuple[LinkTable, ...]:
    """[[link]] tables for all links of bodies without a mass; none where all have one.

    `mass_kg` is the robot's. Stated masses that cannot be true beside it (placeholders) are
    guessed as well. Without it what is stated tells the density; there must be something then.
    """
    parts, weights = _parts(robot), {}
    stated = [float(inertia.mass) for inertia in robot.model.inertias]
    for number, solids in parts.items():
        weights[number] = sum(float(s.mass) for s in solids.values()) ** DENSER
    known = _believed(weights, stated, mass_kg)
    if mass_kg is not None and known:
        share = sum(weights[n] for n in known) / sum(weights.values())
        told = sum(stated[n] for n in known)
        # Of these bodies, or of the whole robot: a base that does not move need not state its own.
        if all(abs(told / mass - 1) > SAME for mass in (share * mass_kg, mass_kg)):
            known = set()
    open_ = [n for n in parts if n not in known]
    if not open_:
        return ()
    told, weight = sum(stated[n] for n in known), sum(weights[n] for n in known)
    if mass_kg is not None and mass_kg > told:
        density = (mass_kg - told) / (sum(weights.values()) - weight)
    else:
        density = told / weight
    tables = []
    for number in open_:
        whole = sum(float(s.mass) for s in parts[number].values())
        for link, solid in parts[number].items():
            mass = density * weights[number] * float(solid.mass) / whole
            tables.append(_table(link, solid, mass))
    return tuple(tables)


def _believed(weights: Mapping[int, float], stated: list[float], mass_kg: float | None) -> set[int]:
    """Bodies whose stated mass may be theirs, beside the robot's or that of the other bodies."""
    some = {n: stated[n] / weights[n] for n in weights if stated[n] > 0}
    if not some:
        return set()
    usual = mass_kg / sum(weights.values()) if mass_kg else float(np.median(list(some.values())))
    return {n for n, density in some.items() if 1 / NO_BODY < density / usual < NO_BODY}


def _parts(robot: Robot) -> dict[int, dict[str, pin.Inertia]]:
    """By body, counted from the base: solids of its links, or one of its usual size."""
    solids, found = link_solids(robot), {}
    for number, body in enumerate(bodies(robot)):
        own = {link: solids[link] for link in body.links if link in solids}
        usual = _usual(robot, number, body)
        whole = sum(float(solid.mass) for solid in own.values()) > usual.mass / NO_BODY
        found[number] = own if whole else {body.link: usual}
    return found


def _usual(robot: Robot, number: int, body: BodyShape) -> pin.Inertia:
    """A cylinder from a body's joint to what it carries, as large as such bodies are."""
    arm = robot.arm_m or 1.0
    beyond = min(robot.beyond_m(number) / arm, 1.0)
    volume = ((LEAST + MORE * np.sqrt(beyond)) * arm) ** 3
    end = body.ends_m[np.argmax(np.linalg.norm(body.ends_m, axis=1))]
    length = max(float(np.linalg.norm(end)), float(volume) ** (1 / 3))
    cylinder = pin.Inertia.FromCylinder(volume, np.sqrt(volume / np.pi / length), length)
    along = end / np.linalg.norm(end) if np.any(end) else np.array([0.0, 0.0, 1.0])
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along).toRotationMatrix()
    return pin.SE3(turn, np.asarray(end) / 2).act(cylinder)


def _table(link: str, solid: pin.Inertia, mass: float) -> LinkTable:
    """A solid of any density as a [[link]] of `mass` in kg, in numbers as they are written."""
    moments = solid.inertia * (mass / solid.mass)
    x, y, z = (round(float(v), 4) for v in solid.lever)
    xx, xy, xz, yy, yz, zz = (float(f"{v:.4g}") for v in moments[np.triu_indices(3)])
    mass, moments = float(f"{mass:.4g}"), (xx, xy, xz, yy, yz, zz)
    return LinkTable(link, mass, (x, y, z), moments, SD_PERCENT, guessed=True)


def link_solids(robot: Robot) -> dict[str, pin.Inertia]:
    """Inertia of each link at a density of 1 kg/m³, in its own frame; links without shapes lack.

    Of collision shapes, or of visual ones where a link has no others. Of a mesh its convex hull is
    filled: hardly any published mesh closes, and volumes of those that do not mean nothing.
    """
    found: dict[str, pin.Inertia] = {}
    for name, link in robot.links.items():
        for kind in ("collision", "visual"):  # which are large, and read where needed alone
            each = [(place, _solid(shape)) for place, shape in shapes_of(link, kind)]
            solids = [place.act(solid) for place, solid in each if solid is not None]
            if solids:
                found[name] = sum(solids[1:], solids[0])
                break
    return found


def _solid(shape: coal.CollisionGeometry) -> pin.Inertia | None:
    """Of one shape in its own frame; None where it has no volume."""
    if isinstance(shape, coal.BVHModelBase):
        return hull_solid(np.array(shape.vertices()))
    volume = shape.computeVolume()
    if not volume > 0:
        return None
    return pin.Inertia(volume, shape.computeCOM(), shape.computeMomentofInertiaRelatedToCOM())


def hull_solid(points: np.ndarray) -> pin.Inertia | None:
    """The convex hull of points (n, 3) in m, filled with 1 kg/m³; None where it is flat."""
    from scipy.spatial import ConvexHull, QhullError  # 0.2 s

    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return None
    inside = points[hull.vertices].mean(axis=0)
    # Tetrahedra from a point inside to each face: their second moments by their corners.
    corners = points[hull.simplices] - inside
    volume = np.abs(np.linalg.det(corners)) / 6
    total = volume.sum()
    sums = corners.sum(axis=1)
    centre = volume @ sums / 4 / total
    outer = np.einsum("t,tki,tkj->ij", volume, corners, corners)
    second = (outer + np.einsum("t,ti,tj->ij", volume, sums, sums)) / 20
    second -= total * np.outer(centre, centre)
    return pin.Inertia(float(total), inside + centre, np.trace(second) * np.eye(3) - second)


GIVES_RAD, GIVES_M = 1e-3, 1e-4  # under what it carries: a gear, a rail's drive
ACROSS = 3.0  # stiffness of a bearing across its axis, of the gear's; published arms have 2 to 5
SPRING_SD_PERCENT = 200.0  # e^sd of 3: another robot of the same payload may well differ by that
DAMPING_RATIO = 0.03  # of each spring alone; measured arms have 1 to 5 %
RIGID_HZ = 5e3  # alone, of what is no spring to a hammer: a bare flange on a large gear
POSES = 200  # at which the torque that a gear carries is looked for
PAYLOAD_KG_M3 = 2500.0  # payload charts have a cube of this density lie on the flange


def default_springs(robot: Robot, payload_kg: float, joints: tuple[str, ...]) -> Robot:
    """The robot with a gear spring at each of its joints, and its bearings' tilts."""
    loads = carried(robot, payload_kg)
    blocks = [
        block
        for name, axis, load in zip(robot.joint_names, robot.joint_axes, loads, strict=True)
        if name in joints
        for block in _springs(robot, name, axis, float(load))
    ]
    elastic = _with(robot, blocks)
    inertia = np.diagonal(ElasticModel(elastic).matrices(robot.middle_rad).mass[0])
    damped = [
        msgspec.structs.replace(b, damping=_rounded(2 * DAMPING_RATIO * np.sqrt(b.stiffness * i)))
        for b, i in zip(blocks, _alike(blocks, inertia), strict=True)
        if np.sqrt(b.stiffness / i) < 2 * np.pi * RIGID_HZ
    ]
    return _with(robot, damped)


def carried(robot: Robot, payload_kg: float) -> np.ndarray:
    """Largest static torque (dof,) in N·m that robot and payload put on each joint, slides: N.

    Whichever way the base is mounted, at any of a spread of poses.
    """
    model, gravity = robot.model.copy(), 9.81
    tcp = model.frames[robot.tcp_id]
    lever = (payload_kg / PAYLOAD_KG_M3) ** (1 / 3) / 2
    load = pin.Inertia(payload_kg, np.zeros(3), np.zeros((3, 3)))
    model.appendBodyToJoint(tcp.parentJoint, load, tcp.placement)
    data, rng = model.createData(), np.random.default_rng(0)
    largest = np.zeros(len(robot.joint_names))
    for _ in range(POSES):
        at = robot.linkage.at(rng.uniform(robot.lower_rad, robot.upper_rad))
        pin.centerOfMass(model, data, at, True)
        for i, axis in enumerate(robot.joint_axes):
            joint = robot.linkage.leads[i] + 1
            mass = data.mass[joint]
            moment = mass * np.linalg.norm(np.cross(axis, data.com[joint]))
            carries = i in robot.tool_joints
            torque = gravity * (moment + carries * payload_kg * lever)
            force = gravity * mass
            largest[i] = max(largest[i], force if robot.joints.slides[i] else torque)
    return largest


def _springs(robot: Robot, name: str, axis: np.ndarray, load: float) -> list[Compliance]:
    """A joint's own spring, and two across it: as stiff by guess, in truth each as it is."""
    slides = robot.slides(name)
    ways = [(axis, load / (GIVES_M if slides else GIVES_RAD))]
    if not slides:
        ways += [(way, ACROSS * load / GIVES_RAD) for way in np.linalg.svd(axis[None])[2][1:]]
    blocks = []
    for way, k in ways:
        x, y, z = (round(float(v), 9) + 0.0 for v in way)  # as they are written
        given = {"slide": slides, "stiffness_sd_percent": SPRING_SD_PERCENT}
        blocks.append(Compliance(name, (x, y, z), _rounded(k), 0.0, **given))
    return blocks


def _alike(blocks: list[Compliance], inertia: np.ndarray) -> list[float]:
    """Inertia of each spring, of a bearing's two their mean."""
    places = [(block.joint, block.stiffness) for block in blocks]
    return [float(np.mean([v for p, v in zip(places, inertia, strict=True) if p == place]))
            for place in places]  # fmt: skip


def _with(robot: Robot, blocks: list[Compliance]) -> Robot:
    return Robot.of(msgspec.structs.replace(robot.config, compliance=tuple(blocks)), robot.path)


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")
