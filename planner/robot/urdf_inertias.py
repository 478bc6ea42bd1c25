"""A robot's links and payloads with other inertias: how identified ones are handed on."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from planner.robot.config import BASE, STATED, OuterHalf, Payload
from planner.robot.elastic_model import ElasticModel
from planner.robot.mesh_files import urdf_source
from planner.robot.robot import Robot
from planner.robot.urdf_elements import link_inertia, links_of, state_inertias, write_inertia
from planner.robot.virtual_joints import (
    OUTER,
    SMALL,
    body_inertia,
    cut_at,
    ends_of,
    payload_inertia,
)


def affine_map(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """A (4, 4) with A `before` Aᵀ = `after`, pseudo-inertias that are positive.

    It is upper triangular, so that it moves and stretches: what it makes of any body, A P Aᵀ, is
    one that matter can form (Lee, Wensing & Park 2020). LinAlgError where one is not positive.
    """
    return _upper(after) @ np.linalg.inv(_upper(before))


def _upper(matrix: np.ndarray) -> np.ndarray:
    """U, upper triangular, with U Uᵀ = matrix."""
    return np.linalg.cholesky(matrix[::-1, ::-1])[::-1, ::-1]


def with_inertias(
    robot: Robot, bodies: tuple[str, ...], change: np.ndarray
) -> tuple[str, tuple[Payload, ...], tuple[str, ...]]:
    """Text of the URDF and payloads after change (B, 10) of `bodies`, and which could not have it.

    What [[link]] of robot.toml states is in the URDF (a robot.toml beside it must not state them).
    Bodies, their frames and the ten numbers are those of `ElasticModel.inertia`. All that makes up
    a body is moved and stretched by the one `affine_map` that gives the whole its new inertia, so
    that each part stays possible; a body that is impossible as stated, or becomes so, stays.
    """
    text = urdf_source(robot.urdf_path).decode("utf-8")
    keep = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    root = ElementTree.fromstring(text[text.index("<robot") :], keep)
    links = links_of(root)
    state_inertias(links, robot.config.link)
    payload, unchanged = list(robot.config.payload), []
    for body, values in _whole(robot, bodies, change).items():
        joint = _joint_of(robot, body)
        placed = {frame.name: frame.placement for frame in robot.body_frames(joint)}
        mine = [name for name in placed if name in links]
        before = _spread(body_inertia(robot, joint))
        try:
            to = affine_map(before, before + _spread(values))
        except np.linalg.LinAlgError:
            unchanged.append(body)
            continue
        for name in mine:
            if (own := link_inertia(links[name])).mass:
                write_inertia(links[name], _moved(own, placed[name], to))
        for number, block in enumerate(payload):
            if block.link in placed and block.mass:
                own = _moved(payload_inertia(block), placed[block.link], to)
                payload[number] = _as_payload(block.link, own)
    text = text[: text.index("<robot")] + ElementTree.tostring(root, encoding="unicode")
    return text, tuple(payload), tuple(unchanged)


def _whole(robot: Robot, bodies: tuple[str, ...], change: np.ndarray) -> dict[str, np.ndarray]:
    """Changes (10,) other than none by body, those of halves as one of their link's."""
    out: dict[str, np.ndarray] = {}
    for body, values in zip(bodies, change, strict=True):
        if body.endswith(OUTER):
            body, values = _of_whole(robot, body.removesuffix(OUTER), values)
        if np.any(values) and not body.startswith(f"{SMALL} "):
            out[body] = out.get(body, np.zeros(10)) + values
    return out


def _moved(inertia: pin.Inertia, placement: pin.SE3, to: np.ndarray) -> pin.Inertia:
    """What an affine map, in the frame of a body, makes of what is placed there."""
    there = placement.homogeneous
    own = np.linalg.inv(there) @ to @ there
    spread = own @ _spread(inertia.toDynamicParameters()) @ own.T
    return pin.PseudoInertia.FromMatrix(spread).toInertia()


def outer_halves(
    robot: Robot, elastic: ElasticModel, unchanged: Sequence[str]
) -> dict[str, OuterHalf]:
    """By link that bends what its outer half weighs there; not of `unchanged` bodies."""
    out = {}
    for body, values in zip(elastic.bodies, elastic.inertia, strict=True):
        link = body.removesuffix(OUTER)
        if link != body:
            joint, half = _of_whole(robot, link, values)
            if joint not in unchanged:
                block = _as_payload(link, pin.Inertia.FromDynamicParameters(half))
                out[link] = OuterHalf(block.mass, block.com_m, block.inertia_kg_m2)
    return out


def _as_payload(link: str, inertia: pin.Inertia) -> Payload:
    numbers = [inertia.mass, *inertia.lever, *(inertia.inertia[at] for at in STATED)]
    mass, x, y, z, *moments = (float(f"{v:.9g}") for v in numbers)
    xx, xy, xz, yy, yz, zz = moments
    return Payload(link, mass, (x, y, z), (xx, xy, xz, yy, yz, zz))


def _of_whole(robot: Robot, link: str, values: np.ndarray) -> tuple[str, np.ndarray]:
    """The joint that moves a link, and a change (10,) of its outer half as one of the link's."""
    toward = pin.SE3(np.eye(3), cut_at(robot, link)).homogeneous
    whole = pin.PseudoInertia.FromMatrix(toward @ _spread(values) @ toward.T)
    return str(robot.model.names[ends_of(robot, link)[0]]), whole.toDynamicParameters()


def _joint_of(robot: Robot, body: str) -> int:
    """Number of the joint that moves a body, 0 of the base."""
    if body == BASE and BASE not in robot.joint_names:
        return 0
    return list(robot.model.names).index(body)


def stated_shares(robot: Robot, body: str) -> tuple[tuple[float, float], ...]:
    """Share of a body's mass and relative sd of each of its links that [[link]] states an sd of.

    Bodies are named as in `ElasticModel.bodies`; of a link that bends both halves have its sd.
    """
    stated = {t.link: t.sd_percent / 100 for t in robot.config.link if t.sd_percent is not None}
    if not stated or body.startswith(f"{SMALL} "):
        return ()
    if body.endswith(OUTER):
        body, _ = _of_whole(robot, body.removesuffix(OUTER), np.zeros(10))
    joint = _joint_of(robot, body)
    whole = float(body_inertia(robot, joint)[0])
    carried = {frame.name for frame in robot.body_frames(joint)} if whole > 0 else set()
    return tuple(
        (link_inertia(link).mass / whole, stated[name])
        for name, link in robot.links.items()
        if name in stated and name in carried
    )


def _spread(values: np.ndarray) -> np.ndarray:
    """Pseudo-inertia (4, 4): ∫ (x, 1)(x, 1)ᵀ dm, positive where matter can form the body.

    Wensing, Kim & Slotine 2018, eq. 12.
    """
    return pin.PseudoInertia.FromDynamicParameters(values).toMatrix()
