"""First-order semi-discretisation, as it was first given; the check of the full one.

Over each of m equal steps of a tooth's period the directional matrix is its average and the
vibration of the tooth before the mean of the step's ends (Insperger and Stépán, Int. J. Numerical
Methods in Engineering 61, 2004). The error falls with the square of the step. Teeth follow at equal
angles.
"""

import numpy as np
from scipy.linalg import expm

from planner.errors import InputError
from planner.milling.directional import tooth_matrix
from planner.milling.machine import Machine, Monodromies

STEPS, PER_RADIAN = 24, 3.0  # of a period, and more per radian of the fastest mode: for 1 %
AVERAGED = 16  # points of a step, over which the directional matrix is averaged


def semi_monodromies(machine: Machine, rpm: float, factor: float) -> Monodromies:
    """A function of depths in m that gives their monodromy matrices; `factor` multiplies steps.

    Raises InputError where teeth do not follow at equal angles.
    """
    if not machine.cut.even:
        raise InputError(
            "The semi-discretisation knows teeth at equal angles only; choose the method "
            "full_discretisation for pitch_deg."
        )
    angle = machine.fastest * 60 / (rpm * machine.cut.teeth)
    count = int(np.ceil(factor * np.ceil(STEPS + PER_RADIAN * angle)))
    return lambda depths: [semi_monodromy(machine, rpm, count, float(b)) for b in depths]


def semi_monodromy(machine: Machine, rpm: float, count: int, depth: float) -> np.ndarray:
    """Of `count` steps at a depth in m, over states and (count) displacements before."""
    modes, cut = machine.modes, machine.cut
    tau = 60 / (rpm * cut.teeth)
    # A residual compliance gives way at once: F = bA(Cz + DF − u before) is solved for F.
    rest, force = modes.residual, depth * _step_matrices(machine, count, depth)
    force = np.linalg.solve(np.eye(2) - force @ rest, force)
    real, imag = np.diag(modes.poles.real), np.diag(modes.poles.imag)
    push = np.concatenate([modes.drives.real, modes.drives.imag])
    seen = 2 * np.concatenate([modes.shapes.real, -modes.shapes.imag]).T
    size, forced = len(push), push @ force
    # One exponential of [[A, B], [0, 0]] holds the transition and the integral of the force.
    both = np.zeros((count, size + 2, size + 2))
    both[:, :size, :size] = np.block([[real, -imag], [imag, real]]) + forced @ seen
    both[:, :size, size:] = -forced
    both = expm(both * tau / count)
    state = np.eye(size, size + 2 * count)
    past = [np.eye(2, size + 2 * count, size + 2 * i) for i in range(count)]  # latest first
    for step, pushed in zip(both, force, strict=True):
        before, moved = (past[-1] + past[-2]) / 2, seen @ state
        state = step[:size, :size] @ state + step[:size, size:] @ before
        past = [moved + rest @ pushed @ (moved - before), *past[:-1]]
    return np.concatenate([state, *past])


def _step_matrices(machine: Machine, count: int, depth: float) -> np.ndarray:
    """(count, 2, 2) in N/m² of all teeth, averaged over equal steps of a tooth's period."""
    cut, (start, _) = machine.cut, machine.cut.immersion_rad
    fine = count * AVERAGED
    edges = start + 2 * np.pi / cut.teeth * (np.arange(fine) + 0.5) / fine
    # Every tooth, in this turn and the next: a helix may still cut where its tip has left.
    tips = edges[:, None] + 2 * np.pi / cut.teeth * np.arange(2 * cut.teeth)
    total = tooth_matrix(cut, tips, depth).sum(axis=1)
    return np.mean(np.reshape(total, (count, AVERAGED, 2, 2)), axis=1)
