"""Kinematics and masses of five kinds of robots, drawn at random within each kind.

A layout is written in the world at zero angles: where each axis lies, its direction, the range of
its angle, and the share of the moving mass that its link has. Lengths are in units of the reach.
"""

from dataclasses import dataclass

import numpy as np

from planner.proof.tree.laws import Spring
from planner.proof.tree.spatial import to_rpy, with_z_along
from planner.proof.tree.tree import Body

X, Y, Z = np.eye(3)
DEG = np.pi / 180


@dataclass(frozen=True)
class Joint:
    """Frame of the child at zero angle in its parent, axis in the child's frame, limits (rad)."""

    name: str
    rotation: np.ndarray
    place: np.ndarray
    axis: np.ndarray
    lower: float
    upper: float

    @property
    def rpy(self) -> np.ndarray:
        """Of `rotation` (rad)."""
        return to_rpy(self.rotation)


@dataclass(frozen=True)
class Robot:
    """What the files state. `cross` maps a joint's number to its listed transverse springs."""

    name: str
    kind: str
    payload: float  # kg
    reach: float  # m
    joints: tuple[Joint, ...]
    base: Body
    links: tuple[Body, ...]
    tool: tuple[np.ndarray, np.ndarray]  # rotation and place (m) of tcp in the last link
    sensor: np.ndarray  # place (m) in the last link; the frame is parallel to tcp's
    gravity: np.ndarray
    gears: tuple[Spring, ...] = ()
    cross: dict[int, tuple[tuple[np.ndarray, Spring], ...]] | None = None
    band: tuple[float, float] = (4.0, 90.0)


# name: (place from the axis before, axis, half range in deg, share of mass), then the tool's place.
LAYOUTS = {
    "scara4": (
        [
            ((0, 0, 0.42), Z, 110, 0.42),
            ((0.46, 0, 0.04), Z, 120, 0.33),
            ((0.40, 0, -0.06), Y, 40, 0.14),
            ((0.03, 0, -0.08), Z, 160, 0.11),
        ],
        (0.05, 0.02, -0.10),
        (0, 0, 0, 0),
    ),
    "palletiser4": (
        [
            ((0, 0, 0.18), Z, 120, 0.38),
            ((0.11, 0, 0.15), Y, 45, 0.30),
            ((0, 0.02, 0.45), Y, 45, 0.22),
            ((0.44, 0, 0.02), Z, 160, 0.10),
        ],
        (0.06, 0.01, -0.11),
        (0, 10, 5, 0),
    ),
    "arm5": (
        [
            ((0, 0, 0.17), Z, 120, 0.33),
            ((0.10, 0, 0.12), Y, 50, 0.27),
            ((0, 0, 0.42), Y, 50, 0.21),
            ((0.40, 0.01, 0.03), Y, 80, 0.09),
            ((0.09, 0, 0), X, 160, 0.10),
        ],
        (0.09, 0.03, 0.01),
        (0, 10, 5, 30, 0),
    ),
    "arm6": (
        [
            ((0, 0, 0.15), Z, 120, 0.31),
            ((0.13, 0, 0.14), Y, 45, 0.25),
            ((0, 0, 0.41), Y, 50, 0.19),
            ((0.12, 0, 0.05), X, 150, 0.11),
            ((0.28, 0, 0), Y, 90, 0.06),
            ((0.08, 0, 0), X, 160, 0.08),
        ],
        (0.07, 0.02, 0.06),
        (0, 10, 5, 0, 30, 0),
    ),
    "cobot6": (
        [
            ((0, 0, 0.13), Z, 140, 0.26),
            ((0, 0.10, 0.06), Y, 60, 0.28),
            ((0.02, -0.05, 0.43), Y, 60, 0.21),
            ((0.02, 0.02, 0.38), Y, 80, 0.10),
            ((0, 0.09, 0), Z, 120, 0.08),
            ((0, 0, 0.09), Y, 160, 0.07),
        ],
        (0.04, 0.08, 0.02),
        (0, 20, 60, 20, 0, 0),
    ),
}


