"""Decays that the end of a record cuts off: what the FRFs lack by it, from a simulation.

A pulse's response is a sum of decays; cut at T it loses ∫ from T of each, which in the transform
is R λ² e^((λ−s)T) / (s−λ) for a pole λ with residue R of the receptance.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.dynamics.gradient import laplace
from planner.dynamics.simulation import Elasticity, Simulation
from planner.dynamics.vibration import Poles, solve_poles
from planner.frf.frf import Frf
from planner.robot.elastic_model import Matrices

OVER = -12.0  # Re λ T below which a decay is over: less than 1e-5 of it is left
NEGLIGIBLE = 0.02
STEP = 1e-4  # of a logarithm
INERTIAL_STEP = 1e-3  # of an sd


@dataclass(frozen=True, eq=False)
class Completion:
    """What the records lack at given springs: `values` (n, 3, 3, F) in m/s²/N.

    `slope` (n, 2e or 3e, + R, 3, 3, F) is with respect to the springs' logarithms, then to R
    inertial parameters; None where the values are taken to hold everywhere.
    """

    values: np.ndarray
    slope: np.ndarray | None


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


def completion(
    matrices: Matrices,
    elasticity: Elasticity,
    mass: np.ndarray,
    s: np.ndarray,
    tail_s: np.ndarray,
    sd: np.ndarray,
    mass_slope: np.ndarray | None = None,
    sloped: bool = True,
) -> Completion | None:
    """Completion at springs and mass matrices (n, e, e); its slope by differences, or None.

    `mass_slope` (R, n, e, e): of the masses with respect to parameters that follow the springs.

    None where what is cut off is lost in the noise of sd (n, 3, 3, F).
    """

    def lost(springs: Elasticity, mass: np.ndarray = mass) -> np.ndarray:
        stiffness = np.diag(springs.stiffness * (1 + 1j * springs.loss_factor))
        solved = solve_poles(
            mass,
            np.diag(springs.damping),
            stiffness + matrices.geometric,
            matrices.hit,
            matrices.sensor,
        )
        return cut_off(solved, s, tail_s)

    kinds = ("stiffness", "damping", "loss_factor")[: 3 if elasticity.loss_factor.any() else 2]
    values, slopes = lost(elasticity), []
    if np.all(np.abs(values) < NEGLIGIBLE * sd):
        return None
    if not sloped:
        return Completion(values, None)
    for kind in kinds:
        for j, value in enumerate(getattr(elasticity, kind)):
            moved = getattr(elasticity, kind).copy()
            moved[j] *= np.exp(STEP)
            same = value == 0
            after = values if same else lost(replace(elasticity, **{kind: moved}))
            slopes.append((after - values) / STEP)
    for change in () if mass_slope is None else mass_slope:
        moves = bool(np.any(change))
        after = lost(elasticity, mass + INERTIAL_STEP * change) if moves else values
        slopes.append((after - values) / INERTIAL_STEP)
    return Completion(values, np.stack(slopes, axis=1))
