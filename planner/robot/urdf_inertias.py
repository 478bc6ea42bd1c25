"""A robot's URDF with other inertias: how identified ones are handed on."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin

from planner.robot.config import BASE
from planner.robot.mesh_files import urdf_source
from planner.robot.robot import Robot
from planner.robot.urdf_elements import link_inertia, state_inertias, write_inertia
from planner.robot.virtual_joints import OUTER, SMALL, body_inertia, cut_at, ends_of

SAFE = 0.99  # of the largest share of a change that leaves a body possible


def urdf_with_inertias(
    robot: Robot, bodies: tuple[str, ...], change: np.ndarray
) -> tuple[str, dict[str, float]]:
    """Text of the URDF after change (B, 10) of the bodies' inertias, which `bodies` names.

    What [[link]] of robot.toml states is in it (a robot.toml beside it must not state them).
    Bodies, their frames and the ten numbers are those of `ElasticModel.inertia`. Of the links
    that make up a body the heaviest takes the change, or the share of it that leaves a link which
    matter can form; shares below 1 are returned by body.
    """
    text = urdf_source(robot.urdf_path).decode("utf-8")
    keep = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    root = ElementTree.fromstring(text[text.index("<robot") :], keep)
    state_inertias(root, robot.config.link)
    links = {link.get("name"): link for link in root.findall("link")}
    shares = {}
    for body, values in zip(bodies, change, strict=True):
        if body.endswith(OUTER):
            body, values = _of_whole(robot, body.removesuffix(OUTER), values)
        if np.any(values) and not body.startswith(f"{SMALL} "):
            frames = robot.body_frames(_joint_of(robot, body))
            stated = [frame for frame in frames if frame.name in links]
            frame = max(stated, key=lambda frame: link_inertia(links[frame.name]).mass)
            if body == BASE and not link_inertia(links[frame.name]).mass:
                continue  # what `massless_base` gave it is no matter
            share = _change(links[frame.name], _seen_from(frame.placement, values))
            shares |= {body: share} if share < 1 else {}
    return text[: text.index("<robot")] + ElementTree.tostring(root, encoding="unicode"), shares


def _of_whole(robot: Robot, link: str, values: np.ndarray) -> tuple[str, np.ndarray]:
    """The joint that moves a link, and a change (10,) of its outer half as one of the link's."""
    there = pin.SE3(np.eye(3), -cut_at(robot, link))
    return str(robot.model.names[ends_of(robot, link)[0]]), _seen_from(there, values)


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
    carried = {frame.name for frame in robot.body_frames(joint)}
    whole, found = float(body_inertia(robot, joint)[0]), []
    for link in ElementTree.fromstring(robot.urdf_text).findall("link"):
        name = link.get("name", "")
        if name in stated and name in carried and whole > 0:
            found.append((link_inertia(link).mass / whole, stated[name]))
    return tuple(found)


def _seen_from(placement: pin.SE3, values: np.ndarray) -> np.ndarray:
    """Inertial numbers (10,), or a change of them, in a frame that is placed in theirs."""
    toward = placement.inverse().homogeneous
    return pin.PseudoInertia.FromMatrix(toward @ _spread(values) @ toward.T).toDynamicParameters()


def _spread(values: np.ndarray) -> np.ndarray:
    """Pseudo-inertia (4, 4): ∫ (x, 1)(x, 1)ᵀ dm, positive where matter can form the body.

    Wensing, Kim & Slotine 2018, eq. 12.
    """
    return pin.PseudoInertia.FromDynamicParameters(values).toMatrix()


def _change(link: ElementTree.Element, values: np.ndarray) -> float:
    """Add the share of `values` (10,) that is possible to a link; returns it.

    That is the one that keeps the pseudo-inertia positive; 0 where it is not so before.
    """
    import scipy.linalg  # 0.2 s, which reading inertias does not need

    nominal = np.array(link_inertia(link).toDynamicParameters())
    try:
        least = scipy.linalg.eigh(_spread(values), _spread(nominal), eigvals_only=True)[0]
    except np.linalg.LinAlgError:
        return 0.0
    share = 1.0 if least > -SAFE else float(SAFE / -least)
    write_inertia(link, pin.Inertia.FromDynamicParameters(nominal + share * values))
    return share
