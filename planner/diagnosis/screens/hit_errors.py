"""How each hit missed its axis and its point, told from the hits of the same pose and axis.

What hits along one axis have in common is the structure's (or the aim's, which the fits integrate
out); by what they differ, each one's own miss shows: four numbers a hit against some hundred
complex values.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.dataset.dataset import LAID, Dataset, Visit
from planner.dataset.level_columns import Column, column
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.laws.level_refits import base
from planner.diagnosis.laws.open_misses import relative_misfit
from planner.diagnosis.linear.drift_fit import problem_of
from planner.diagnosis.linear.fit import Fit, fit, settle
from planner.diagnosis.linear.problem import tolerances_of
from planner.diagnosis.thresholds import BEYOND_ANY_HAND
from planner.dynamics.gradient import response_turned
from planner.dynamics.simulation import Simulation
from planner.measurement.nuisances import Tolerances, hit_basis
from planner.recording.records import Hit

LINES = 96  # at most, of each hit
RELATIVE = 0.01  # of an FRF: what the simulation, whose columns are used, is not right to
PADDING = 4  # records' lengths over which responses die away


@dataclass(frozen=True, eq=False)
class HitError:
    """δ (2,) in rad and o (2,) in m of a hit, across its axis in cyclic order.

    Relative to what the hits of its pose and axis have in common.
    """

    tilt_rad: np.ndarray
    offset_m: np.ndarray


HitErrors = tuple[tuple[HitError, ...], ...]  # of every hit of every visit


def taken_out(recorded: Dataset, nominal: Simulation) -> tuple[Dataset, HitErrors]:
    """The recordings as they would be had every hit missed like the others, and the misses.

    A rough fit of the simulation tells the misses roughly, and a close one to hits without them
    tells them again.
    """
    rough, tolerances = base(recorded, nominal), tolerances_of(nominal)
    first = corrected(recorded, rough, hit_errors(recorded, rough, tolerances))
    problem = problem_of(first, nominal)
    plain = settle(problem, fit(problem, Effect("")))
    errors = hit_errors(recorded, plain, tolerances)
    return corrected(recorded, plain, errors), errors


def hit_errors(recorded: Dataset, plain: Fit, tolerances: Tolerances) -> HitErrors:
    """Of every hit of every visit; `plain` is a simulation fitted to the visits."""
    length = max(len(hit.force_n) for visit in recorded.visits for hit in visit.hits)
    out = []
    for number, visit in enumerate(recorded.visits):
        columns = [
            column((hit,), hit.axis_index, 0, length, recorded.band_hz, LAID,
                   recorded.window_rate_1_s)
            for hit in visit.hits
        ]  # fmt: skip
        out.append(_of_visit(columns, number, plain, tolerances))
    return tuple(out)


def _of_visit(
    columns: list[Column], number: int, plain: Fit, tolerances: Tolerances
) -> tuple[HitError, ...]:
    frequency = columns[0].frequency_hz
    lines = np.unique(np.linspace(0, len(frequency) - 1, LINES).round().astype(int))
    s = 2j * np.pi * frequency[lines] + columns[0].rate_1_s
    basis = _basis(plain, number, s, tolerances)
    scale = np.repeat([tolerances.angle_rad, tolerances.offset_m], 2)
    out: list[HitError] = [HitError(*np.zeros((2, 2)))] * len(columns)
    # Hits at one point, along one axis, that the same channels heard.
    places = [(c.axis, c.hits[0].hit_point, c.hits[0].responses) for c in columns]
    for place in dict.fromkeys(places):
        group = [i for i, own in enumerate(places) if own == place]
        if len(group) < 2:
            continue
        rows, column = _at(plain, columns[group[0]].hits[0])
        own = columns[group[0]].hits[0].rows
        h = np.array([columns[i].accelerance[own][:, lines] for i in group])
        variance = np.array([columns[i].variance[own][:, lines] for i in group])
        variance = variance + (RELATIVE * np.abs(h)) ** 2
        weight = np.where(np.isfinite(variance), 1 / variance, 0.0)
        eta = _solved(h, weight, basis[column][:, rows])
        for i, e in zip(group, eta * scale, strict=True):
            out[i] = HitError(e[:2], e[2:])
    return tuple(out)


def _at(plain: Fit, hit: Hit) -> tuple[np.ndarray, int]:
    """Rows and column of a hit's responses among the fit's."""
    layout = plain.misfit.setting.layout
    rows = np.array(layout.rows(hit.layout))[hit.rows]
    return rows, layout.columns(hit.layout)[hit.axis_index]


def _basis(plain: Fit, number: int, s: np.ndarray, tolerances: Tolerances) -> np.ndarray:
    """(c, 4, r, F) at s (F,) in rad/s of a visit, by the fitted simulation."""
    misfit, (a, b) = plain.misfit, plain.misfit.split
    one = slice(number, number + 1)
    mass = misfit.matrices.mass + misfit.inertias.mass_change(plain.x[a:b])
    springs = misfit.parametrisation.elasticity(plain.x[:a])
    h, turned = response_turned(misfit.matrices.at(one), springs, s[None], mass[one])
    return hit_basis(h, turned.moment, tolerances)[0]


def _solved(h: np.ndarray, weight: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """η (n, 4) of n columns h (n, r, F), in sds, and Σ η = 0.

    Least squares with prior N(0, 1) of h = common + B η, `common` being free at every line.
    """
    n = len(h)
    total = weight.sum(axis=0)
    share = weight / np.where(total > 0, total, 1.0)
    normal = np.zeros((4 * n, 4 * n))
    right = np.zeros(4 * n)
    mean = np.sum(share * h, axis=0)
    for i in range(n):
        right[4 * i : 4 * i + 4] = _inner(basis, weight[i] * (h[i] - mean))
        for k in range(n):
            w = weight[i] * ((i == k) - share[k])
            normal[4 * i : 4 * i + 4, 4 * k : 4 * k + 4] = _inner(basis, w * basis)
    covariance = np.linalg.inv(normal + np.eye(4 * n))
    apart = np.kron(np.eye(n) - 1 / n, np.eye(4))
    return (apart @ covariance @ right).reshape(n, 4)


def _inner(basis: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Re B* v of basis (4, r, F) and values (r, F) or (4, r, F)."""
    return np.tensordot(basis.conj(), values, axes=([-2, -1], [-2, -1])).real