def draw_layout(rng: np.random.Generator, kind: str) -> Robot:
    """A robot of a kind without springs: payload 20 to 900 kg, frames by one of two habits."""
    axes, tool, centre = LAYOUTS[kind]
    top = 60.0 if kind in ("scara4", "cobot6") else 900.0
    payload = float(np.exp(rng.uniform(np.log(20), np.log(top))))
    reach = 1.6 * (payload / 20) ** 0.2 * rng.uniform(0.9, 1.15)
    total = 25 * payload**0.75 * rng.uniform(0.8, 1.25)
    steps = [_jitter(rng, step, reach) for step, *_ in axes]
    places = np.cumsum(steps, axis=0)
    tip = places[-1] + _jitter(rng, tool, reach)
    along_z = bool(rng.integers(2))
    frames = [with_z_along(a, rng.integers(4) * np.pi / 2) if along_z else np.eye(3)
              for _, a, *_ in axes]  # fmt: skip
    joints = _joints(places, frames, axes, centre)
    shares = np.array([share for *_, share in axes]) * rng.uniform(0.8, 1.25, len(axes))
    masses = total * shares / shares.sum()
    ends = np.vstack([places[1:], tip])
    links = tuple(
        _link(rng, mass, start, end, frame)
        for mass, start, end, frame in zip(masses, places, ends, frames, strict=True)
    )
    base = Body(0.15 * total, np.array([0, 0, 0.4 * places[0, 2]]),
                0.15 * total * np.diag([0.03, 0.03, 0.02]) * reach**2 * 0.3)  # fmt: skip
    tool_turn = frames[-1].T @ with_z_along([X, Y, Z, -Z][rng.integers(4)], rng.uniform(-3, 3))
    away = rng.normal(size=3)
    sensor = tip + away / np.linalg.norm(away) * rng.uniform(0.05, 0.14)
    last = frames[-1].T
    down = 9.81 if rng.random() < 0.1 else -9.81
    return Robot(
        f"{kind}-{payload:.0f}", kind, payload, reach, joints, base, links,
        (tool_turn, last @ (tip - places[-1])), last @ (sensor - places[-1]),
        np.array([0, 0, down]),
    )  # fmt: skip


def _jitter(rng: np.random.Generator, step: tuple, reach: float) -> np.ndarray:
    """A step (in reaches) in m, 15 % off and a little aside."""
    return np.array(step) * reach * rng.uniform(0.85, 1.15) + np.array(
        [0, rng.uniform(-0.02, 0.02) * reach, 0]
    )


def _joints(places, frames, axes, centre) -> tuple[Joint, ...]:
    """Joints from world places and frames at zero angles; zero is off the range's middle."""
    joints = []
    before, frame_before = np.zeros(3), np.eye(3)
    for i, (_, axis, half, _) in enumerate(axes):
        joints.append(
            Joint(
                f"joint_{i + 1}",
                frame_before.T @ frames[i],
                frame_before.T @ (places[i] - before),
                np.round(frames[i].T @ axis, 12),
                (centre[i] - half - 12) * DEG,
                (centre[i] + half + 12) * DEG,
            )
        )
        before, frame_before = places[i], frames[i]
    return tuple(joints)


def _link(rng, mass, start, end, frame) -> Body:
    """A link's body between two world places, in its frame: a rod with thickness, off-centre."""
    way = end - start
    length = max(float(np.linalg.norm(way)), 0.05)
    aside = rng.normal(size=3) * 0.06 * length
    centre = way * rng.uniform(0.3, 0.55) + aside
    thick = rng.uniform(0.05, 0.12, 3) * (0.3 + length)
    second = mass * (np.outer(way, way) / 14 + np.diag(thick**2))
    return Body(float(mass), frame.T @ centre, frame.T @ second @ frame)
