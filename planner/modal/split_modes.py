"""Modes that drift between sets: poles into which one mode was split are made one."""

from dataclasses import replace

import numpy as np

from planner.modal.fit_data import Data
from planner.modal.residues import unit
from planner.modal.set_poles import DivergedPolesError, SetPoles, fit_sets
from planner.modal.set_search import Places, reestimated_sets

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


def _made(data: Data, sets: tuple[np.ndarray, ...], fit: SetPoles, modes: np.ndarray) -> np.ndarray:
    """Response (e, F) of some modes (indices), every set with its own poles."""
    made = np.zeros((fit.residue.shape[0], data.frequency_hz.size), complex)
    up, down = unit(data.lines, fit.own[:, modes]), unit(data.lines, fit.own[:, modes].conj())
    for k, chosen in enumerate(sets):
        part = fit.residue[np.ix_(chosen, modes)]
        made[chosen] = part @ up[k] + part.conj() @ down[k]
    return made


def around(
    data: Data, sets: tuple[np.ndarray, ...], fit: SetPoles, pole: complex
) -> tuple[Data, np.ndarray, np.ndarray]:
    """The lines around a pole less the modes far from it, their indices, which modes are near."""
    step, centre = data.frequency_hz[1] - data.frequency_hz[0], pole.imag / (2 * np.pi)
    reach = max(REACH * abs(pole.real) / (2 * np.pi), LINES_AROUND * step)
    lines = thinned(data, np.append(fit.poles, pole))
    lines = lines[np.abs(data.frequency_hz[lines] - centre) < reach]
    # Of a fine grid, one line in so many: more than these lines are not needed
    lines = lines[:: 1 + lines.size // 240]
    response = data.response[..., lines]
    part = replace(data, frequency_hz=data.frequency_hz[lines], response=response, near=False)
    near = np.abs(fit.poles.imag / (2 * np.pi) - centre) < reach
    far = _made(part, sets, fit, np.flatnonzero(~near))
    return replace(part, response=part.response - far[:, None]), lines, near


def explains(
    local: Data, less: SetPoles, more: SetPoles, variance: np.ndarray, margin: float = 1.0
) -> bool:
    """Whether a fit with more modes is better than chance makes it, `margin` times over."""
    chi = [
        float(np.sum(2 / variance * np.abs(local.response[:, 0] - fit.fitted) ** 2))
        for fit in (less, more)
    ]
    scale = max(1.0, chi[1] / (2 * local.response.size))
    return chi[0] - chi[1] > margin * local.threshold * scale


def _in_most(
    local: Data, sets: tuple[np.ndarray, ...], less: SetPoles, more: SetPoles, variance: np.ndarray
) -> bool:
    """Whether a fit with one mode more is clearly better than chance makes it in most sets."""
    square = [np.abs(local.response[:, 0] - fit.fitted) ** 2 for fit in (less, more)]
    fall = np.sum(2 / variance * (square[0] - square[1]), axis=1)
    each = [np.sum(fall[chosen]) / (2 * len(chosen) + 2) for chosen in sets]
    return bool(np.median(each) > APART)


def merged_modes(
    data: Data, sets: tuple[np.ndarray, ...], fit: SetPoles, variance: np.ndarray,
    places: Places,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Poles (m,) and those of every set (k, m), with those made one that are one mode.

    What one pole for all sets cannot follow, several poles near it imitate; they excite and are
    excited alike.
    """
    order = np.argsort(fit.poles.imag)
    poles, own = list(fit.poles), list(fit.own.T)
    for group in _groups(fit, places, order):
        pairs = [group[k : k + 2] for k in range(len(group) - 1)] if len(group) > 2 else []
        for tried in (group, *pairs):
            one = _as_one(data, sets, fit, variance, tried, places)
            if one is not None:
                poles[tried[0]], own[tried[0]] = one
                for k in tried[1:]:
                    poles[k], own[k] = np.nan, np.full(len(sets), np.nan)
                break
    kept = [k for k in order if np.isfinite(poles[k])]
    return np.array([poles[k] for k in kept]), np.array([own[k] for k in kept]).T.reshape(
        len(sets), len(kept)
    )


def _groups(fit: SetPoles, places: Places, order: np.ndarray) -> list[np.ndarray]:
    """Indices of poles, increasing, that lie together and take part alike."""
    groups: list[list[int]] = []
    for k in order:
        last = groups[-1][-1] if groups else k
        gap = fit.poles[k].imag - fit.poles[last].imag
        width = 2 * max(abs(fit.poles[k].real), abs(fit.poles[last].real))
        near = gap < max(width, TOGETHER * fit.poles[k].imag)
        if groups and near and _alike(fit, places, last, k):
            groups[-1].append(k)
        else:
            groups.append([k])
    return [np.array(group) for group in groups if len(group) > 1]


def _alike(fit: SetPoles, places: Places, first: int, second: int) -> bool:
    """Whether two modes take part at the references alike; always so at a single one."""
    rows, columns = places
    vectors = []
    for k in (first, second):
        table = np.zeros((rows.max() + 1, columns.max() + 1), complex)
        table[rows, columns] = fit.residue[:, k]
        vectors.append(np.linalg.svd(table, full_matrices=False)[2][0])
    return bool(np.abs(np.vdot(*vectors)) ** 2 > ALIKE)


def _as_one(
    data: Data, sets: tuple[np.ndarray, ...], fit: SetPoles, variance: np.ndarray,
    group: np.ndarray, places: Places,
) -> tuple[complex, np.ndarray] | None:  # fmt: skip
    """Common pole and the sets' own of one mode instead of a group; None if that is worse."""
    share = fit.significance[group] / np.sum(fit.significance[group])
    middle = complex(np.sum(share * fit.poles[group]))
    local, lines, near = around(data, sets, fit, middle)
    if not np.all(near[group]):
        return None
    start = fit.own[:, group] @ share
    others = near.copy()
    others[group] = False
    own = np.column_stack([fit.own[:, others], start])
    poles = np.append(fit.poles[others], middle)
    try:
        one = fit_sets(local, sets, variance[:, lines], poles, MERGED_ROUNDS, own)
        more = fit_sets(local, sets, variance[:, lines], fit.poles[near], known=fit.own[:, near])
        if explains(local, one, more, variance[:, lines], APART):
            # Where it is one mode, only sets that fitted it badly are explained better by two.
            if _in_most(local, sets, one, more, variance[:, lines]):
                return None
            own = reestimated_sets(local, sets, one, variance[:, lines], places)
            if own is None:
                return None
            one = fit_sets(local, sets, variance[:, lines], one.poles, MERGED_ROUNDS, own)
    except DivergedPolesError:
        return None
    if explains(local, one, more, variance[:, lines], APART):
        return None
    return complex(one.poles[-1]), one.own[:, -1]
