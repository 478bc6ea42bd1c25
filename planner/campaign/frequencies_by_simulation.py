"""Natural frequencies of measured poses, told from their FRFs by the simulation's own modes.

Where modes are close or records noisy, a modal analysis that knows nothing of the robot errs by
percents and does not know it. An identified simulation knows the shapes: beside what hits, chain
and readback leave open only frequency, damping and size of each counted mode are left to tell.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.dynamics.gradient import moved
from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import SimulatedModes
from planner.frf import synthesis
from planner.frf.frf import Frf
from planner.measurement.measured_frfs import Measured, cut_off, matrices_at, stack
from planner.measurement.nuisances import Tolerances, basis, real_rows

LINES, LEAST, MOST = 600, 40, 120  # of all poses together, and of one at least and at most
MODEL_ERROR = 0.01  # relative sd of what no simulation follows; as for FRFs
# Before: sds of ln f, of ln ζ and of a residue's relative change.
FREQUENCY, DAMPING, SIZE = 0.05, 0.3, 0.1
ROUNDS = 2  # after the first: frequencies a percent off are beyond the first order
# Of a pose's FRFs: what is left of them, relative, from which the simulation tells nothing there.
# And sd of ln f from which it tells nothing of a mode. Chosen.
TOO_WRONG, UNKNOWN = 0.15, 0.02
LARGEST = 0.95  # damping ratio of what oscillates


def tuned_frequencies(
    simulation: Simulation,
    frfs: Sequence[Frf],
    q: np.ndarray,
    band_hz: tuple[float, float],
    tolerances: Tolerances,
    count: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Hz (n, count) of the first modes at q (n, dof) in rad, from the tool's FRFs there, and sds.

    NaN where the simulation can't tell.
    """
    lines = int(np.clip(LINES // len(frfs), LEAST, MOST))
    measured = stack(frfs, band_hz, lines, MODEL_ERROR)
    matrices = matrices_at(simulation.elastic, q, frfs)
    s = measured.s
    motion = moved(matrices, simulation.elasticity, s, matrices.mass)
    h = motion.accelerance
    if np.isfinite(measured.tail_s).any():
        h = h - cut_off(simulation.poles(q), s, measured.tail_s)
    open_ = basis(h, motion, s, tolerances)
    modes = simulation.modes(q, count)
    told = [_told(modes[i], measured, h[i], open_[i], i) for i in range(len(q))]
    hertz, sd = (np.array(values) for values in zip(*told, strict=True))
    return hertz, hertz * sd


def _told(
    modes: SimulatedModes, measured: Measured, h: np.ndarray, open_: np.ndarray, i: int
) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (count,) at pose i and sds of ln f; NaN where they are not told."""
    count, known = len(modes.frequency_hz), np.isfinite(modes.frequency_hz)
    own = modes[known]
    rest = h - _sum_of(own, measured.s[i])
    change, sd, wrong = _change(own, measured, rest, open_, i)
    for _ in range(ROUNDS):
        own = replace(
            own,
            frequency_hz=own.frequency_hz * np.exp(FREQUENCY * change[0]),
            damping_ratio=np.minimum(own.damping_ratio * np.exp(DAMPING * change[1]), LARGEST),
        )
        change, sd, wrong = _change(own, measured, rest, open_, i)
    hertz, sds = np.full((2, count), np.nan)
    if not wrong:
        hertz[known] = own.frequency_hz * np.exp(FREQUENCY * change[0])
        sds[known] = FREQUENCY * sd
    return hertz, np.where(sds < UNKNOWN, sds, np.nan)


def _sum_of(modes: SimulatedModes, s: np.ndarray) -> np.ndarray:
    """Accelerance (3, 3, F) of k modes at s (F,)."""
    pole = synthesis.pole(modes.frequency_hz, modes.damping_ratio)[:, None, None, None]
    residue = modes.residue[..., None]
    return np.sum(s**2 * (residue / (s - pole) + residue.conj() / (s - pole.conj())), axis=0)


def _change(
    modes: SimulatedModes, measured: Measured, rest: np.ndarray, open_: np.ndarray, i: int
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Changes of ln f and ln ζ (2, k) in their sds before, that of ln f's sd (k,), to first order.

    And whether what is left is too much; `rest` (3, 3, F) is the response without these modes.
    """
    used = measured.used[i]
    sd = np.where(used, measured.sd[i], np.inf)
    off = np.where(used, measured.accelerance[i] - rest - _sum_of(modes, measured.s[i]), 0.0)
    tuning, size = _by_modes(modes, measured.s[i])
    weight = np.sqrt(2) / sd
    rows = real_rows(weight * np.concatenate([tuning, open_, size]))
    r = real_rows((weight * off)[None])[0]
    covariance = np.linalg.inv(np.eye(len(rows)) + rows @ rows.T)
    best = covariance @ (rows @ r)
    left = r - best @ rows  # once all that is open is at its best
    misfit = float(left @ left) / max(2 * np.count_nonzero(used), 1)
    spread = np.sqrt(np.diagonal(covariance) * max(misfit, 1.0))
    noise = np.where(used, sd, 0.0) ** 2
    square = np.abs(np.where(used, measured.accelerance[i], 0.0)) ** 2
    residual = np.abs(left.view(complex).reshape(off.shape) / np.where(used, weight, 1.0)) ** 2
    wrong = np.sum(np.where(used, residual - noise, 0.0)) > TOO_WRONG**2 * np.sum(square)
    change, count = best[: len(tuning)].reshape(2, -1), len(tuning) // 2
    return change, spread[:count], bool(wrong)


def _by_modes(modes: SimulatedModes, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Changes (2k, 3, 3, F) of FRFs by an sd of ln f, then of ln ζ, and (2k, …) of residues."""
    zeta, residue = modes.damping_ratio, modes.residue[..., None]
    pole = synthesis.pole(modes.frequency_hz, zeta)[:, None, None, None]
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
