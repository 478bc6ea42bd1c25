"""Natural frequencies of measured poses, told from their FRFs by the simulation's own modes.

Where modes are close or records noisy, a modal analysis that knows nothing of the robot errs by
percents and does not know it. An identified simulation knows the shapes: beside what hits, chain
and readback leave open only frequency, damping and size of each counted mode are left to tell.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.dynamics.gradient import response_turned
from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import SimulatedModes
from planner.frf import synthesis
from planner.frf.frf import Frf
from planner.identification.measured_frfs import Measured, matrices_at, stack
from planner.identification.measurement_model import Tolerances, basis, real_rows
from planner.identification.truncated_decay import cut_off
from planner.surrogate.modal_surrogate import ModalObservations

LINES = 120  # a pose, at most
MODEL_ERROR = 0.01  # relative sd of what no simulation follows; as for FRFs
# Before: sds of ln f, of ln ζ and of a residue's relative change.
FREQUENCY, DAMPING, SIZE = 0.05, 0.3, 0.1
# Of a pose's FRFs: what is left of them, relative, from which the simulation tells nothing there.
# And sd of ln f from which it tells nothing of a mode. Chosen.
TOO_WRONG, UNKNOWN = 0.15, 0.02


@dataclass(frozen=True, eq=False)
class TunedFrequencies:
    """Frequencies and sds (n, count) in Hz, NaN where the simulation can't tell."""

    frequency_hz: np.ndarray
    sd_hz: np.ndarray

    def into(self, seen: ModalObservations) -> ModalObservations:
        """In place of those that the modal analysis found."""
        told = np.isfinite(self.sd_hz)
        return replace(
            seen,
            frequency_hz=np.where(told, self.frequency_hz, seen.frequency_hz),
            frequency_sd_hz=np.where(told, self.sd_hz, seen.frequency_sd_hz),
        )


def tuned_frequencies(
    simulation: Simulation,
    frfs: Sequence[Frf],
    q: np.ndarray,
    band_hz: tuple[float, float],
    tolerances: Tolerances,
    count: int,
) -> TunedFrequencies:
    """Of the first `count` modes at q (n, dof) in rad, from the tool's FRFs there."""
    measured = stack(frfs, band_hz, LINES, MODEL_ERROR)
    matrices = matrices_at(simulation.elastic, q, frfs, True)
    s = measured.s
    h, turned = response_turned(matrices, simulation.elasticity, s, matrices.mass)
    if np.isfinite(measured.tail_s).any():
        h = h - cut_off(simulation.poles(q), s, measured.tail_s)
    open_ = basis(h, turned, s, tolerances)
    modes = simulation.modes(q, count)
    told = [_told(_at(modes, i), measured, h[i], open_[i], i) for i in range(len(q))]
    change, sd = (np.array(values) for values in zip(*told, strict=True))
    hertz = modes.frequency_hz * np.exp(change)
    return TunedFrequencies(hertz, hertz * sd)


def _at(modes: SimulatedModes, i: int) -> SimulatedModes:
    return SimulatedModes(modes.frequency_hz[i], modes.damping_ratio[i], modes.residue[i])


def _told(
    modes: SimulatedModes, measured: Measured, h: np.ndarray, open_: np.ndarray, i: int
) -> tuple[np.ndarray, np.ndarray]:
    """Change of ln f (count,) at pose i and its sd; NaN where it is not told."""
    count = len(modes.frequency_hz)
    known = np.isfinite(modes.frequency_hz)
    used = measured.used[i]
    sd = np.where(used, measured.sd[i], np.inf)
    off = np.where(used, measured.accelerance[i] - h, 0.0)
    tuning, size = _by_modes(modes, known, measured.s[i])
    weight = np.sqrt(2) / sd
    columns = real_rows(weight * tuning)
    others = real_rows(weight * np.concatenate([open_, size]))
    r = real_rows((weight * off)[None])[0]
    factor = np.linalg.cholesky(np.eye(len(others)) + others @ others.T)
    own = np.linalg.solve(factor, others)
    across, along = own @ columns.T, own @ r
    covariance = np.linalg.inv(np.eye(len(columns)) + columns @ columns.T - across.T @ across)
    change = covariance @ (columns @ r - across.T @ along)
    # What is left once all that is open is at its best.
    eta = np.linalg.solve(factor.T, along - across @ change)
    left = r - columns.T @ change - others.T @ eta
    misfit = float(left @ left) / max(2 * np.count_nonzero(used), 1)
    spread = np.sqrt(np.diagonal(covariance) * max(misfit, 1.0))[: len(covariance) // 2]
    noise = np.where(used, sd, 0.0) ** 2
    square = np.abs(np.where(used, measured.accelerance[i], 0.0)) ** 2
    residual = np.abs(left.view(complex).reshape(off.shape) / weight.clip(1e-300)) ** 2
    wrong = np.sum(np.where(used, residual - noise, 0.0)) > TOO_WRONG**2 * np.sum(square)
    found, sds = np.full(count, np.nan), np.full(count, np.nan)
    if not wrong:
        found[known] = FREQUENCY * change[: len(spread)]
        sds[known] = FREQUENCY * spread
    told = sds < UNKNOWN
    return np.where(told, found, 0.0), np.where(told, sds, np.nan)


def _by_modes(
    modes: SimulatedModes, known: np.ndarray, s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Changes (2k, 3, 3, F) of FRFs by an sd of ln f, then of ln ζ, and (2k, …) of residues."""
    zeta, residue = modes.damping_ratio[known], modes.residue[known][..., None]
    pole = synthesis.pole(modes.frequency_hz[known], zeta)[:, None, None, None]
    by_damping = np.abs(pole[:, 0, 0, 0]) * zeta * (-1 - 1j * zeta / np.sqrt(1 - zeta**2))
    lift, lift_mirrored = s**2 / (s - pole), s**2 / (s - pole.conj())
    steep, steep_mirrored = lift / (s - pole), lift_mirrored / (s - pole.conj())
    moves = [FREQUENCY * pole, DAMPING * by_damping[:, None, None, None]]
    tuning = [
        residue * steep * moved + residue.conj() * steep_mirrored * moved.conj() for moved in moves
    ]
    turns = [SIZE, SIZE * 1j]
    size = [
        turn * residue * lift + np.conj(turn) * residue.conj() * lift_mirrored for turn in turns
    ]
    return np.concatenate(tuning), np.concatenate(size)
