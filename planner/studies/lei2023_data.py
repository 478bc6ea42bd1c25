"""Data for Lei et al. 2023: 9 modes by 16 parameters at 112 postures over a table, tool upright.

Tool tip on a grid of 200 mm, seven turns about the tool's axis (the paper's section 5). The robot
is the KR240 with spindle in MuJoCo, with stiffnesses, damping and inertias of its own. What hits
tell of these parameters is in `lei2023_hits`.
"""

from dataclasses import replace

import numpy as np

from planner.demo import shipped
from planner.errors import InputError
from planner.truth import inverse
from planner.truth.deviation import Deviation
from planner.truth.load import load_truth
from planner.truth.model import Truth

X_M, Y_M, Z_M = np.linspace(1.3, 1.9, 4), np.linspace(-0.3, 0.3, 4), 0.8
TURN_DEG = np.linspace(-60, 60, 7)
START_DEG = (14.0, -105.0, 115.0, -132.0, -18.0, 133.0)  # joint 5 negative, as in the campaign
MODES = 9
LIGHT = 0.15  # of the stated damping, which would leave no peak of the ninth mode
TIP, BACK = (-0.3, 0.0, 0.157), (-0.25, 0.0, 0.157)  # points 1 and 1a in link_6, in m
LEFT, RIGHT = slice(2, 8), slice(8, 16)  # of the parameters: L and R; 0 is f, 1 is ζ


def true_robot(seed: int) -> Truth:
    """The robot that is measured, each seed another one."""
    robot_toml = shipped("kr240_plane") / "robot" / "robot.toml"
    truth = load_truth(robot_toml, Deviation(seed, 0.12, 0.15, 0.04, 0.005))
    lighter = tuple(replace(s, damping=LIGHT * s.damping) for s in truth.springs)
    return replace(truth, springs=lighter)


def postures(truth: Truth) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles (112, 6) in rad and (turn, x, y) scaled to [0, 1] (112, 3).

    InputError if the robot cannot stand somewhere.
    """
    q, x = [], []
    upper = truth.upper_rad.copy()
    upper[4] = -0.01
    for turn in np.deg2rad(TURN_DEG):
        rotation = inverse.tool_rotation(np.array([0.0, 0.0, -1.0]), turn)
        for place in (np.array([a, b, Z_M]) for a in X_M for b in Y_M):
            found = inverse.joint_angles(
                truth, rotation, place, np.deg2rad(START_DEG), upper_rad=upper
            )
            if found is None:
                raise InputError(f"{truth.name} cannot reach {place} m; move the table.")
            q.append(found)
            x.append((turn, *place[:2]))
    low, high = np.min(x, axis=0), np.max(x, axis=0)
    return np.array(q), (np.array(x) - low) / (high - low)


def parameters(truth: Truth, q: np.ndarray, reference: np.ndarray | None = None) -> np.ndarray:
    """The 16 real parameters of 9 modes (n, 9, 16) without scatter: f, ζ, L (6) and R (8).

    Receptance between points j (response) and k (hit) is Σ R_j L_k / (iω − λ) + conj. (eqs. 5 and
    17), with one entry of L set to 1. The paper sets that at 1aY; with a tool that turns by 120°
    a mode may be at rest there, so each mode takes the point where it never comes near to rest, or
    that which `reference` (9,) says.
    """
    each = [_modes(truth, posture) for posture in q]
    poles, left, right = (np.array([e[i] for e in each]) for i in range(3))  # (n, 9, ...)
    least = np.min(np.abs(left) / np.linalg.norm(left, axis=2, keepdims=True), axis=0)
    rows = np.empty((len(q), MODES, 16))
    chosen = np.argmax(least, axis=1) if reference is None else reference
    for k, one in enumerate(chosen):
        scale = left[:, k, one, None]
        rows[:, k, 0] = np.abs(poles[:, k]) / (2 * np.pi)
        rows[:, k, 1] = -poles[:, k].real / np.abs(poles[:, k])
        rows[:, k, LEFT] = _parts(np.delete(left[:, k], one, axis=1) / scale)
        rows[:, k, RIGHT] = _parts(right[:, k] * scale)
    return rows


def _modes(truth: Truth, q: np.ndarray) -> tuple[np.ndarray, ...]:
    """Poles (9,), L and R (9, 4) of one posture by rising frequency, points as 1X, 1aX, 1Y, 1aY."""
    poles, shapes, entry, *_ = truth.modal(q)
    axes = truth.tcp(q)[0].T[:2]
    points = [truth.along(q, "link_6", np.array(p), axis) for axis in axes for p in (TIP, BACK)]
    order = [k for k in np.argsort(np.abs(poles)) if poles[k].imag > 1e-6][:MODES]
    return poles[order], entry[order] @ np.transpose(points), (points @ shapes[:, order]).T


def _parts(values: np.ndarray) -> np.ndarray:
    """(n, m) complex to (n, 2m): real, imaginary, real, …"""
    return np.stack([values.real, values.imag], axis=-1).reshape(len(values), -1)
