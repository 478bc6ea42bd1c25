"""Which poles are modes: fit, leave out what the data do not need, add what they still miss."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from planner.frf.spectra import running_mean, window_sum
from planner.modal.fit_data import Data
from planner.modal.pole_fit import PoleFit, refine
from planner.modal.residues import basis, rank_one, unit

# Damping ratios of the atoms with which the error is searched.
TRIAL_DAMPING = (0.003, 0.01, 0.03, 0.08)
# They are compared with the error over so many bandwidths around them (at least so many lines),
# so many atoms at once.
REACH, LEAST, BLOCK = 20.0, 8, 64


def falls(data: Data, weight: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Trial poles and the fall of χ² that each brings alone; error (entries, F) is weighted."""
    grids = _atoms(data)
    fall = [_falls_of(data, poles, weight, error) for poles in grids]
    return np.concatenate(grids), np.concatenate(fall)


def _falls_of(data: Data, poles: np.ndarray, weight: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Falls of atoms of one damping ratio, increasing in frequency, over the lines near each."""
    frequency = np.abs(poles) / (2 * np.pi)
    reach = REACH * (data.rate_1_s - poles.real) / (2 * np.pi)
    out = np.zeros(poles.size)
    for start in range(0, poles.size, BLOCK):
        block = slice(start, min(start + BLOCK, poles.size))
        low = np.searchsorted(data.frequency_hz, frequency[block][0] - reach[block][0])
        high = np.searchsorted(data.frequency_hz, frequency[block][-1] + reach[block][-1])
        near = slice(max(0, min(low, data.frequency_hz.size - LEAST)), max(high, LEAST))
        atoms = basis(data.lines.part(near), data.to_plane(poles[block]), False)
        first, second = atoms.reshape(2, atoms.shape[0] // 2, -1)
        aa = (np.abs(first) ** 2) @ weight[:, near].T
        bb = (np.abs(second) ** 2) @ weight[:, near].T
        ab = (first.conj() * second).real @ weight[:, near].T
        a = (first.conj() @ error[:, near].T).real
        b = (second.conj() @ error[:, near].T).real
        gain = (bb * a**2 - 2 * ab * a * b + aa * b**2) / (aa * bb - ab**2)
        out[block] = np.sum(gain, axis=1)
    return out


def _atoms(data: Data) -> list[np.ndarray]:
    """Trial poles, one array per damping ratio."""
    low, high = data.frequency_hz[0], data.frequency_hz[-1]
    step = data.frequency_hz[1] - data.frequency_hz[0]
    atoms = []
    for zeta in TRIAL_DAMPING:
        frequency, grid = low, []
        while frequency <= high:
            grid.append(frequency)
            frequency += max(step, 0.7 * zeta * frequency)
        omega = 2 * np.pi * np.array(grid)
        atoms.append(omega * (-zeta + 1j * np.sqrt(1 - zeta**2)))
    return atoms


MOST_TRIED = 12  # modes beside those of the start
MAX_DAMPING = 0.3
# Neighbours closer than this (half bandwidths, share of frequency) and alike by MAC are one mode.
TWIN_WIDTHS, TWIN_SHARE, TWIN_MAC = 1.5, 0.02, 0.95


def fit(data: Data, start: np.ndarray) -> PoleFit:
    """Fit from starting poles (m,), leaving out and adding modes until neither helps."""
    current = _refine(data, start, None)
    current = _prune(data, current)
    tried: list[complex] = []
    for _ in range(MOST_TRIED):
        variance = current.variance * current.excess
        candidate = _best_atom(data, variance, current.error, tried)
        if candidate is None:
            break
        tried.append(candidate)
        grown = _refine(data, np.append(current.poles, candidate), current)
        fall = np.abs(current.error) ** 2 - np.abs(grown.error) ** 2
        scale = scales(data, grown)[np.argmax(weakness(data, grown))]
        if data.variance is None:
            scale *= np.mean(grown.variance / current.variance)
        if np.sum(2 / current.variance * fall) > data.threshold * scale:
            current = _prune(data, grown)
    return current if data.steady else _merged_twins(data, current)


def _refine(data: Data, poles: np.ndarray, before: PoleFit | None) -> PoleFit:
    """The fit from poles; an unknown variance is taken from the error itself."""
    known = data.variance is not None
    variance = first_variance(data) if known or before is None else before.variance
    refined = refine(data, variance, poles)
    for _ in range(0 if known else 2 if before is None else 1):
        variance = scatter(data, refined)
        refined = refine(data, variance, refined.poles)
    return replace(refined, excess=excess(data, refined))


def first_variance(data: Data) -> np.ndarray:
    """(e, F) known variance, or the power of each response."""
    if data.variance is not None:
        return data.variance.reshape(data.entries, -1)
    power = np.mean(np.abs(data.values) ** 2, axis=-1, keepdims=True)
    return np.broadcast_to(power, data.values.shape)


def scatter(data: Data, fit: PoleFit, alike: bool = False) -> np.ndarray:
    """(e, F) variance from the error of a fit, a running mean over a tenth of the lines.

    With `alike` it is a level for each response times that of all of them.
    """
    square, lines = np.abs(fit.error) ** 2, data.frequency_hz.size
    flat = np.mean(square, axis=-1, keepdims=True)
    # Least noise relative to the FRF: below it rounding rules.
    floor = 1e-10**2 * first_variance(data)
    if alike:
        square = flat * np.mean(square / np.maximum(flat, floor), axis=0)
    lost = 1 - (fit.poles.size + len(data.lines.rest)) / lines
    local = running_mean(square, max(10, lines // 20))
    # A little of the overall level keeps quiet stretches from being trusted without limit.
    return (0.9 * local + 0.1 * flat) / max(lost, 0.1) + floor


def excess(data: Data, fit: PoleFit) -> np.ndarray:
    """(F,) χ² per degree of freedom in a window of lines, at least 1 and the overall one."""
    error, m = np.mean(np.abs(fit.error) ** 2 / fit.variance, axis=0), fit.poles.size
    lines = error.size
    freedom = 1 - (m + len(data.lines.rest) + m / data.entries) / lines
    half = max(5, lines // 40)
    count = window_sum(np.ones(lines), half)
    local = running_mean(error, half) / max(freedom, 0.1)
    # A window of few lines scatters by itself; only what exceeds that is excess.
    noise = 1 + 2 / np.sqrt(count * data.entries / data.correlated)
    local = np.maximum(local / noise, np.mean(error) / max(freedom, 0.1))
    return data.correlated * np.maximum(1.0, local)


def _prune(data: Data, current: PoleFit) -> PoleFit:
    """Leave out modes that the data do not carry, the weakest of each neighbourhood first."""
    while current.poles.size > 1:
        weak = weakness(data, current)
        poles = current.poles
        dropped: list[int] = []
        for k in np.argsort(-weak):
            apart = [abs(poles[k] - poles[d]) > 3 * abs(poles[[k, d]].real).max() for d in dropped]
            # What looks weak may be strong once its twin is gone.
            if weak[k] > 1 and all(apart) and len(dropped) < poles.size - 1:
                dropped.append(int(k))
        if not dropped:
            break
        current = _refine(data, np.delete(poles, dropped), current)
    return current


def _merged_twins(data: Data, current: PoleFit) -> PoleFit:
    """One pole for twins of one shape: hit directions that disagree split a mode in two.

    Between two hits a mode moves a little (warmth, amplitude, a clamp that settles); its second
    pole then has the same shape. Two modes of a structure within a bandwidth differ in shape.
    """
    poles, order = current.poles, np.argsort(current.poles.imag)
    residue = current.residue.reshape(*data.response.shape[:2], -1)
    shapes = [rank_one(residue[..., k])[0] for k in range(poles.size)]
    for pair in pairwise(order) if len(residue) > 1 else ():
        a, b = pair
        width = np.max(data.rate_1_s - poles[[a, b]].real)
        near = abs(poles[a] - poles[b]) < min(TWIN_WIDTHS * width, TWIN_SHARE * abs(poles[a]))
        if near and abs(np.vdot(shapes[a], shapes[b])) ** 2 > TWIN_MAC:
            weight = current.significance[[a, b]]
            middle = np.sum(weight * poles[[a, b]]) / np.sum(weight)
            merged = _refine(data, np.append(np.delete(poles, pair), middle), current)
            return _merged_twins(data, merged)
    return current


def weakness(data: Data, fit: PoleFit) -> np.ndarray:
    """(m,) above 1 where a mode is not established, 0 for the pole above the lines."""
    return np.where(data.is_above(fit.poles), 0.0, doubt(data, fit))


def doubt(data: Data, fit: PoleFit) -> np.ndarray:
    """(m,) above 1 where a mode is not established: no fall of χ², blurred, or too damped."""
    poles, m, scale = fit.poles, fit.poles.size, scales(data, fit)
    # How the sets differ does not blur a mode: each has a pole of its own.
    sd = np.sqrt(np.maximum(np.diag(fit.covariance) - fit.spread / len(fit.own), 0.0))
    decay = np.maximum(data.rate_1_s - poles.real, 1e-12 * np.abs(poles))
    found = data.threshold * scale / np.maximum(fit.significance, 1e-300)
    blurred = 2 * np.sqrt(scale) * np.maximum(sd[:m], sd[m:]) / decay
    damped = -poles.real / (MAX_DAMPING * np.abs(poles))
    return np.max([found, blurred, damped], axis=0)


def scales(data: Data, current: PoleFit) -> np.ndarray:
    """(m,) factor on the covariance of each mode, from the error around it."""
    frequency = np.abs(current.poles) / (2 * np.pi)
    return np.interp(frequency, data.frequency_hz, current.excess)


def strongest(data: Data) -> np.ndarray:
    """(0 or 1,) pole of the atom that explains most of the responses, alone."""
    found = _best_atom(data, first_variance(data), data.values)
    return np.array([] if found is None else [found], complex)


def _best_atom(
    data: Data, variance: np.ndarray, error: np.ndarray, tried: Sequence[complex] = ()
) -> complex | None:
    """Pole of the atom that explains most of an error, apart from those tried; None by chance."""
    weight = 2 / variance
    poles, fall = falls(data, weight, weight * error)
    for pole in tried:
        fall[np.abs(poles - pole) < 0.5 * abs(pole.real)] = 0.0
    best = int(np.argmax(fall))
    return complex(poles[best]) if fall[best] > data.threshold else None


def presences(data: Data, poles: np.ndarray, residue: np.ndarray) -> np.ndarray:
    """(m,) ‖response of a mode‖/‖response‖ at the line nearest its frequency.

    poles (m,) in rad/s, residue (e, m).
    """
    lines = [int(np.argmin(np.abs(data.frequency_hz - p.imag / (2 * np.pi)))) for p in poles]
    ones = unit(data.lines, data.to_plane(poles))[np.arange(poles.size), lines]
    whole = np.linalg.norm(data.values[:, np.array(lines, int)], axis=0)
    return np.linalg.norm(residue * ones, axis=0) / np.maximum(whole, 1e-300)
