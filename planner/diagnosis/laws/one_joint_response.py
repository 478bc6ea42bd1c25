"""Hits on a simulation with one nonlinear joint, integrated in time, many at once.

The linear part is propagated exactly pole by pole, for torques that are linear between steps; each
step solves for the joint's angle by Newton's method. The response follows from the spectrum of the
torque, so that only the joint itself is integrated.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy import signal

from planner import jax_setup
from planner.dataset.level_columns import Column
from planner.diagnosis.laws.equivalent_stiffness import System
from planner.diagnosis.laws.open_misses import stronger
from planner.diagnosis.laws.torque_laws import Law, Step

FINER = 5  # steps a sample
LASTS_S = 1.3  # after the pulse; the window makes the rest of no account
FASTEST = 3.0  # times the band's end: poles beyond follow at once
NEWTON = 3
POLES, COLUMNS, STEPS = 4, 512, 256  # that are integrated at a time, or a multiple


@dataclass(frozen=True, eq=False)
class Strokes:
    """Forces (c, n) in N of c hits on a fine grid; time 0 of each is `zero_s` (c,) after step 0."""

    step_s: float
    force: np.ndarray
    zero_s: np.ndarray
    visit: np.ndarray
    axis: np.ndarray


def strokes(
    visits: Sequence[int],
    columns: Sequence[Column],
    finer: int = FINER,
    lasts_s: float = LASTS_S,
) -> Strokes:
    """One hit of each column; `visits` (c,) says where."""
    rate = columns[0].hits[0].sampling_rate_hz
    count = int(lasts_s * rate) * finer
    force, zero = np.zeros((len(columns), count)), np.zeros(len(columns))
    for row, column in enumerate(columns):
        hit = column.hits[0]
        first, end = hit.pulse.around(len(hit.force_n))
        part = hit.sign * (hit.force_n[first:end] - hit.pulse.offset_n)
        fine = stronger(column) * np.asarray(signal.resample(part, finer * len(part)))
        force[row, : min(len(fine), count)] = fine[:count]
        zero[row] = (hit.pulse.peak - first) / rate
    axes = np.array([column.axis for column in columns])
    return Strokes(1 / (rate * finer), force, zero, np.asarray(visits), axes)


@dataclass(frozen=True, eq=False)
class Seen:
    """What a port sees of a system: own response pole by pole, and its angles without a torque.

    grow, drive (p, c): z ← grow z + drive τ gives what earlier torques leave; `gives` (c,) is the
    angle that a torque gives within its own step; `free` (n, c) in rad.
    """

    grow: np.ndarray
    drive: np.ndarray
    gives: np.ndarray
    free: np.ndarray


def seen(system: System, port: int, hits: Strokes, fastest_hz: float) -> Seen:
    """The port's poles and its angles without a torque, for every hit; `port` is its number."""
    n = len(system.mass)
    e = len(system.elasticity.stiffness)
    block = int(system.blocks[port])
    most = e
    poles = np.full((n, most), -1.0 + 0j)
    own, struck = np.zeros((n, most), dtype=complex), np.zeros((n, most, 3), dtype=complex)
    static, static_hit = np.zeros(n), np.zeros((n, 3))
    for i in range(n):
        lam, shapes, entry = modal(system, i)
        at = shapes[block]
        mine, hit = at * entry[:, block], at[:, None] * (entry @ system.hit[i].T)
        slow = np.abs(lam) < 2 * np.pi * fastest_hz
        static[i] = float(np.sum((-mine / lam)[~slow]).real)
        static_hit[i] = np.sum((-hit / lam[:, None])[~slow], axis=0).real
        count = min(int(slow.sum()), most)
        order = np.argsort(np.abs(lam[slow]))[:count]
        poles[i, :count] = lam[slow][order]
        own[i, :count], struck[i, :count] = mine[slow][order], hit[slow][order]
    used = np.any(own != 0, axis=0)
    poles, own, struck = poles[:, used], own[:, used], struck[:, used]
    grow, older, newer = weights(poles, hits.step_s)
    free = np.empty((hits.force.shape[1], len(hits.visit)))
    for i in range(n):
        here = np.flatnonzero(hits.visit == i)
        weight = struck[i][:, hits.axis[here]]  # (p, c)
        free[:, here] = free_angles(hits, here, poles[i], weight, (grow[i], older[i], newer[i]))
        free[:, here] += static_hit[i, hits.axis[here]] * hits.force[here].T
    v = hits.visit
    drive = own * (newer + older / grow)
    gives = np.sum(own * newer, axis=1).real + static
    return Seen(grow[v].T.copy(), drive[v].T.copy(), gives[v], free)


