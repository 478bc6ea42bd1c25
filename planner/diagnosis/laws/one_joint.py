"""A joint that is not linear: found in FRFs per force level, fitted to the recorded hits in time.

The strongest hits hold the linear parameters (with priors, inertias among them); the differences
between weaker hits and the strongest ones hold the law, because what the simulation lacks
otherwise is the same at all levels and drops out of them.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from planner.dataset.level_columns import Column
from planner.diagnosis.laws.equivalent_stiffness import System, receptances, system_of
from planner.diagnosis.laws.level_data import Data, compared, own_parameter
from planner.diagnosis.laws.one_joint_response import Seen, seen, spectra, torques
from planner.diagnosis.laws.torque_laws import Law
from planner.diagnosis.linear.fit import Fit, Problem
from planner.inference.parallel import side_by_side

SHARE_SD, LOG_SHARE, LOG_SHARE_SD, LOG_ANGLE_SD = 1.5, np.log(0.5), 1.5, 2.0
STEP = 1e-3  # of finite differences in ν and in the joint's own ln stiffness
FARTHEST = 6.0
LONGEST = 0.7  # step, in the logarithms of the law or in sds of the linear parameters


@dataclass(frozen=True, eq=False)
class Candidate:
    """A law at a port, at linear parameters x (D,) and ν = (share of the joint's stiffness, ln a).

    Of laws with k > 0 it is the logarithm of the share. `chi2` over `count` complex values.
    """

    law: Law
    port: int
    scale: float
    middle: float  # ln of the angle around which a is expected
    x: np.ndarray
    nu: np.ndarray
    chi2: float = np.inf
    value: float = np.inf
    damping: float = 1e-2
    normal: np.ndarray | None = None
    gradient: np.ndarray | None = None

    @property
    def k(self) -> float:
        """k in N·m/rad."""
        return self.scale * float(self.nu[0] if self.law.signed else np.exp(self.nu[0]))

    @property
    def a(self) -> float:
        """a in rad."""
        return float(np.exp(self.nu[1]))

    @property
    def prior(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd of ν."""
        if self.law.signed:
            return np.array([0.0, self.middle]), np.array([SHARE_SD, LOG_ANGLE_SD])
        return np.array([LOG_SHARE, self.middle]), np.array([LOG_SHARE_SD, LOG_ANGLE_SD])


@dataclass(frozen=True, eq=False)
class Laws:
    """Laws fitted at one joint beside the linear fit `plain`, and how probable each is.

    χ² counts 1/`temper`; `hit` is the hardest of the columns that told.
    """

    problem: Problem
    plain: Fit
    candidates: tuple[Candidate, ...]
    probability: tuple[float, ...]
    temper: float
    hit: Column


def predict(
    data: Data, plain: Fit, candidates: list[Candidate]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """FRFs (c, 3, F) of all columns, and derivatives (3, c, 3, F) by ν and the own ln stiffness."""
    systems = [system_of(plain, c.x) for c in candidates]
    c = len(data.h)
    ports, laws, k, a, extra = [], [], [], [], []
    for number, (candidate, system) in enumerate(zip(candidates, systems, strict=True)):
        view = seen(system, candidate.port, data.hits, data.fastest_hz)
        own = system.elasticity.stiffness[system.blocks[candidate.port]]
        for which in range(4):
            ports.append(view)
            shift = np.zeros(2)
            if which in (1, 2):
                shift[which - 1] = STEP
            moved = replace(candidate, nu=candidate.nu + shift)
            k.append(np.full(c, moved.k))
            a.append(np.full(c, moved.a))
            extra.append(np.full(c, STEP * own if which == 3 else 0.0))
            first = (4 * number + which) * c
            laws.append((candidate.law, slice(first, first + c)))
    numbers = [np.concatenate(values) for values in (k, a, extra)]
    side = _abreast(ports)
    torque = torques(_joined(laws), numbers[0], numbers[1], numbers[2], side)
    parts = spectra(torque, data.hits, data.s).reshape(len(candidates), 4, c, -1)
    out = []
    for candidate, system, part in zip(candidates, systems, parts, strict=True):
        h = _frfs(data, system, candidate.port, part)
        out.append((h[0], (h[1:] - h[0]) / STEP))
    return out


def _joined(laws: list[tuple[Law, slice]]) -> list[tuple[Law, slice]]:
    """Neighbours that follow the same law, as one."""
    out = [laws[0]]
    for law, part in laws[1:]:
        if law is out[-1][0]:
            out[-1] = law, slice(out[-1][1].start, part.stop)
        else:
            out.append((law, part))
    return out


def _abreast(ports: list[Seen]) -> Seen:
    most = max(len(p.grow) for p in ports)

    def padded(values: np.ndarray) -> np.ndarray:
        return np.pad(values, ((0, most - len(values)), (0, 0)))

    return Seen(
        np.concatenate([padded(p.grow) for p in ports], axis=1),
        np.concatenate([padded(p.drive) for p in ports], axis=1),
        np.concatenate([p.gives for p in ports]),
        np.concatenate([p.free for p in ports], axis=1),
    )


def _frfs(data: Data, system: System, port: int, torque: np.ndarray) -> np.ndarray:
    """H = s² (G − G_port T / F) of all columns (4, c, 3, F), for torques (4, c, F)."""
    out = np.empty((len(torque), *data.h.shape), dtype=complex)
    for visit in np.unique(data.hits.visit):
        found = receptances(system, int(visit), data.s)
        for c in np.flatnonzero(data.hits.visit == visit):
            part = (torque[:, c] / data.force[c])[..., None]
            linear = found.sensor_hit[:, :, data.hits.axis[c]]
            h = linear - found.sensor_port[:, :, port] * part
            out[:, c] = np.swapaxes(data.s[:, None] ** 2 * h, 1, 2)
    return out


def covariance(candidate: Candidate, temper: float) -> np.ndarray:
    """Of (x, ν)."""
    assert candidate.normal is not None
    return np.linalg.inv(2 * candidate.normal / temper)


def evaluate(data: Data, plain: Fit, candidates: list[Candidate]) -> list[Candidate]:
    """The candidates with χ², objective, gradient and Gauss-Newton matrix where they are."""
    order = sorted(range(len(candidates)), key=lambda i: candidates[i].law.effect)
    half = (len(order) + 1) // 2
    halves = [[candidates[i] for i in part] for part in (order[:half], order[half:]) if part]
    done = side_by_side(partial(_evaluated, data, plain), halves)
    found = dict(zip(order, (c for part in done for c in part), strict=True))
    return [found[i] for i in range(len(candidates))]


def _evaluated(data: Data, plain: Fit, candidates: list[Candidate]) -> list[Candidate]:
    out = []
    found = predict(data, plain, candidates)
    mean, sd = plain.misfit.mean, plain.misfit.sd
    d = len(plain.x)
    for candidate, (h, slope) in zip(candidates, found, strict=True):
        own = own_parameter(plain, int(_block(plain, candidate)))
        off = compared(data, data.h) - compared(data, h)
        moved = np.array([compared(data, one) for one in slope])
        chi2 = float(np.sum(data.weight * np.abs(off) ** 2))
        if not np.isfinite(chi2):
            out.append(replace(candidate, chi2=np.inf, value=np.inf))
            continue
        full = np.zeros((d + 2, d + 2))
        full[:d, :d] = data.normal
        gradient = np.zeros(d + 2)
        at = np.array([d, d + 1, own])
        rows = data.rows
        weighted = data.weight * off
        gradient[:d] = -_times(data.slope, weighted[rows])[:, 0]
        cross = _times(data.slope, *(data.weight[rows] * moved[:, rows]))
        # The own stiffness is told by the replica, at all levels.
        gradient[own] = 0.0
        cross[own] = full[own, :] = full[:, own] = 0.0
        full[:d, at] += cross
        full[at, :d] += cross.T
        full[np.ix_(at, at)] += np.einsum("pcjf,qcjf->pq", moved.conj(), data.weight * moved).real
        gradient[at] -= np.einsum("pcjf,cjf->p", moved.conj(), weighted).real
        middle, width = candidate.prior
        centre, scale = np.concatenate([mean, middle]), np.concatenate([sd, width])
        away = (np.concatenate([candidate.x, candidate.nu]) - centre) / scale
        full[np.diag_indices(d + 2)] += 0.5 / scale**2
        gradient += 0.5 * away / scale
        value = chi2 + 0.5 * float(away @ away)
        out.append(replace(candidate, chi2=chi2, value=value, normal=full, gradient=gradient))
    return out


def _times(slope: np.ndarray, *values: np.ndarray) -> np.ndarray:
    """Σ Re slope* values: slope (b, D, 3, F), values (b, 3, F) each; (D, values)."""
    out = np.zeros((slope.shape[1], len(values)))
    for i, row in enumerate(slope):
        flat = row.reshape(len(row), -1).view(float)
        out += flat @ np.array([np.ascontiguousarray(v[i]).ravel().view(float) for v in values]).T
    return out


def _block(plain: Fit, candidate: Candidate) -> int:
    return int(system_of(plain).blocks[candidate.port])


def step(plain: Fit, candidate: Candidate) -> Candidate:
    """Where Levenberg and Marquardt would go next; not far at once."""
    assert candidate.normal is not None
    assert candidate.gradient is not None
    full = candidate.normal + candidate.damping * np.diag(np.diagonal(candidate.normal))
    move = -np.linalg.solve(full, candidate.gradient)
    law, middle = candidate.law, candidate.middle
    nu = candidate.nu + np.clip(move[-2:], -LONGEST, LONGEST)
    low, high = law.least_share, law.most_share
    if not law.signed:
        low, high = np.log(low), np.log(high)
    nu[0] = np.clip(nu[0], low, high)
    nu[1] = np.clip(nu[1], middle - FARTHEST, middle + FARTHEST)
    sd = plain.misfit.sd
    x = candidate.x + np.clip(move[:-2], -LONGEST * sd, LONGEST * sd)
    mean = plain.misfit.mean
    return replace(candidate, x=np.clip(x, mean - FARTHEST * sd, mean + FARTHEST * sd), nu=nu)


def descend(
    data: Data,
    plain: Fit,
    candidates: list[Candidate],
    rounds: int,
    tolerance: float = 1e-3,
    least: float = 1e-6,
) -> list[Candidate]:
    """All candidates, some rounds further down; those that gain nothing more are left alone.

    `least` is the smallest damping: how far poorly known directions may go.
    """
    out = list(candidates)
    todo = [i for i, c in enumerate(out) if c.gradient is None]
    for i, new in zip(
        todo, evaluate(data, plain, [out[i] for i in todo]) if todo else [], strict=True
    ):
        out[i] = new
    active = [np.isfinite(c.value) for c in out]
    for _ in range(rounds):
        todo = [i for i, on in enumerate(active) if on]
        if not todo:
            break
        for i, new in zip(
            todo, evaluate(data, plain, [step(plain, out[i]) for i in todo]), strict=True
        ):
            old = out[i]
            if new.value < old.value and new.normal is not None:
                active[i] = old.value - new.value > tolerance * old.value
                out[i] = replace(new, damping=max(least, old.damping / 10))
            else:
                out[i] = replace(old, damping=10 * old.damping)
                active[i] = old.damping < 1e4
    return out
