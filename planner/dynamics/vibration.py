"""Linear vibration of M ẍ + C ẋ + K x = Jᵀ f: modes and FRFs, batched over poses.

Everything is exact for any viscous C: the state-space eigenproblem is solved in the coordinates
of the undamped modes, real (overdamped) poles included (Géradin & Rixen 2015, chapter 3). Where
gravity is stronger than the springs (ω² < 0) a mode does not oscillate either. With structural
damping K is complex; FRFs then hold for positive frequencies, as they are measured.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from planner.inference.covariance import eigen
from planner.inference.per_pose import PerPose

PROPORTIONAL = 1e-10  # off-diagonal modal damping below this is rounding
# A critically damped mode has a double pole, for which there is no residue: split by this share
# of |λ|, it errs by SPLIT² and its two large residues cancel to rounding / SPLIT, both ~ 1e-11.
SPLIT = 5e-6
# Structural damping turns the real poles of overdamped motion by less than η/4: not oscillations.
STRUCTURAL = 0.05  # |Im λ| / |λ| that makes an oscillation then
MANY = 100  # poses from which two threads are quicker than one


@dataclass(frozen=True, eq=False)
class Poles:
    """All 2e poles λ (n, 2e) in rad/s of n poses and their receptance residues (n, 2e, 3s, 3h).

    Receptance = Σ R/(iω−λ), in m/N; conjugate poles are both listed. With structural damping
    there are no conjugates, and the sum holds for ω > 0.
    """

    poles: np.ndarray
    residues: np.ndarray
    structural: bool = False


@dataclass(frozen=True, eq=False)
class SimulatedModes(PerPose):
    """Oscillatory modes of n poses, lowest first, NaN where there are fewer than `count`.

    frequency_hz (n, count), damping_ratio (n, count), residue (n, count, 3, 3) in m/(N·s).
    """

    frequency_hz: np.ndarray
    damping_ratio: np.ndarray
    residue: np.ndarray

    @property
    def shape(self) -> np.ndarray:
        """Response shapes (n, count, 3) of unit length; NaN where there is no mode."""
        known = np.all(np.isfinite(self.residue), axis=(2, 3))
        left = np.linalg.svd(np.where(known[..., None, None], self.residue, 0.0))[0][..., 0]
        return np.where(known[..., None], left, np.nan)


def solve_poles(
    mass: np.ndarray,
    damping: np.ndarray,
    stiffness: np.ndarray,
    hit: np.ndarray,
    sensor: np.ndarray,
) -> Poles:
    """Poles and residues of n poses.

    M (n, e, e); C (e, e); K (e, e) or (n, e, e), complex where damping is structural; Jacobians
    of hit (n, 3h, e) and sensor (n, 3s, e); without points residues are empty, which is quicker.
    """
    square, phi = normal_modes(mass, stiffness.real)
    gamma = np.swapaxes(phi, 1, 2) @ damping @ phi
    off = gamma - gamma * np.eye(gamma.shape[1])
    scale = np.max(np.abs(gamma), axis=(1, 2)) + 1e-300
    structural = np.iscomplexobj(stiffness) and bool(np.any(stiffness.imag))
    if structural:
        loss = np.swapaxes(phi, 1, 2) @ stiffness.imag @ phi
        poles, output, entry = _state_space(square, gamma, hit @ phi, sensor @ phi, loss)
    else:
        proportional = np.all(np.max(np.abs(off), axis=(1, 2)) <= PROPORTIONAL * scale)
        solve = _proportional if proportional else _state_space
        poles, output, entry = solve(square, gamma, hit @ phi, sensor @ phi)
    return Poles(poles, np.einsum("nik,nkj->nkij", output, entry), structural)


def normal_modes(mass: np.ndarray, stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Undamped modes of M and K (n, e, e): ω² (n, e), ascending, and mass-normalised shapes."""
    lower = np.linalg.cholesky(mass)  # M = L Lᵀ, and L⁻¹ K L⁻ᵀ is symmetric
    half = np.linalg.solve(lower, np.broadcast_to(stiffness, lower.shape))
    full = np.linalg.solve(lower, np.swapaxes(half, 1, 2))
    square, vectors = eigen((full + np.swapaxes(full, 1, 2)) / 2)
    return square, np.linalg.solve(np.swapaxes(lower, 1, 2), vectors)


