"""Data for Lei et al. 2023: 9 modes by 16 parameters at 112 postures over a table, tool upright.

Tool tip on a grid of 200 mm, seven turns about the tool's axis (the paper's section 5). The robot
is the KR240 with spindle in MuJoCo, with stiffnesses, damping and inertias of its own. Each posture
is hit at two points of the tool along two axes, at three levels, and heard at both points along
both axes. Hits miss axis and point, channels have gains and feel each other, joints stand beside
their readback, brakes engage anew at each posture (`planner.proof.measurement_errors.EVERYDAY`).
FRFs are H1, modes come from modal analysis and are tracked over the postures without any
simulation.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.modal.estimate_modes import identify
from planner.modal.fit_data import Data
from planner.modal.modes import LEAST_PROBABILITY, Mode
from planner.modal.residues import rank_one
from planner.modal.tracking import Guide, track
from planner.progress import ProgressCallback
from planner.proof.deviation import Deviation
from planner.proof.fault_injection import DampingScatter
from planner.proof.hits import Hammer, SimulatedHit, noisy, pulse, sampled
from planner.proof.load import load_truth
from planner.proof.measurement_errors import EVERYDAY
from planner.proof.model import Truth, driven
from planner.studies.hits import upright_poses

X_M, Y_M, Z_M = np.linspace(1.3, 1.9, 4), np.linspace(-0.3, 0.3, 4), 0.8
TURN_DEG = np.linspace(-60, 60, 7)
START_DEG = (14.0, -105.0, 115.0, -132.0, -18.0, 133.0)  # joint 5 negative, as in the campaign
MODES = 9
LIGHT = 0.15  # of the stated damping, which would leave no peak of the ninth mode
TIP, BACK = (-0.3, 0.0, 0.157), (-0.25, 0.0, 0.157)  # points 1 and 1a in link_6, in m
LEFT, RIGHT = slice(2, 8), slice(8, 16)  # of the parameters: L and R; 0 is f, 1 is ζ


def true_robot(seed: int) -> Truth:
    """The robot that is measured, each seed another one."""
    robot_toml = Path(__file__).parents[1] / "kr240_plane" / "robot" / "robot.toml"
    return load_truth(robot_toml, Deviation(seed, 0.12, 0.15, 0.04, 0.005)).changed(damping=LIGHT)


def postures(truth: Truth) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles (112, 6) in rad and (turn, x, y) scaled to [0, 1] (112, 3).

    InputError if the robot cannot stand somewhere.
    """
    upper = truth.upper_rad.copy()
    upper[4] = -0.01
    x = np.array([(turn, a, b) for turn in np.deg2rad(TURN_DEG) for a in X_M for b in Y_M])
    targets = ((np.array([a, b, Z_M]), turn) for turn, a, b in x)
    q = upright_poses(truth, targets, np.deg2rad(START_DEG), "the table", upper, follow=False)
    return q, (x - x.min(axis=0)) / np.ptp(x, axis=0)


def parameters(truth: Truth, q: np.ndarray, reference: np.ndarray | None = None) -> np.ndarray:
    """The 16 real parameters of 9 modes (n, 9, 16) without scatter: f, ζ, L (6) and R (8).

    Receptance between points j (response) and k (hit) is Σ R_j L_k / (iω − λ) + conj. (eqs. 5 and
    17), with one entry of L set to 1. The paper sets that at 1aY; with a tool that turns by 120°
    a mode may be at rest there, so each mode takes the point where it never comes near to rest, or
    that which `reference` (9,) says.
    """
    each = [_modes(truth, posture) for posture in q]
    poles, left, right = (np.array([e[i] for e in each]) for i in range(3))  # (n, 9, ...)
    size = np.abs(poles)
    natural = np.stack([size / (2 * np.pi), -poles.real / size], axis=-1)
    return _scaled(natural, left, right, reference).values