def side_by_side_views(ports: Sequence[Seen]) -> Seen:
    """Several ports as one with the columns of all, poles filled up to as many as any has."""
    most = max(len(p.grow) for p in ports)

    def padded(values: np.ndarray) -> np.ndarray:
        return np.pad(values, ((0, most - len(values)), (0, 0)))

    return Seen(
        np.concatenate([padded(p.grow) for p in ports], axis=1),
        np.concatenate([padded(p.drive) for p in ports], axis=1),
        np.concatenate([p.gives for p in ports]),
        np.concatenate([p.free for p in ports], axis=1),
    )


def free_angles(
    hits: Strokes,
    here: np.ndarray,
    poles: np.ndarray,
    weight: np.ndarray,
    rule: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> np.ndarray:
    """Angles (n, c) of hits `here` on poles (p,), with weights (p, c): driven, then free."""
    force = hits.force[here]
    n = force.shape[1]
    last = 1 + int(np.max(np.flatnonzero(np.any(force != 0, axis=0)), initial=1))
    out, left = np.zeros((n, len(here))), np.zeros((len(poles), len(here)), dtype=complex)
    for k, (grow, older, newer) in enumerate(zip(*rule, strict=True)):
        driven = force[:, :last].astype(complex)
        y = np.asarray(signal.lfilter([newer, older], [1.0, -grow], driven, axis=1))
        out[:last] += (y.T * weight[k]).real
        left[k] = y[:, -1] * weight[k]
    decay = np.exp(np.outer(np.arange(1, n - last + 1) * hits.step_s, poles))
    out[last:] = decay.real @ left.real - decay.imag @ left.imag
    return out


def modal(system: System, visit: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poles (p,), shapes (e, p), entries (p, e); conjugates are in the shapes' factor 2.

    A loss factor damps each mode as it does at the mode's own frequency, to first order.
    """
    springs = system.elasticity
    e = len(springs.stiffness)
    inverse = np.linalg.inv(system.mass[visit])
    stiffness = np.diag(springs.stiffness) + system.geometric[visit]
    state = np.zeros((2 * e, 2 * e))
    state[:e, e:] = np.eye(e)
    state[e:, :e] = -inverse @ stiffness
    state[e:, e:] = -inverse * springs.damping
    poles, vectors = np.linalg.eig(state)
    entry = np.linalg.inv(vectors)[:, e:] @ inverse
    lost = springs.stiffness * springs.loss_factor * np.sign(poles.imag)[:, None]
    poles = poles - 1j * np.einsum("pe,pe,ep->p", entry, lost, vectors[:e])
    one = poles.imag >= 0
    twice = np.where(poles.imag[one] > 0, 2.0, 1.0)
    return poles[one], vectors[:e, one] * twice, entry[one]


def weights(pole: np.ndarray, step_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """y(t+h) = grow y(t) + older f(t) + newer f(t+h) for y' = λy + f, f linear between."""
    z = pole * step_s
    grow = np.exp(z)
    newer = (grow - 1 - z) / (z * pole)
    return grow, (grow - 1) / pole - newer, newer


def torques(
    laws: Sequence[tuple[Law, slice]],
    k: np.ndarray,
    a: np.ndarray,
    extra: np.ndarray,
    port: Seen,
    rest: np.ndarray | None = None,
) -> np.ndarray:
    """Torque (n, c) of every hit: its law's, and `extra` (c,) times the angle.

    `laws` says which columns follow which law; k, a (c,) are its numbers, `rest` (c,) its state
    before.
    """
    n, c = port.free.shape
    rest = np.zeros(c) if rest is None else rest
    out = np.empty((n, c))
    for law, part in laws:
        for first in range(part.start, part.stop, COLUMNS):
            some = slice(first, min(first + COLUMNS, part.stop))
            numbers = [_filled(v[some], 1.0) for v in (k, a, extra, port.gives, rest)]
            poles = [_filled(v[:, some]) for v in (port.grow, port.drive)]
            free = _filled(port.free[:, some], sizes=(STEPS, COLUMNS))
            torque = _torques(law.step, *numbers, *poles, free)
            out[:, some] = torque[:n, : some.stop - first]
    return out


def _filled(
    values: np.ndarray, value: float = 0.0, sizes: tuple[int, ...] = (POLES, COLUMNS)
) -> np.ndarray:
    """Up to multiples of these sizes: what is compiled once serves for other recordings."""
    more = [(0, -n % size) for n, size in zip(values.shape, sizes[-values.ndim :], strict=True)]
    return np.pad(values, more, constant_values=value)


@jax_setup.compiled("quick", static_argnums=0)
def _torques(
    step: Step,
    k: Array,
    a: Array,
    extra: Array,
    gives: Array,
    rest: Array,
    grow: Array,
    drive: Array,
    free: Array,
) -> Array:
    """Torque (n, c) of c hits on joints that follow one law."""
    least = jnp.where(jnp.abs(gives) > 0, gives, 1e-30)

    def following(carry: tuple[Array, ...], alone: Array) -> tuple[tuple[Array, ...], Array]:
        real, imaginary, before, state, rise = carry
        real, imaginary = (
            real * grow.real - imaginary * grow.imag,
            real * grow.imag + imaginary * grow.real,
        )
        left, now, after = alone - jnp.sum(real, axis=0), before + rise, state
        for _ in range(NEWTON):
            value, slope, after = step(jnp, k, a, state, before, now)
            error = now + gives * (value + extra * now) - left
            now = now - error / jnp.maximum(1 + gives * (slope + extra), 0.2)
        torque = (left - now) / least
        real, imaginary = real + drive.real * torque[None], imaginary + drive.imag * torque[None]
        return (real, imaginary, now, after, now - before), torque

    z, still = jnp.zeros(grow.shape), jnp.zeros(k.shape)
    return jax.lax.scan(following, (z, z, still, rest, still), free)[1]


def spectra(torque: np.ndarray, hits: Strokes, s: np.ndarray) -> np.ndarray:
    """∫ τ e^(−st) dt (k, F) of torques (n, k) that are linear between steps; s (F,).

    All c hits in turn, once or several times.
    """
    turn = kernel(len(torque), hits, s)
    sums = (turn.real @ torque + 1j * (turn.imag @ torque)).T
    return (sums.reshape(-1, len(hits.visit), len(s)) * scale(hits, s)).reshape(sums.shape)


def kernel(count: int, hits: Strokes, s: np.ndarray) -> np.ndarray:
    """e^(−st) (F, n) at `count` steps."""
    return np.exp(-np.outer(s, np.arange(count) * hits.step_s))


def scale(hits: Strokes, s: np.ndarray) -> np.ndarray:
    """(c, F) by which sums over e^(−st) become integrals, time being 0 at each hit's peak."""
    half = s * hits.step_s / 2
    linear = (np.sinh(half) / half) ** 2 * hits.step_s
    return linear * np.exp(np.outer(hits.zero_s, s))