def _proportional(
    square: np.ndarray, gamma: np.ndarray, hit: np.ndarray, sensor: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Each undamped mode is a mode of the damped system too: λ² + γλ + ω₀² = 0.

    Returns poles (n, 2e), how they show (n, 3, 2e), and how they are excited (n, 2e, 3).
    """
    rate = np.diagonal(gamma, axis1=1, axis2=2).astype(complex)
    root = np.sqrt(rate**2 / 4 - square)
    smallest = SPLIT * np.sqrt(np.abs(square))
    root = np.where(np.abs(root) < smallest, smallest, root)
    poles = np.concatenate([-rate / 2 + root, -rate / 2 - root], axis=1)
    norm = np.concatenate([2 * root, -2 * root], axis=1)
    output = np.concatenate([sensor, sensor], axis=2) / norm[:, None, :]
    return poles, output, np.swapaxes(np.concatenate([hit, hit], axis=2), 1, 2)


def _state_space(
    square: np.ndarray,
    gamma: np.ndarray,
    hit: np.ndarray,
    sensor: np.ndarray,
    loss: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same for any damping, from V⁻¹ rather than orthogonality, which coincident poles lack.

    In the state (Ω η, η̇) of modal coordinates η the undamped system is skew-symmetric, so that
    its eigenvectors are as well conditioned as they can be.
    """
    n, e = square.shape
    omega = np.sqrt(np.maximum(np.abs(square), np.finfo(float).tiny))
    state = np.zeros((n, 2 * e, 2 * e), dtype=float if loss is None else complex)
    state[:, :e, e:] = omega[:, :, None] * np.eye(e)
    state[:, e:, :e] = -np.sign(square)[:, :, None] * state[:, :e, e:]
    state[:, e:, e:] = -gamma
    if loss is not None:
        state[:, e:, :e] -= 1j * loss / omega[:, None, :]
    force = np.concatenate([np.zeros((n, e, hit.shape[1])), np.swapaxes(hit, 1, 2)], axis=1)
    poles, vectors, entry = _eigen(state, force)
    return poles, (sensor / omega[:, None, :]) @ vectors[:, :e], entry


def _eigen(state: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Eigenvalues, eigenvectors V and V⁻¹ force of many matrices, on as many cores as pay.

    Without columns of force the vectors are left out: 0.
    """

    def solve(part: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        if not force.shape[2]:
            return np.linalg.eigvals(state[part]).astype(complex), 0 * state[part], force[part]
        values, vectors = (found.astype(complex) for found in np.linalg.eig(state[part]))
        return values, vectors, np.linalg.solve(vectors, force[part].astype(complex))

    if len(state) < MANY:
        return solve(slice(None))
    half = len(state) // 2
    with ThreadPoolExecutor(2) as pool:  # LAPACK lets other threads run
        first, second = pool.map(solve, (slice(half), slice(half, None)))
    values, vectors, entry = (np.concatenate(pair) for pair in zip(first, second, strict=True))
    return values, vectors, entry


def oscillatory(solved: Poles, count: int) -> SimulatedModes:
    """The `count` lowest oscillatory modes, by natural frequency |λ|."""
    poles = solved.poles
    least = STRUCTURAL if solved.structural else 1e-9
    natural = np.where(poles.imag > least * np.abs(poles), np.abs(poles), np.inf)
    order = np.argsort(natural, axis=1, kind="stable")[:, :count]
    known = np.isfinite(np.take_along_axis(natural, order, axis=1))
    place = np.full((len(poles), count), -1)
    place[:, : order.shape[1]] = np.where(known, order, -1)
    every = SimulatedModes(natural / (2 * np.pi), -poles.real / natural, solved.residues)
    return picked(every, place)


def picked(modes: SimulatedModes, place: np.ndarray) -> SimulatedModes:
    """Each pose's modes at `place` (n, count) in their order, NaN where that is −1."""
    each = (np.concatenate([v, np.nan * v[:, :1]], axis=1) for v in vars(modes).values())
    return SimulatedModes(*(values[np.arange(len(place))[:, None], place] for values in each))


def receptance(solved: Poles, frequency_hz: np.ndarray) -> np.ndarray:
    """Receptance (n, 3s, 3h, F) in m/N at frequency_hz (F,)."""
    basis = 1 / (2j * np.pi * np.asarray(frequency_hz) - solved.poles[..., None])  # (n, 2e, F)
    n, m, *points = solved.residues.shape
    flat = solved.residues.reshape(n, m, -1)
    return (np.swapaxes(flat, 1, 2) @ basis).reshape(n, *points, -1)


def accelerance(solved: Poles, frequency_hz: np.ndarray) -> np.ndarray:
    """Accelerance (n, 3s, 3h, F) in m/s²/N at frequency_hz (F,)."""
    return (2j * np.pi * np.asarray(frequency_hz)) ** 2 * receptance(solved, frequency_hz)