def beyond_any_hand(errors: HitErrors, tolerances: Tolerances) -> bool:
    """Whether hits would have missed by so much that something else makes them differ."""
    # Of a hit that has none beside it nothing is told.
    each = [e for visit in errors for e in visit if np.any(e.tilt_rad) or np.any(e.offset_m)]
    if not each:
        return False
    tilt = float(np.sqrt(np.mean([e.tilt_rad**2 for e in each])))
    offset = float(np.sqrt(np.mean([e.offset_m**2 for e in each])))
    return bool(
        tilt > BEYOND_ANY_HAND * tolerances.angle_rad
        or offset > BEYOND_ANY_HAND * tolerances.offset_m
    )


def corrected(recorded: Dataset, plain: Fit, errors: HitErrors) -> Dataset:
    """Hits as they would have been answered without their own misses."""
    off = relative_misfit(plain)
    visits = tuple(
        _corrected(visit, number, plain, own, float(off[number]))
        for number, (visit, own) in enumerate(zip(recorded.visits, errors, strict=True))
    )
    return recorded.corrected(visits)


def _corrected(
    visit: Visit, number: int, plain: Fit, errors: tuple[HitError, ...], off: float
) -> Visit:
    rate = visit.hits[0].sampling_rate_hz
    length = PADDING * max(len(hit.force_n) for hit in visit.hits)
    s = 2j * np.pi * np.fft.rfftfreq(length, 1 / rate)[1:]
    unit = Tolerances(angle_rad=1.0, offset_m=1.0)
    basis = _basis(plain, number, s, unit)
    hits = []
    for hit, error in zip(visit.hits, errors, strict=True):
        rows, column = _at(plain, hit)
        hits.append(_one(hit, basis[column][:, rows], error, length, off))
    return replace(visit, hits=tuple(hits))


def _one(hit: Hit, basis: np.ndarray, error: HitError, length: int, off: float) -> Hit:
    eta = np.concatenate([error.tilt_rad, error.offset_m])
    force = hit.sign * (hit.force_n - np.median(hit.force_n))
    change = np.zeros((basis.shape[1], length // 2 + 1), dtype=complex)
    change[:, 1:] = np.einsum("k,kif->if", eta, basis) * np.fft.rfft(force, length)[1:]
    extra = np.fft.irfft(change, length, axis=1)[:, : len(hit.force_n)]
    rest = hit.acceleration_m_s2 - extra
    return replace(hit, acceleration_m_s2=rest, taken_out_m_s2=extra, taken_out_sd=off)


def describe(errors: HitErrors) -> str:
    """One sentence on how the hits scatter about their axes and the point."""
    each = [error for visit in errors for error in visit]
    tilt = float(np.rad2deg(np.sqrt(np.mean([e.tilt_rad**2 for e in each]))))
    offset = 1e3 * float(np.sqrt(np.mean([e.offset_m**2 for e in each])))
    return (
        f"Hits along one axis of a pose differ by {tilt:.1f}° in each direction and by "
        f"{offset:.1f} mm in place (rms), as hand-held hits do; the recordings were corrected."
    )
