"""Robots that are drawn at random: kinematics and masses of five kinds, springs after their masses.

A layout is written in the world at zero angles: where each axis lies, its direction, half the range
of its angle, and the share of the moving mass that its link has. Lengths are in units of the reach.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from planner.proof.arms import Arm, Body, Joint
from planner.proof.load import load_truth
from planner.proof.model import Truth
from planner.proof.scene import log_uniform

X, Y, Z = np.eye(3)
LADDER_HZ = ((7, 17), (8, 19), (13, 30), (20, 55), (30, 70), (35, 85))  # of single joints
TRIES = 400
BAND_HZ = 4.0, 90.0


@dataclass(frozen=True, eq=False)
class ArmLayout:
    """Axes: (place from the axis before, axis, half range in °, share of mass, middle in °)."""

    axes: Sequence[tuple[tuple[float, float, float], np.ndarray, float, float, float]]
    tool: tuple[float, float, float]
    most_kg: float = 900.0  # payload


LAYOUTS = {
    "scara4": ArmLayout((
        ((0, 0, 0.42), Z, 110, 0.42, 0), ((0.46, 0, 0.04), Z, 120, 0.33, 0),
        ((0.40, 0, -0.06), Y, 40, 0.14, 0), ((0.03, 0, -0.08), Z, 160, 0.11, 0),
    ), (0.05, 0.02, -0.10), 60.0),
    "palletiser4": ArmLayout((
        ((0, 0, 0.18), Z, 120, 0.38, 0), ((0.11, 0, 0.15), Y, 45, 0.30, 10),
        ((0, 0.02, 0.45), Y, 45, 0.22, 5), ((0.44, 0, 0.02), Z, 160, 0.10, 0),
    ), (0.06, 0.01, -0.11)),
    "arm5": ArmLayout((
        ((0, 0, 0.17), Z, 120, 0.33, 0), ((0.10, 0, 0.12), Y, 50, 0.27, 10),
        ((0, 0, 0.42), Y, 50, 0.21, 5), ((0.40, 0.01, 0.03), Y, 80, 0.09, 30),
        ((0.09, 0, 0), X, 160, 0.10, 0),
    ), (0.09, 0.03, 0.01)),
    "arm6": ArmLayout((
        ((0, 0, 0.15), Z, 120, 0.31, 0), ((0.13, 0, 0.14), Y, 45, 0.25, 10),
        ((0, 0, 0.41), Y, 50, 0.19, 5), ((0.12, 0, 0.05), X, 150, 0.11, 0),
        ((0.28, 0, 0), Y, 90, 0.06, 30), ((0.08, 0, 0), X, 160, 0.08, 0),
    ), (0.07, 0.02, 0.06)),
    "cobot6": ArmLayout((
        ((0, 0, 0.13), Z, 140, 0.26, 0), ((0, 0.10, 0.06), Y, 60, 0.28, 20),
        ((0.02, -0.05, 0.43), Y, 60, 0.21, 60), ((0.02, 0.02, 0.38), Y, 80, 0.10, 20),
        ((0, 0.09, 0), Z, 120, 0.08, 0), ((0, 0, 0.09), Y, 160, 0.07, 0),
    ), (0.04, 0.08, 0.02), 60.0),
}  # fmt: skip


def draw_arm(rng: np.random.Generator, folder: Path, per_joint: int) -> Arm:
    """An arm whose first mode is at 5 to 15 Hz, with at least 3 modes below 90 Hz.

    Files of those that were tried are left in `folder`. Raises RuntimeError where none comes.
    """
    kind = str(rng.choice(list(LAYOUTS)))
    for _ in range(TRIES):
        arm = _stiffened(rng, _shape(rng, kind), folder)
        truth = load_truth(arm.write(folder, per_joint))
        modes = [truth.modes(q, 3)[0] for q in standing(rng, arm, truth, 4)]
        first, third = np.array(modes)[:, [0, -1]].T
        if np.min(first) > 5 and np.max(first) < 15 and np.median(third) < 0.8 * BAND_HZ[1]:
            return arm
    raise RuntimeError(f"no {kind} with modes where they are wanted")


def standing(rng: np.random.Generator, arm: Arm, truth: Truth, count: int) -> np.ndarray:
    """Angles (count, joints) in rad: the tool above the floor, and not over the base."""
    low, high = np.deg2rad(np.array(arm.joints_deg)).T
    poses: list[np.ndarray] = []
    while len(poses) < count:
        q = rng.uniform(low, high)
        x, y, z = truth.position(q)
        if z > 0.1 * arm.reach_m and np.hypot(x, y) > 0.25 * arm.reach_m:
            poses.append(q)
    return np.array(poses)


def _stiffened(rng: np.random.Generator, arm: Arm, folder: Path) -> Arm:
    """Gear springs after the inertia that each joint carries."""
    truth = load_truth(arm.write(folder))
    carried = np.mean([np.diag(truth.matrices(q)[0]) for q in standing(rng, arm, truth, 3)], axis=0)
    hertz = np.array([rng.uniform(*band) for band in LADDER_HZ[: len(carried)]])
    torsion = carried * (2 * np.pi * hertz) ** 2
    bending = torsion * rng.uniform(2, 8, len(torsion))
    return replace(
        arm, torsion=tuple(map(float, torsion)), bending=tuple(map(float, bending)),
        damping_s=log_uniform(rng, 3e-4, 1e-3),
    )  # fmt: skip


def _shape(rng: np.random.Generator, kind: str) -> Arm:
    """Of a kind, without springs: payload 20 to 900 kg, frames by one of two habits."""
    layout = LAYOUTS[kind]
    payload_kg = log_uniform(rng, 20, layout.most_kg)
    reach = 1.6 * (payload_kg / 20) ** 0.2 * rng.uniform(0.9, 1.15)
    total = 25 * payload_kg**0.75 * rng.uniform(0.8, 1.25)
    places = np.cumsum([_jitter(rng, step, reach) for step, *_ in layout.axes], axis=0)
    tip = places[-1] + _jitter(rng, layout.tool, reach)
    along_z = bool(rng.integers(2))
    frames = [_with_z_along(axis, rng.integers(4) * np.pi / 2) if along_z else np.eye(3)
              for _, axis, *_ in layout.axes]  # fmt: skip
    shares = np.array([axis[3] for axis in layout.axes])
    shares = shares * rng.uniform(0.8, 1.25, len(shares))
    masses = total * shares / shares.sum()
    ends = np.vstack([places[1:], tip])
    rods = zip(masses, ends - places, frames, strict=True)
    links = [_link(rng, mass, way, frame) for mass, way, frame in rods]
    last, spindle = links[-1], replace(links[-1], mass=0.4 * links[-1].mass)
    links[-1] = replace(last, mass=0.6 * last.mass, moments=[0.6 * m for m in last.moments])
    spindle = replace(spindle, moments=[0.4 * m for m in last.moments])
    size = 0.15 * total * 0.3 * reach**2
    base = Body(0.15 * total, (0, 0, 0.4 * places[0, 2]), (0, 0, 0),
                (0.05 * size, 0.05 * size, 0.06 * size))  # fmt: skip
    away, inverse = rng.normal(size=3), frames[-1].T
    sensor = tip + away / np.linalg.norm(away) * rng.uniform(0.05, 0.14)
    tool = inverse @ _with_z_along([X, Y, Z, -Z][rng.integers(4)], rng.uniform(-3, 3))
    ranges = tuple((middle - half, middle + half) for *_, half, _, middle in layout.axes)
    return Arm(
        f"{kind}-{payload_kg:.0f}", _joints(places, frames, layout), (base, *links, spindle),
        tuple(inverse @ (tip - places[-1])), tuple(inverse @ (sensor - places[-1])),
        _quarters(tool), (1.0,) * len(links), (1.0,) * len(links), 0.0, ranges, BAND_HZ,
        9.81 if rng.random() < 0.1 else -9.81, 0.0, payload_kg, float(reach),
    )  # fmt: skip


def _jitter(rng: np.random.Generator, step: Sequence[float], reach: float) -> np.ndarray:
    """A step (in reaches) in m, 15 % off and a little aside."""
    aside = np.array([0, rng.uniform(-0.02, 0.02) * reach, 0])
    return np.array(step) * reach * rng.uniform(0.85, 1.15) + aside


def _joints(
    places: np.ndarray, frames: Sequence[np.ndarray], layout: ArmLayout
) -> tuple[Joint, ...]:
    """From world places and frames at zero angles; limits are beyond the workspace."""
    joints, before, place = [], np.eye(3), np.zeros(3)
    for i, (_, axis, half, _, middle) in enumerate(layout.axes):
        joints.append(Joint(
            before.T @ (places[i] - place), _quarters(before.T @ frames[i]),
            np.round(frames[i].T @ axis, 12), (middle - half - 12, middle + half + 12),
            2.2 + 0.2 * i,
        ))  # fmt: skip
        before, place = frames[i], places[i]
    return tuple(joints)


def _link(rng: np.random.Generator, mass: float, way: np.ndarray, frame: np.ndarray) -> Body:
    """A link's body along `way` (3,) in the world, in its frame: a thick rod, off-centre."""
    length = max(float(np.linalg.norm(way)), 0.05)
    aside = rng.normal(size=3) * 0.06 * length
    centre = way * rng.uniform(0.3, 0.55) + aside
    thick = rng.uniform(0.05, 0.12, 3) * (0.3 + length)
    second = frame.T @ (np.outer(way, way) / 14 + np.diag(thick**2)) @ frame
    moments, axes = np.linalg.eigh(mass * (np.trace(second) * np.eye(3) - second))
    axes[:, 2] *= np.linalg.det(axes)  # right-handed
    return Body(float(mass), frame.T @ centre, _rpy(axes), moments)


def _with_z_along(axis: np.ndarray, spin: float) -> np.ndarray:
    """A rotation whose third column is `axis`, turned by `spin` (rad) about it."""
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)
    x /= np.linalg.norm(x)
    frame = np.column_stack([x, np.cross(axis, x), axis])
    return frame @ Rotation.from_rotvec(spin * Z).as_matrix()


def _rpy(rotation: np.ndarray) -> np.ndarray:
    """URDF's roll, pitch, yaw in rad, about fixed axes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # at ± 90° of pitch any one of the others will do
        return Rotation.from_matrix(rotation).as_euler("xyz")


def _quarters(rotation: np.ndarray) -> np.ndarray:
    return _rpy(rotation) / (np.pi / 2)
