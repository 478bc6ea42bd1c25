"""A cantilever beam on a roller: finite elements of Euler and Bernoulli (Géradin & Rixen 2015)."""

import numpy as np
import scipy.linalg

LENGTH_M, WIDTH_M, HEIGHT_M = 0.501, 0.051, 0.00666
STEEL_PA, STEEL_KG_M3 = 205e9, 7850.0
ROLLER_N_M = 1e8
ELEMENTS = 20
TURN = np.diag([1.0, LENGTH_M / ELEMENTS] * 2)


def free_beam():
    """Stiffness and mass of the beam without clamp and roller."""
    step, size = LENGTH_M / ELEMENTS, 2 * ELEMENTS + 2
    stiffness, mass = np.zeros((2, size, size))
    bending = STEEL_PA * WIDTH_M * HEIGHT_M**3 / 12 / step**3
    inertia = STEEL_KG_M3 * WIDTH_M * HEIGHT_M * step / 420
    k = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]])
    m = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]])
    for element in range(ELEMENTS):
        part = slice(2 * element, 2 * element + 4)
        stiffness[part, part] += bending * TURN @ k @ TURN
        mass[part, part] += inertia * TURN @ m @ TURN
    return stiffness, mass


FREE = free_beam()


def first_hz(roller_m, modulus=1.0, tip_kg=0.0, clamp_n_m_rad=np.inf):
    """First natural frequency with the roller at a distance from the clamp.

    `modulus` is times that of steel, `tip_kg` a mass at the free end, `clamp_n_m_rad` the clamp's
    stiffness against tilting.
    """
    step, size = LENGTH_M / ELEMENTS, 2 * ELEMENTS + 2
    stiffness, mass = modulus * FREE[0], FREE[1].copy()
    element = min(max(int(roller_m / step), 0), ELEMENTS - 1)
    t = roller_m / step - element
    shape = TURN @ [1 - 3 * t**2 + 2 * t**3, t - 2 * t**2 + t**3, 3 * t**2 - 2 * t**3, t**3 - t**2]
    part = slice(2 * element, 2 * element + 4)
    stiffness[part, part] += ROLLER_N_M * np.outer(shape, shape)
    mass[-2, -2] += tip_kg
    if np.isfinite(clamp_n_m_rad):
        stiffness[1, 1] += clamp_n_m_rad
        kept = np.arange(1, size)
    else:
        kept = np.arange(2, size)
    square = scipy.linalg.eigh(
        stiffness[np.ix_(kept, kept)], mass[np.ix_(kept, kept)],
        eigvals_only=True, subset_by_index=[0, 0],
    )  # fmt: skip
    return float(np.sqrt(square[0]) / (2 * np.pi))