def _modes(truth: Truth, q: np.ndarray) -> tuple[np.ndarray, ...]:
    """Poles (9,), L and R (9, 4) of one posture by rising frequency, points as 1X, 1aX, 1Y, 1aY."""
    poles, shapes, entry, *_ = truth.modal(q)
    points = _points(truth, q)
    order = [k for k in np.argsort(np.abs(poles)) if poles[k].imag > 1e-6][:MODES]
    return poles[order], entry[order] @ points.T, (points @ shapes[:, order]).T


def _points(truth: Truth, q: np.ndarray) -> np.ndarray:
    """How 1X, 1aX, 1Y and 1aY move with each spring (4, e)."""
    axes = truth.tcp(q)[0].T[:2]
    return np.array([truth.along(q, "link_6", np.array(p), a) for a in axes for p in (TIP, BACK)])


def _parts(values: np.ndarray) -> np.ndarray:
    """(n, m) complex to (n, 2m): real, imaginary, real, …"""
    return np.stack([values.real, values.imag], axis=-1).reshape(len(values), -1)


HAMMER = Hammer(duration_s=0.004, sampling_rate_hz=512.0, record_s=2.0, oversampling=8)
BAND_HZ = (5.0, 130.0)
LEVELS = 0.4, 1.0, 2.5
BRAKES = 0.2  # log-sd of each joint's damping from visit to visit
OFTEN = 0.8  # of the postures, in which a mode is found that is modelled
SENSORS = ((0, 2), (1, 3))  # channels of the tip's and the back's sensor: X and Y of each


@dataclass(frozen=True, eq=False)
class HitParameters:
    """Measured parameters (n, modes, 16), NaN where a mode was not found; label by label."""

    values: np.ndarray
    reference: np.ndarray  # (modes,) entry of L that is 1

    @property
    def often(self) -> np.ndarray:
        """Labels that are found in nearly all postures."""
        return np.flatnonzero(np.isfinite(self.values[..., 0]).mean(axis=0) >= OFTEN)


def measured(
    truth: Truth, q: np.ndarray, x: np.ndarray, seed: int, progress: ProgressCallback
) -> HitParameters:
    """Hits and modal analysis at postures q (n, 6) in rad, x (n, d) scaled to the workspace."""
    rng = np.random.default_rng([seed, 7])
    gains, brakes = _channels(rng), DampingScatter(BRAKES, seed)
    found = []
    for i, posture in enumerate(q):
        progress(f"hits at posture {i + 1} of {len(q)}", i / len(q))
        there = EVERYDAY.beside(posture, rng)
        found.append(_analysed(brakes.applied(truth, i / len(q)), there, gains, rng))
    tracks = track(found, Guide.by_example(found, MODES), x, ordered=True)
    natural = np.full((len(q), MODES, 2), np.nan)
    left, right = np.full((2, len(q), MODES, 4), np.nan + 0j)
    for i, row in enumerate(tracks.modes):
        for k, mode in enumerate(row[:MODES]):
            if mode is not None:
                natural[i, k] = mode.frequency_hz, mode.damping_ratio
                right[i, k], left[i, k] = rank_one(mode.residue)
    return _scaled(natural, left, right)


def _channels(rng: np.random.Generator) -> np.ndarray:
    """What the four channels show of the four accelerations: gains, and each of its neighbour."""
    matrix = np.diag(1 + EVERYDAY.gain * rng.standard_normal(4))
    for pair in SENSORS:
        turned = np.deg2rad(EVERYDAY.mounting_deg) * rng.standard_normal()
        for sign, (a, b) in zip((1, -1), (pair, pair[::-1]), strict=True):
            matrix[a, b] = sign * turned + EVERYDAY.cross_axis * rng.standard_normal()
    return matrix


