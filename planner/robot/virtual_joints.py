"""Virtual joints: a robot's model with one more joint for each elastic rotation or shift."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import pinocchio as pin

from planner.errors import InputError
from planner.robot.config import BASE, Payload
from planner.robot.robot import PREFIX, Robot
from planner.robot.urdf_elements import stated_inertia

SMALL = "resonator"  # and its number: a body of its own too
BETWEEN = 0.75  # share of a rod's second moment that its halves' centres have
OUTER = ", outer half"  # of a link that bends: a body of its own


@dataclass(frozen=True, eq=False)
class VirtualModel:
    """Model whose coordinates are x = rigid · q + offset + elastic · δ.

    `rigid` (n, dof) moves its joints, followers too, with those of the robot, `elastic` (n, e) with
    the elastic degrees of freedom: those of robot.toml, resonators last. `bodies` names what moves
    (joints, the base where it is elastic, the outer halves of links that bend, resonators),
    `carriers` are the joints of `model` that carry them, `frames` translates the robot's frame
    numbers.
    """

    model: pin.Model
    rigid: np.ndarray
    offset: np.ndarray
    elastic: np.ndarray
    bodies: tuple[str, ...]
    carriers: tuple[int, ...]
    # (bodies, 10) about the joints' frames: m, mx, my, mz, xx, xy, yy, xz, yz, zz, as in Pinocchio
    inertia: np.ndarray
    frames: tuple[int, ...]


def virtual_model(robot: Robot, inertia_change: np.ndarray | None = None) -> VirtualModel:
    """The virtual model; inertia_change (bodies, 10) is added to the inertias of its bodies."""
    source, model = robot.model, pin.Model()
    model.gravity = pin.Motion(np.array([*robot.config.gravity, 0.0, 0.0, 0.0]))
    last, ends, own, springs, small = _add_joints(robot, model)
    bodies: list[tuple[str, int, np.ndarray]] = []
    for joint in (joint for joint in range(source.njoints) if last[joint]):
        name, whole = (str(source.names[joint]) if joint else BASE), body_inertia(robot, joint)
        if ends[joint][0] == last[joint]:
            bodies.append((name, last[joint], whole))
        else:
            link, at = robot.link_of(name), -ends[joint][1].translation
            inner, outer = _stated_halves(robot, link, whole, at) or _halves(whole, at)
            half = link + OUTER
            bodies += [(name, last[joint], inner), (half, ends[joint][0], outer)]
    for number, block in enumerate(robot.config.resonator):
        mass = np.array([block.mass, *np.zeros(9)])
        bodies.append((f"{SMALL} {number + 1}", small[number], mass))
        springs = np.append(springs, model.joints[small[number]].idx_q)
    names, carriers, each = zip(*bodies, strict=True)
    inertia = np.array(each)
    if inertia_change is not None:
        inertia = inertia + inertia_change
    for carrier, values in zip(carriers, inertia, strict=True):
        model.appendBodyToJoint(carrier, _body(values), pin.SE3.Identity())
    frames = tuple(model.addFrame(_carried(f, last, ends)) for f in source.frames)
    rigid, offset = np.zeros((model.nq, len(robot.joint_names))), np.zeros(model.nq)
    rigid[own], offset[own] = robot.linkage.spread, robot.linkage.offset
    elastic = _elastic(robot, own, springs, model.nq)
    return VirtualModel(model, rigid, offset, elastic, names, carriers, inertia, frames)


def _elastic(robot: Robot, own: np.ndarray, springs: np.ndarray, size: int) -> np.ndarray:
    """(size, e): each spring moves its own joint, and what follows the joint that it sits at.

    A follower goes with what its leader gives about its axis (or along it), as if it were rigid.
    `own` are the places in x of the robot's joints, followers among them, `springs` of the springs.
    """
    linkage, moves = robot.linkage, np.zeros((size, len(springs)))
    moves[springs, np.arange(len(springs))] = 1.0
    for number, block in enumerate(robot.config.compliance):
        moves[springs[number], number] = block.lever_m or 1.0
        if block.joint in robot.joint_names and block.slide == robot.slides(block.joint):
            leader = robot.joint_names.index(block.joint)
            factors = linkage.spread[:, leader].copy()
            factors[linkage.leads[leader]] = 0.0  # the joint itself is held
            along = np.array(block.axis) @ robot.joint_axes[leader] / np.linalg.norm(block.axis)
            moves[own, number] += factors * along
        if block.height_m:
            moves[springs, number] += _shifts(robot, number)
    return moves


def _shifts(robot: Robot, number: int) -> np.ndarray:
    """(e,): how far the base's shifts go with a rotation about an axis at a height; InputError if
    it has none along that way."""
    blocks, turning = robot.config.compliance, robot.config.compliance[number]
    way = np.cross(np.array(turning.axis), np.array([0.0, 0.0, -turning.height_m]))
    way /= np.linalg.norm(turning.axis)
    out = np.zeros(len(blocks) + len(robot.config.resonator))
    for k, block in enumerate(blocks):
        if block.joint == BASE and block.slide:
            axis = np.array(block.axis) / np.linalg.norm(block.axis)
            out[k] = axis @ way
            way = way - out[k] * axis
    if np.linalg.norm(way) > 1e-9:
        raise InputError(
            f"{robot.path}: [[compliance]] number {number + 1} ({BASE}) has height_m = "
            f"{turning.height_m:g}, so the base shifts as it turns; add its [[compliance]] with "
            f"stiffness_n_m and damping_n_s_m along x and y, or leave height_m out."
        )
    return out


def _carried(frame: pin.Frame, last: list[int], ends: list[tuple[int, pin.SE3]]) -> pin.Frame:
    """A frame of the robot on what carries it: on a link that bends, points lie on either half."""
    joint, place = last[frame.parentJoint], frame.placement
    outer, back = ends[frame.parentJoint]
    half = -back.translation
    if frame.name.startswith(PREFIX) and outer != joint and place.translation @ half > half @ half:
        joint, place = outer, back * place
    return pin.Frame(frame.name, joint, 0, place, frame.type)


def _resonators(robot: Robot, model: pin.Model, joint: str, parent: int) -> dict[int, int]:
    """Numbers of the sliding joints that carry the masses that hang on a joint's body."""
    found = {}
    for number, block in enumerate(robot.config.resonator):
        if block.joint == joint:
            place = pin.SE3(np.eye(3), np.array(block.position_m, dtype=float))
            axis = np.array(block.direction, dtype=float)
            name = f"{SMALL} {number + 1}"
            found[number] = _add_joint(model, parent, axis, place, name, True)
    return found


