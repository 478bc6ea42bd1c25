"""Modes that drift between sets: poles into which one mode was split are made one."""

from dataclasses import replace

import numpy as np

from planner.modal.fit_data import Data
from planner.modal.mac import grouped
from planner.modal.pole_fit import DivergedPolesError, PoleFit, fit_sets
from planner.modal.residues import response
from planner.modal.set_search import reestimated_sets

# Poles of one mode take part at the references alike (MAC of the participation), and lie within
# this share of the frequency, or within a bandwidth.
ALIKE, TOGETHER = 0.8, 0.02
# Two of them stay apart where they explain more than one by this many times what chance does: the
# second also has a pole for every set. Real pairs explain tens of times as much.
APART = 3.0
MERGED_ROUNDS = 8  # of a fit whose sets have to part from where two poles were
# Around a pole so many half bandwidths, and at least so many lines either way, are fitted to judge
# it.
REACH, LINES_AROUND = 12.0, 12
NEAR_FIRST, THINNED_FIRST, ENOUGH = 6.0, 5, 2.0


def thinned(data: Data, poles: np.ndarray, every: bool = False) -> np.ndarray:
    """Lines near a resonance (some of them, where they are many; or `every` one), and others."""
    f, step = data.frequency_hz, data.frequency_hz[1] - data.frequency_hz[0]
    # Lines farther from every resonance than this many half bandwidths are thinned when poles of
    # sets are fitted: one in so many is kept. Until the last fit fewer are enough, and so many
    # lines in a half bandwidth: on simulated sets frequencies then differ by tenths of their sds.
    reach, one_far = (10.0, 3) if every else (NEAR_FIRST, THINNED_FIRST)
    index = np.arange(f.size)
    kept = index % one_far == 0
    for pole in poles:
        half = abs(pole.real) / (2 * np.pi)
        one_in = 1 if every else max(1, int(half / step / ENOUGH))
        near = np.abs(f - pole.imag / (2 * np.pi)) < reach * half
        kept |= near & (index % one_in == 0)
    return np.flatnonzero(kept)


def around(data: Data, fit: PoleFit, pole: complex) -> tuple[Data, np.ndarray, np.ndarray]:
    """The lines around a pole less the modes far from it, their indices, which modes are near."""
    step, centre = data.frequency_hz[1] - data.frequency_hz[0], pole.imag / (2 * np.pi)
    reach = max(REACH * abs(pole.real) / (2 * np.pi), LINES_AROUND * step)
    lines = thinned(data, np.append(fit.poles, pole))
    lines = lines[np.abs(data.frequency_hz[lines] - centre) < reach]
    # Of a fine grid, one line in so many: more than these lines are not needed
    lines = lines[:: 1 + lines.size // 240]
    values = data.response[..., lines]
    part = replace(data, frequency_hz=data.frequency_hz[lines], response=values, near=False)
    near = np.abs(fit.poles.imag / (2 * np.pi) - centre) < reach
    for own, chosen in zip(fit.own, data.sets, strict=True):
        values[chosen, 0] -= response(part.lines, own[~near], fit.residue[np.ix_(chosen, ~near)])
    return part, lines, near


def explains(local: Data, less: PoleFit, more: PoleFit, margin: float = 1.0) -> bool:
    """Whether a fit with more modes is better than chance makes it, `margin` times over."""
    before, after = (float(np.sum(fit.chi2)) for fit in (less, more))
    scale = max(1.0, after / (2 * local.response.size))
    return before - after > margin * local.threshold * scale


def merged_modes(data: Data, fit: PoleFit) -> tuple[np.ndarray, np.ndarray]:
    """Poles (m,) and those of every set (k, m), with those made one that are one mode.

    What one pole for all sets cannot follow, several poles near it imitate; they excite and are
    excited alike.
    """
    order = np.argsort(fit.poles.imag)
    poles, own, kept = fit.poles.copy(), fit.own.copy(), np.ones(fit.poles.size, bool)
    for group in _groups(data, fit, order):
        pairs = [group[k : k + 2] for k in range(len(group) - 1)] if len(group) > 2 else []
        for tried in (group, *pairs):
            one = _as_one(data, fit, tried)
            if one is not None:
                poles[tried[0]], own[:, tried[0]] = one
                kept[tried[1:]] = False
                break
    order = order[kept[order]]
    return poles[order], own[:, order]


def _groups(data: Data, fit: PoleFit, order: np.ndarray) -> list[np.ndarray]:
    """Indices of poles, increasing, that lie together and take part at the references alike."""

    def together(last: int, k: int) -> bool:
        gap = fit.poles[k].imag - fit.poles[last].imag
        width = 2 * max(abs(fit.poles[k].real), abs(fit.poles[last].real))
        if gap >= max(width, TOGETHER * fit.poles[k].imag):
            return False
        tables = np.moveaxis(data.table(fit.residue[:, [last, k]]), -1, 0)
        vectors = np.linalg.svd(tables, full_matrices=False)[2][:, 0]
        return bool(np.abs(np.vdot(*vectors)) ** 2 > ALIKE)

    return [np.array(group) for group in grouped(order, together) if len(group) > 1]


def _as_one(data: Data, fit: PoleFit, group: np.ndarray) -> tuple[complex, np.ndarray] | None:
    """Common pole and the sets' own of one mode instead of a group; None if that is worse."""
    share = fit.significance[group] / np.sum(fit.significance[group])
    middle = complex(np.sum(share * fit.poles[group]))
    local, lines, near = around(data, fit, middle)
    variance = fit.variance[:, lines]
    if not np.all(near[group]):
        return None
    start = fit.own[:, group] @ share
    others = near.copy()
    others[group] = False
    own = np.column_stack([fit.own[:, others], start])
    poles = np.append(fit.poles[others], middle)
    try:
        one = fit_sets(local, variance, poles, MERGED_ROUNDS, own)
        more = fit_sets(local, variance, fit.poles[near], known=fit.own[:, near])
        if explains(local, one, more, APART):
            # Where it is one mode, only sets that fitted it badly are explained better by two.
            fall, found = one.chi2 - more.chi2, reestimated_sets(local, one)
            each = [np.sum(fall[chosen]) / (2 * len(chosen) + 2) for chosen in local.sets]
            if np.median(each) > APART or found is None:
                return None
            one = fit_sets(local, variance, one.poles, MERGED_ROUNDS, found)
    except DivergedPolesError:
        return None
    if explains(local, one, more, APART):
        return None
    return complex(one.poles[-1]), one.own[:, -1]