def _analysed(
    truth: Truth, q: np.ndarray, gains: np.ndarray, rng: np.random.Generator
) -> tuple[Mode, ...]:
    hz, h, variance = _frf(truth, q, gains, rng)
    lines = (hz >= BAND_HZ[0]) & (hz <= BAND_HZ[1])
    tail = HAMMER.record_s - HAMMER.pretrigger_s - HAMMER.duration_s / 2
    data = Data(hz[lines], h[..., lines], variance[..., lines], tail_s=tail)
    told = identify(data)
    kept = [m for m in (told.modes if told else ()) if m.probability >= LEAST_PROBABILITY]
    inside = (m for m in kept if BAND_HZ[0] <= m.frequency_hz <= BAND_HZ[1])
    # Tracking wants shapes (3,): three of the four points make them.
    return tuple(replace(m, shape=rank_one(m.residue[:3, :3])[0]) for m in inside)


def _frf(
    truth: Truth, q: np.ndarray, gains: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lines (F,), accelerances (4, 4, F) in m/s²/N by H1, and their variances."""
    poles, shapes, entry, *_ = truth.modal(q)
    inverse = np.linalg.inv(truth.matrices(q)[0])
    axes, heard = truth.tcp(q)[0].T, _points(truth, q)
    n = round(HAMMER.record_s * HAMMER.sampling_rate_hz)
    hz = np.fft.rfftfreq(n, 1 / HAMMER.sampling_rate_hz)
    h, variance = np.empty((4, 4, len(hz)), complex), np.empty((4, 4, len(hz)))
    upper = np.flatnonzero(poles.imag >= 0)
    for column in range(4):
        axis, point = divmod(column, 2)
        force_x, response_x = [], []
        for level in LEVELS:
            miss = np.deg2rad(EVERYDAY.angle_deg) * rng.standard_normal(3) * (np.arange(3) != axis)
            offset = EVERYDAY.offset_m * rng.standard_normal(3)
            place = np.array((TIP, BACK)[point]) + offset
            struck = truth.along(q, "link_6", place, axes[axis] + axes.T @ miss)
            force = level * pulse(HAMMER, rng)
            a = np.outer(heard @ inverse @ struck, force)
            for k in upper:
                twice = 2.0 if poles[k].imag > 0 else 1.0
                residue = (heard @ shapes[:, k]) * (entry[k] @ struck) * poles[k] ** 2
                a += twice * np.outer(residue, driven(poles[k], force, HAMMER.step_s)).real
            hit = sampled("+x", force, gains @ a, HAMMER)
            hit = noisy(SimulatedHit("+x", hit.force_n, hit.acceleration_m_s2), HAMMER, rng)
            force_x.append(np.fft.rfft(hit.force_n))
            response_x.append(np.fft.rfft(hit.acceleration_m_s2))
        force_f, response = np.array(force_x), np.array(response_x)
        power = np.sum(np.abs(force_f) ** 2, axis=0)
        h[:, column] = np.einsum("lf,lrf->rf", force_f.conj(), response) / power
        left = response - h[None, :, column] * force_f[:, None]
        spread = np.sum(np.abs(left) ** 2, axis=0) / (len(LEVELS) - 1)
        variance[:, column] = np.mean(spread, axis=1, keepdims=True) / power
    return hz, h, variance


def _scaled(
    natural: np.ndarray, left: np.ndarray, right: np.ndarray, reference: np.ndarray | None = None
) -> HitParameters:
    """From f and ζ (n, modes, 2), L and R (n, modes, 4), NaN where a mode was not found."""
    rows = np.full((*left.shape[:2], 16), np.nan)
    with np.errstate(all="ignore"):
        size = np.abs(left) / np.linalg.norm(left, axis=2, keepdims=True)
        least = np.min(np.where(np.isfinite(size), size, np.inf), axis=0)
        reference = np.argmax(least, axis=1) if reference is None else reference
        for k, one in enumerate(reference):
            scale = left[:, k, one, None]
            rows[:, k, :2] = natural[:, k]
            rows[:, k, LEFT] = _parts(np.delete(left[:, k], one, axis=1) / scale)
            rows[:, k, RIGHT] = _parts(right[:, k] * scale)
    return HitParameters(rows, reference)