def halves_moved(robot: Robot, link: str) -> tuple[float, np.ndarray]:
    """How far in m the centres of a link's halves are from its own, and (3, 2, 10) derivatives.

    They are those of the inner and the outer half when their centres move apart along x, y, z.
    """
    half, whole = cut_at(robot, link), body_inertia(robot, ends_of(robot, link)[0])
    inner, outer = _halves(whole, half)
    apart = float(np.linalg.norm(outer[1:4] / outer[0] + half - inner[1:4] / inner[0])) / 2
    slope = np.zeros((3, 2, 10))
    step = 1e-3 * apart  # any is exact, of numbers of second order, that leaves a possible body
    for axis, further in enumerate(step * np.eye(3) if apart > 0 else ()):
        there, back = _halves(whole, half, further), _halves(whole, half, -further)
        slope[axis] = np.subtract(there, back) / (2 * step)
    return apart, slope


def cut_at(robot: Robot, link: str) -> np.ndarray:
    """Where a link that bends is cut into halves, (3,) in m of the frame that carries it."""
    return robot.model.jointPlacements[ends_of(robot, link)[1]].translation / 2


def ends_of(robot: Robot, link: str) -> tuple[int, int]:
    """Numbers of the joints that move and that hang on a link that bends."""
    carried = robot.carries(link)
    assert carried is not None  # otherwise the link has no halves
    return carried


