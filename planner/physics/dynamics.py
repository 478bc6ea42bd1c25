"""Linear vibration of M ẍ + C ẋ + K x = Jᵀ f: modes and FRFs, batched over poses.

Everything is exact for any viscous C: the state-space eigenproblem is solved in the coordinates
of the undamped modes, real (overdamped) poles included (Géradin & Rixen 2015, chapter 3).
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

PROPORTIONAL = 1e-10  # off-diagonal modal damping below this is rounding


@dataclass(frozen=True, eq=False)
class Poles:
    """All 2e poles λ (n, 2e) in rad/s of n poses and their receptance residues (n, 2e, 3, 3).

    Receptance = Σ R/(iω−λ), in m/N; conjugate poles are both listed.
    """

    poles: np.ndarray
    residues: np.ndarray


@dataclass(frozen=True, eq=False)
class SimulatedModes:
    """Oscillatory modes of n poses, lowest first, NaN where there are fewer than `count`.

    frequency_hz (n, count), damping_ratio (n, count), residue (n, count, 3, 3) in m/(N·s).
    """

    frequency_hz: np.ndarray
    damping_ratio: np.ndarray
    residue: np.ndarray


def solve_poles(
    mass: np.ndarray,
    damping: np.ndarray,
    stiffness: np.ndarray,
    hit: np.ndarray,
    sensor: np.ndarray,
) -> Poles:
    """Poles and residues from M (n, e, e), C (e, e), K (e, e), hit and sensor (n, 3, e)."""
    lower = np.linalg.cholesky(mass)
    scaled = _whiten(lower, stiffness)
    square, vectors = np.linalg.eigh(scaled)
    phi = np.linalg.solve(np.swapaxes(lower, 1, 2), vectors)  # mass-normalised modes
    gamma = np.swapaxes(phi, 1, 2) @ damping @ phi
    off = gamma - gamma * np.eye(gamma.shape[1])
    scale = np.max(np.abs(gamma), axis=(1, 2)) + 1e-300
    if np.all(np.max(np.abs(off), axis=(1, 2)) <= PROPORTIONAL * scale):
        poles, left, norm = _proportional(square, gamma)
    else:
        poles, left, norm = _state_space(square, gamma)
    output, entry = sensor @ phi @ left, hit @ phi @ left  # (n, 3, 2e)
    residues = np.einsum("nik,njk->nkij", output / norm[:, None, :], entry)
    return Poles(poles, residues)


def _whiten(lower: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """L⁻¹ A L⁻ᵀ, symmetric."""
    half = np.linalg.solve(lower, np.broadcast_to(matrix, lower.shape))
    full = np.linalg.solve(lower, np.swapaxes(half, 1, 2))
    return (full + np.swapaxes(full, 1, 2)) / 2


def _proportional(
    square: np.ndarray, gamma: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Each undamped mode is a mode of the damped system too."""
    rate = np.diagonal(gamma, axis1=1, axis2=2).astype(complex)
    root = np.sqrt(rate**2 / 4 - square)
    poles = np.concatenate([-rate / 2 + root, -rate / 2 - root], axis=1)
    identity = np.broadcast_to(np.eye(square.shape[1]), gamma.shape)
    vectors = np.concatenate([identity, identity], axis=2)
    norm = 2 * poles + np.concatenate([rate, rate], axis=1)
    return poles, vectors, norm


def _state_space(
    square: np.ndarray, gamma: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """uᵀ(2λ + Γ)u normalises the eigenvectors u of λ² + λΓ + Λ."""
    n, e = square.shape
    state = np.zeros((n, 2 * e, 2 * e))
    state[:, :e, e:] = np.eye(e)
    state[:, e:, :e] = -square[:, :, None] * np.eye(e)
    state[:, e:, e:] = -gamma
    poles, vectors = np.linalg.eig(state)
    poles, vectors = poles.astype(complex), vectors[:, :e].astype(complex)
    norm = 2 * poles * np.einsum("nek,nek->nk", vectors, vectors)
    norm = norm + np.einsum("nek,nef,nfk->nk", vectors, gamma, vectors)
    return poles, vectors, norm


def oscillatory(solved: Poles, count: int) -> SimulatedModes:
    """The `count` lowest oscillatory modes, by natural frequency |λ|."""
    poles, n = solved.poles, len(solved.poles)
    natural = np.where(poles.imag > 1e-9 * np.abs(poles), np.abs(poles), np.inf)
    order = np.argsort(natural, axis=1, kind="stable")[:, :count]
    chosen = np.take_along_axis(natural, order, axis=1)
    frequency = np.full((n, count), np.nan)
    damping = np.full((n, count), np.nan)
    residue = np.full((n, count, 3, 3), np.nan + 1j * np.nan)
    row, column = np.nonzero(np.isfinite(chosen))
    source = order[row, column]
    frequency[row, column] = chosen[row, column] / (2 * np.pi)
    damping[row, column] = -poles[row, source].real / chosen[row, column]
    residue[row, column] = solved.residues[row, source]
    return SimulatedModes(frequency, damping, residue)


def accelerance(solved: Poles, frequency_hz: np.ndarray) -> np.ndarray:
    """Accelerance (n, 3, 3, F) in m/s²/N at frequency_hz (F,)."""
    iw = 2j * np.pi * np.asarray(frequency_hz)
    basis = 1 / (iw - solved.poles[..., None])  # (n, 2e, F)
    n, m = solved.poles.shape
    flat = solved.residues.reshape(n, m, 9)
    return (iw**2 * (np.swapaxes(flat, 1, 2) @ basis)).reshape(n, 3, 3, -1)


def direct_accelerance(
    mass: np.ndarray,
    damping: np.ndarray,
    stiffness: np.ndarray,
    hit: np.ndarray,
    sensor: np.ndarray,
    frequency_hz: np.ndarray,
) -> np.ndarray:
    """The same (3, 3, F) for one pose by solving at each line: slow, the reference for tests."""
    lines = []
    for w in 2 * np.pi * np.asarray(frequency_hz):
        dynamic = stiffness - w**2 * mass + 1j * w * damping
        lines.append(-(w**2) * sensor @ scipy.linalg.solve(dynamic, hit.T.astype(complex)))
    return np.stack(lines, axis=-1)
