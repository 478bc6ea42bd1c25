"""Decays that the end of a record cuts off: what the FRFs lack by it, from a simulation.

A pulse's response is a sum of decays; cut at T it loses ∫ from T of each, which in the transform
is R λ² e^((λ−s)T) / (s−λ) for a pole λ with residue R of the receptance.
"""

from dataclasses import replace

import numpy as np

from planner.dynamics.gradient import laplace
from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import Poles
from planner.frf.frf import Frf

OVER = -12.0  # Re λ T below which a decay is over: less than 1e-5 of it is left


def cut_off(solved: Poles, s: np.ndarray, tail_s: np.ndarray) -> np.ndarray:
    """(n, 3, 3, F) in m/s²/N at s (n, F) for records that end tail_s (n,) after the pulse.

    With loss factors, of the poles of K(1 + iη) those with a negative imaginary part grow: what is
    recorded has the conjugates of the others in their place.
    """
    out = np.zeros((*solved.residues.shape[:1], *solved.residues.shape[2:], s.shape[1]), complex)
    for i in np.flatnonzero(np.isfinite(tail_s)):
        alive = solved.poles[i].real * tail_s[i] > OVER
        if solved.structural:
            alive &= (solved.poles[i].imag > 0) & (solved.poles[i].real < 0)
        if not alive.any():
            continue
        pole = solved.poles[i, alive][:, None]
        flat = solved.residues[i, alive].reshape(len(pole), -1)
        if solved.structural:
            pole, flat = np.concatenate([pole, pole.conj()]), np.concatenate([flat, flat.conj()])
        lost = pole**2 * np.exp((pole - s[i]) * tail_s[i]) / (s[i] - pole)
        out[i] = (flat.T @ lost).reshape(out[i].shape)
    return out


def completed(frf: Frf, simulation: Simulation, q: np.ndarray) -> Frf:
    """An FRF at q (dof,) in rad with the decays that its records cut off, as a simulation has them.

    As it is where it is known not to lack any.
    """
    if not np.isfinite(frf.tail_s):
        return frf
    above = frf.frequency_hz > 0
    s = laplace(frf.frequency_hz[above], frf.exponential_rate_1_s)
    solved = simulation.solved(simulation.elastic.matrices(q[None], layout=frf.layout))
    values = frf.accelerance.copy()
    values[..., above] += cut_off(solved, s, np.array([frf.tail_s]))[0]
    return replace(frf, accelerance=values, tail_s=float("inf"))
