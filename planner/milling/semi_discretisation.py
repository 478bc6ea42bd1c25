"""Semi-discretisation as it was first given: the check of, and the yardstick for, the full one.

Over each of m equal steps of a period the directional matrix is its average and the vibration of
the tooth before the mean of the step's ends (Insperger and Stépán, Int. J. Numerical Methods in
Engineering 61, 2004). The error falls with the square of the step. Teeth follow at equal angles.
"""

import numpy as np
from scipy.linalg import expm

from planner.errors import InputError
from planner.milling.cutter_modes import CutterModes
from planner.milling.directional import step_matrices
from planner.milling.machine import Machine, Monodromies

STEPS, PER_RADIAN = 24, 3.0  # of a period, and more per radian of the fastest mode: for 1 %


def steps(machine: Machine, rpm: float) -> int:
    """How many a period has, so that depths are within about 1 %."""
    angle = machine.fastest * 60 / (rpm * machine.cut.teeth)
    return int(np.ceil(STEPS + PER_RADIAN * angle))


def semi_monodromies(machine: Machine, rpm: float, factor: float = 1.0) -> Monodromies:
    """A function of depths that gives their monodromy matrices."""
    if not machine.cut.even:
        raise InputError(
            "The semi-discretisation knows teeth at equal angles only; choose the method "
            "full_discretisation for pitch_deg."
        )
    count = int(np.ceil(factor * steps(machine, rpm)))
    return lambda depths: [semi_monodromy(machine, rpm, count, float(b)) for b in depths]


def semi_monodromy(machine: Machine, rpm: float, count: int, depth: float) -> np.ndarray:
    """Of `count` steps at a depth, over states and (count) displacements of the cutter before."""
    free, push, seen = first_order(machine.modes)
    tau = 60 / (rpm * machine.cut.teeth)
    force = depth * step_matrices(machine.cut, machine.coefficients, count, depth)
    # A residual compliance gives way at once: F = bA(Cz + DF − u before) is solved for F.
    rest = machine.modes.residual
    force = np.linalg.solve(np.eye(2) - force @ rest, force)
    size, step = len(free), tau / count
    forced = push @ force  # (m, s, 2)
    # One exponential of [[A, B], [0, 0]] holds the transition and the integral of the force.
    both = np.zeros((count, size + 2, size + 2))
    both[:, :size, :size] = free + forced @ seen
    both[:, :size, size:] = -forced
    both = expm(both * step)
    total = size + 2 * count
    state = np.eye(size, total)
    past = [np.eye(2, total, size + 2 * i) for i in range(count)]  # latest first
    for i in range(count):
        before = (past[-1] + past[-2]) / 2
        moved = seen @ state
        now = moved + rest @ force[i] @ (moved - before)
        state = both[i, :size, :size] @ state + both[i, :size, size:] @ before
        past = [now, *past[:-1]]
    return np.concatenate([state, *past])


def first_order(modes: CutterModes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Real matrices A (s, s), B (s, 2), C (2, s) of ż = Az + BF, u = Cz."""
    real, imag = np.diag(modes.poles.real), np.diag(modes.poles.imag)
    free = np.block([[real, -imag], [imag, real]])
    push = np.concatenate([modes.drives.real, modes.drives.imag])
    shapes = modes.shapes * modes.weight[:, None]
    seen = np.concatenate([shapes.real, -shapes.imag]).T
    return free, push, seen