def _stated_halves(
    robot: Robot, link: str, whole: np.ndarray, cut: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """As `_halves` where [[link]] states the outer one, else None.

    Raises InputError where nothing that a body can have would be left for the inner one.
    """
    half = next((table.outer_half for table in robot.config.link if table.link == link), None)
    if half is None:
        return None
    stated = stated_inertia(half.mass_kg, half.centre_m, half.inertia_kg_m2)
    inner = whole - stated.toDynamicParameters()
    if np.linalg.eigvalsh(pin.PseudoInertia.FromDynamicParameters(inner).toMatrix())[0] <= 0:
        raise InputError(
            f"{robot.path}: [[link]] {link} has an outer_half that leaves no possible body of the "
            f"{whole[0]:.4g} kg of the whole link for the inner half; correct it or leave it out."
        )
    outer = pin.SE3(np.eye(3), -cut).act(stated)
    return inner, np.array(outer.toDynamicParameters())


def _halves(
    values: np.ndarray, half: np.ndarray, further: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """A body (10,) cut across the way to the next joint, at `half` (3,): (10,) inner, (10,) outer.

    The outer one is about that point. Mass, centre and moments of both together are the body's;
    they are as heavy, and their centres as far apart, as the halves of a uniform block, or by
    `further` (3,) farther. Raises InputError where the halves' moments would not be positive.
    """
    body = pin.Inertia.FromDynamicParameters(values)
    along = half / np.linalg.norm(half)
    # ∫ x xᵀ dm: three quarters of it along the way lie between the halves, whichever way it leans.
    spread = np.trace(body.inertia) / 2 * np.eye(3) - body.inertia
    length = body.mass * along @ spread @ along
    apart = np.sqrt(BETWEEN / length) * (spread @ along) if length > 0 else np.zeros(3)
    apart = apart if further is None else apart + further
    between = body.mass * (apart @ apart * np.eye(3) - np.outer(apart, apart))
    moments = (body.inertia - between) / 2
    if np.linalg.eigvalsh(moments)[0] <= 0:
        raise InputError(
            f"A link of {body.mass:.3g} kg that bends has moments of inertia that no halves "
            f"can have; correct its <inertial> in the URDF."
        )
    inner = pin.Inertia(body.mass / 2, body.lever - apart, moments)
    outer = pin.Inertia(body.mass / 2, body.lever + apart - half, moments)
    return np.array(inner.toDynamicParameters()), np.array(outer.toDynamicParameters())


def _add_joints(
    robot: Robot, model: pin.Model
) -> tuple[list[int], list[tuple[int, pin.SE3]], np.ndarray, np.ndarray, dict[int, int]]:
    """What carries each body, what hangs on it; places of the robot's joints and of the springs;
    what carries the resonators.

    Depth first, resonators before what else hangs on their body: Pinocchio's mass matrix takes the
    coordinates of a subtree for contiguous, and couples none that are not.
    """
    source, blocks = robot.model, robot.config.compliance
    last: list[int] = []  # carries the body of the same number
    ends: list[tuple[int, pin.SE3]] = []  # carries what hangs on it, and where the body is then
    rigid: list[int] = []
    small: dict[int, int] = {}
    elastic = np.zeros(len(blocks), dtype=int)

    def give(outer: int, place: pin.SE3, where: str) -> int:
        for number, block in enumerate(blocks):
            if block.joint == where:
                name = f"{where}/elastic_{number}"
                axis = np.array(block.axis, dtype=float)
                shifts = block.slide or block.lever_m > 0
                outer = _add_joint(model, outer, axis, place, name, shifts)
                elastic[number], place = model.joints[outer].idx_q, pin.SE3.Identity()
        return outer

    for joint in range(source.njoints):
        name, outer = (str(source.names[joint]) if joint else BASE), 0
        if joint:
            parent, back = ends[source.parents[joint]]
            axis, place = robot.linkage.axes[joint - 1], back * source.jointPlacements[joint]
            outer = _add_joint(model, parent, axis, place, name, robot.linkage.slides[joint - 1])
            rigid.append(model.joints[outer].idx_q)
        if joint or BASE not in robot.joint_names:
            outer = give(outer, pin.SE3.Identity(), name)
        last.append(outer)
        small |= _resonators(robot, model, name, outer)
        ends.append(_end(robot, joint, outer, give))
    return last, ends, np.array(rigid), elastic, small


def _end(
    robot: Robot, joint: int, outer: int, give: Callable[[int, pin.SE3, str], int]
) -> tuple[int, pin.SE3]:
    """What the joints beyond a body hang on: itself, or half-way to them where it bends."""
    link = robot.link_of(str(robot.model.names[joint])) if joint else ""
    bends = any(block.joint == link for block in robot.config.compliance)
    if not bends or link in robot.joint_names:
        return outer, pin.SE3.Identity()
    half = cut_at(robot, link)
    return give(outer, pin.SE3(np.eye(3), half), link), pin.SE3(np.eye(3), -half)


def _add_joint(
    model: pin.Model, parent: int, axis: np.ndarray, placement: pin.SE3, name: str, slide: bool
) -> int:
    make = pin.JointModelPrismaticUnaligned if slide else pin.JointModelRevoluteUnaligned
    return model.addJoint(parent, make(axis / np.linalg.norm(axis)), placement, name)


def _body(values: np.ndarray) -> pin.Inertia:
    if values[0] != 0:
        return pin.Inertia.FromDynamicParameters(values)
    return pin.Inertia(0.0, np.zeros(3), pin.Symmetric3(values[4:]).matrix())


def payload_inertia(block: Payload) -> pin.Inertia:
    """Of a payload in its link's frame."""
    return stated_inertia(block.mass, block.com_m, block.inertia_kg_m2)


def body_inertia(robot: Robot, joint: int) -> np.ndarray:
    """(10,) of all links that a joint carries, and of the payloads on them."""
    total = robot.model.inertias[joint]
    for block in robot.config.payload:
        frame = robot.model.frames[robot.frame_id("[[payload]] link", block.link)]
        if frame.parentJoint == joint:
            total = total + frame.placement.act(payload_inertia(block))
    return np.array(total.toDynamicParameters())


@cache
def inertia_basis() -> np.ndarray:
    """(10, 6, 6): the spatial inertia of a body is their sum weighted by its parameters.

    Linear velocities first.
    """
    # Of each parameter beside a mass of 1: Pinocchio takes no centre or moments without a mass.
    rows = np.eye(10) + np.eye(10)[0] * (np.arange(10) > 0)[:, None]
    basis = np.array([pin.Inertia.FromDynamicParameters(row).matrix() for row in rows])
    basis[1:] -= basis[0]
    basis.flags.writeable = False
    return basis


SHARE = 1e-5  # of the robot's mass: changes no frequency in the band by a millionth


def massless_base(robot: Robot) -> tuple[Payload, ...]:
    """A little mass for a base to which neither the URDF nor a [[payload]] gives any, else none.

    Many URDFs state none, as the base stands still. Where it gives beside a joint 1 that gives
    about all axes, the mass matrix would have no inverse.
    """
    model = robot.model
    if model.inertias[0].mass > 0:
        return ()
    mass = SHARE * sum(inertia.mass for inertia in model.inertias)
    reach = max(float(np.linalg.norm(place.translation)) for place in model.jointPlacements)
    moment = mass * reach**2
    fixed = [frame.name for frame in robot.body_frames(0)]
    own = Payload(fixed[0], mass, (0.0, 0.0, 0.0), (moment, 0.0, 0.0, moment, 0.0, moment))
    others = any(block.link in fixed and block != own for block in robot.config.payload)
    return () if others else (own,)
