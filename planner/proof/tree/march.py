"""Time integration: a linear system with springs and Maxwell ladders, and one nonlinear gear.

x = [q, v, y]: coordinates, rates, branch states. In complex modes of x the linear part is exact
(matrix exponential); force and nonlinear torque are taken as straight over a step:

    z+ = e^(L h) z + F0 u + F1 u+,   torque+ solved for with Newton at every step
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from planner.proof.tree.laws import RATES
from planner.proof.tree.system import System


@dataclass(frozen=True)
class FirstOrder:
    """x' = A x + B u + b t, outputs [angle, rate, 6 accelerations] = C x + D u + d t."""

    a: np.ndarray
    b: np.ndarray  # (states, 6 + 1), last column: torque on the nonlinear gear
    c: np.ndarray  # (8, states)
    d: np.ndarray  # (8, 7)


def first_order(system: System, gear: str) -> FirstOrder:
    """State form where all ties are mutual springs; `gear`: the tie with the torque."""
    size = len(system.mass)
    stiff, damp = system.gravity.copy(), system.spin.copy()
    ladders = [t for t in system.ties if t.law.loss]
    for tie in system.ties:
        law, dyad = tie.law, np.outer(tie.left, tie.left)
        stiff += (law.rest + law.branch * len(RATES)) * dyad
        damp += law.damping * dyad
    total = 2 * size + len(ladders) * len(RATES)
    a = np.zeros((total, total))
    a[:size, size : 2 * size] = np.eye(size)
    inverse = np.linalg.inv(system.mass)
    a[size : 2 * size, :size], a[size : 2 * size, size : 2 * size] = (
        -inverse @ stiff,
        -inverse @ damp,
    )
    at = 2 * size
    for tie in ladders:
        for rate in RATES:
            a[at, :size], a[at, at] = rate * tie.left, -rate
            a[size : 2 * size, at] = inverse @ tie.left * tie.law.branch
            at += 1
    row = next(t.left for t in system.ties if t.name == gear)
    b = np.zeros((total, 7))
    b[size : 2 * size] = inverse @ np.column_stack([system.load, row])
    c = np.zeros((8, total))
    c[0, :size], c[1, size : 2 * size] = row, row
    c[2:], d = system.sense @ a[size : 2 * size], np.zeros((8, 7))
    d[2:] = system.sense @ b[size : 2 * size]
    return FirstOrder(a, b, c, d)


def _weights(poles: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """e^(L h), and what a straight input's two ends give over a step."""
    x = poles * step
    decay = np.exp(x)
    small = np.abs(x) < 1e-4
    safe = np.where(small, 1.0, x)
    first = np.where(small, 1 + x / 2 + x**2 / 6, (decay - 1) / safe) * step
    late = np.where(small, 0.5 + x / 6 + x**2 / 24, (decay - 1 - x) / safe**2) * step
    return decay, first - late, late


@dataclass
class Batch:
    """Modal form of many hits at once, each with the matrices of its pose (hits first)."""

    decay: np.ndarray  # (hits, states)
    force: tuple[np.ndarray, np.ndarray]  # F0, F1 for the hit's own wrench (hits, states)
    torque: tuple[np.ndarray, np.ndarray]  # F0, F1 for the gear's torque
    out: np.ndarray  # (hits, states, 8), twice the weight of a conjugate pair
    through: np.ndarray  # (hits, 8) from the force
    through_torque: np.ndarray  # (hits, 8)


def batch(forms: list[FirstOrder], wrenches: np.ndarray, step: float) -> Batch:
    """One form and one unit wrench (6) a hit; forms of equal hits may be the same object."""
    known: dict[int, tuple] = {}
    rows = []
    for form, wrench in zip(forms, wrenches, strict=True):
        if id(form) not in known:
            poles, shapes = np.linalg.eig(form.a)
            some = poles.imag > -1e-9 * np.abs(poles).max()
            weight = np.where(np.abs(poles[some].imag) < 1e-9 * np.abs(poles).max(), 1.0, 2.0)
            inverse = np.linalg.inv(shapes)[some]
            known[id(form)] = poles[some], inverse @ form.b, (form.c @ shapes[:, some] * weight).T
        poles, drive, out = known[id(form)]
        decay, early, late = _weights(poles, step)
        push = drive[:, :6] @ wrench
        rows.append((
            decay, early * push, late * push, early * drive[:, 6], late * drive[:, 6], out,
            form.d[:, :6] @ wrench, form.d[:, 6],
        ))  # fmt: skip
    size = max(len(r[0]) for r in rows)
    parts = [
        np.array([np.pad(r[i], [(0, size - len(r[i]))] + [(0, 0)] * (r[i].ndim - 1))
                  if i < 6 else r[i] for r in rows])
        for i in range(8)
    ]  # fmt: skip
    return Batch(parts[0], (parts[1], parts[2]), (parts[3], parts[4]), parts[5], parts[6], parts[7])


def march(setup: Batch, force: np.ndarray, law: Any) -> np.ndarray:
    """(hits, 8, steps) outputs under `force` (hits, steps) in N; `law` (or None) is vectorised."""
    hits, steps = force.shape
    answer = np.zeros((steps, hits, 8))
    state = np.zeros(setup.decay.shape, complex)
    torque, angle = np.zeros(hits), np.zeros(hits)
    gain = np.einsum("hs,hso->ho", setup.torque[1], setup.out).real + setup.through_torque
    carry = setup.decay * setup.torque[1] + setup.torque[0]
    push = setup.decay * setup.force[1] + setup.force[0]
    # `state` is held without the share of the step's own end: that is added in the outputs.
    ahead = np.einsum("hs,hso->ho", setup.force[1], setup.out).real + setup.through
    for k in range(steps):
        if k:
            state *= setup.decay
            state -= carry * torque[:, None]
            before = force[:, k - 1]
            if before.any():
                state += push * before[:, None]
        free = np.matmul(state[:, None, :], setup.out)[:, 0].real + ahead * force[:, k : k + 1]
        if law is not None:
            torque = _solve(law, free, gain, angle, torque)
            free -= gain * torque[:, None]
        angle = free[:, 0].copy()
        answer[k] = free
    return np.moveaxis(answer, 0, -1)


def _solve(law, free, gain, before, memory) -> np.ndarray:
    """The torque at a step's end, with angle = free - gain torque; Newton, at most 8 times."""
    torque = memory
    for _ in range(8):
        value, by_x, by_v = law.torque(
            free[:, 0] - gain[:, 0] * torque, free[:, 1] - gain[:, 1] * torque, before, memory
        )
        move = (value - torque) / (1 + by_x * gain[:, 0] + by_v * gain[:, 1])
        torque = torque + move
        if np.abs(move).max() <= 1e-7 * np.abs(torque).max() + 1e-9:
            break
    return torque
