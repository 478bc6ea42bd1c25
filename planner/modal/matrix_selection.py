"""Which poles of a matrix of FRFs are modes, when every set has poles of its own."""

from dataclasses import replace

import numpy as np

from planner.modal.fit_data import Data
from planner.modal.least_squares import refine
from planner.modal.mode_selection import doubt, excess, falls, presences, running_mean
from planner.modal.set_poles import ROUNDS, DivergedPolesError, SetPoles, fit_sets
from planner.modal.set_search import Places, reestimated_sets
from planner.modal.split_modes import REACH, around, explains, merged_modes, thinned

# Share of the response at its frequency that a mode must be: one of the diagram's stable lines,
# and one that only the fit's error tells of. Chosen on simulated plates and aeroplanes.
PRESENT, PRESENT_ADDED = 0.03, 0.2
# A pole that only the error tells of is no more damped than this, and lies above so many lines.
DAMPING_ADDED, LINES_BELOW = 0.1, 6
SETTLING = 2  # rounds of a fit that has been fitted before, to other lines or but for a few sets


def first_variance(data: Data, poles: np.ndarray) -> np.ndarray:
    """(e, F) where all entries share poles that stay as they are.

    Poles that were refined so would leave weak modes to imitate how strong ones drift.
    """
    power = np.mean(np.abs(data.response[:, 0]) ** 2, axis=-1, keepdims=True)
    every = (np.arange(len(power)),)
    fit = fit_sets(data, every, np.broadcast_to(power, data.response[:, 0].shape), poles, rounds=0)
    return _variance(data, fit.fitted, poles.size)


def _variance(data: Data, fitted: np.ndarray, modes: int) -> np.ndarray:
    """(e, F) from the error of a fit: a level for each entry times one profile of lines."""
    square = np.abs(data.response[:, 0] - fitted) ** 2
    flat = np.mean(square, axis=-1, keepdims=True)
    lines = square.shape[1]
    floor = 1e-20 * np.mean(np.abs(data.response[:, 0]) ** 2, axis=-1, keepdims=True)
    profile = running_mean(np.mean(square / np.maximum(flat, floor), axis=0), max(10, lines // 20))
    lost = max(0.1, 1 - (modes + len(data.lines.rest)) / lines)
    return flat * (0.9 * profile + 0.1) / lost + floor


def select_modes(
    data: Data, sets: tuple[np.ndarray, ...], variance: np.ndarray, poles: np.ndarray,
    places: Places,
) -> tuple[SetPoles, np.ndarray]:  # fmt: skip
    """Fit with every set's own poles, weak modes left out and missing ones added."""
    fit = _fit(data, sets, variance, poles, rounds=0)
    # Rough rounds of the first fit, whose weights do not know yet how sets differ
    fit = _fit(data, sets, variance, fit.poles, fit.own, 2)
    searched = False
    # Passes of leaving out and adding
    for _ in range(4):
        variance = _variance(data, fit.fitted, fit.poles.size)
        # Not before: sets would be moved to where they imitate the modes that a fit lacks.
        if searched:
            fit, variance = _settled(data, sets, fit, places)
        left = _part_of(fit, _standing(data, fit, variance))
        poles, own = merged_modes(data, sets, left, variance, places)
        # What a fit lacks is looked for where it has no mode too many.
        if poles.size == fit.poles.size:
            if searched:
                break
            added, searched = _missing(data, sets, fit, variance), True
            poles = np.append(poles, added)
            own = np.column_stack([own, np.tile(added, (len(own), 1))])
            if not added.size:
                continue
        if not poles.size:
            return replace(left, poles=poles), variance
        fit = _fit(data, sets, variance, poles, own)
    fit, variance = _settled(data, sets, fit, places)
    fit = _fit(data, sets, variance, fit.poles, fit.own, SETTLING, every=True)
    return fit, _variance(data, fit.fitted, fit.poles.size)


def _settled(
    data: Data, sets: tuple[np.ndarray, ...], fit: SetPoles, places: Places
) -> tuple[SetPoles, np.ndarray]:
    """The fit, and its variance, after those sets have been searched again that fit badly."""
    variance = _variance(data, fit.fitted, fit.poles.size)
    own = reestimated_sets(data, sets, fit, variance, places)
    if own is None:
        return fit, variance
    fit = _fit(data, sets, variance, fit.poles, own, SETTLING)
    return fit, _variance(data, fit.fitted, fit.poles.size)


def _fit(
    data: Data, sets: tuple[np.ndarray, ...], variance: np.ndarray, poles: np.ndarray,
    known: np.ndarray | None = None, rounds: int = ROUNDS, every: bool = False,
) -> SetPoles:  # fmt: skip
    """Fit on thinned lines (or `every` one near a mode); poles that stray are left out."""
    while True:
        try:
            lines = thinned(data, poles, every)
            return fit_sets(data, sets, variance, poles, rounds, known, lines)
        except DivergedPolesError as error:
            poles, known = poles[~error.astray], None


def _standing(data: Data, fit: SetPoles, variance: np.ndarray) -> np.ndarray:
    """(m,) bool: which poles are modes, or stand for those above the last line."""
    _, weak, presence = judged(data, fit, variance)
    return data.is_above(fit.poles) | (weak <= 1) & (presence >= PRESENT)


def _part_of(fit: SetPoles, kept: np.ndarray) -> SetPoles:
    """Some of the modes (bool); what was fitted stays."""
    both = np.tile(kept, 2)
    return replace(
        fit, poles=fit.poles[kept], own=fit.own[:, kept], spread=fit.spread[both],
        covariance=fit.covariance[np.ix_(both, both)], residue=fit.residue[:, kept],
        residue_variance=fit.residue_variance[:, kept], significance=fit.significance[kept],
    )  # fmt: skip


def judged(
    data: Data, fit: SetPoles, variance: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(m,) noise beyond its variance, weakness (above 1: not established) and presence."""
    frequency = np.abs(fit.poles) / (2 * np.pi)
    scale = np.interp(frequency, data.frequency_hz, _excess(data, fit, variance))
    # How the sets differ does not blur a mode: each has a pole of its own.
    alone = np.diag(fit.covariance) - fit.spread / len(fit.own)
    weak = doubt(data, fit.poles, alone, fit.significance, scale)
    return scale, weak, presences(data, fit.poles, fit.residue)


def _excess(data: Data, fit: SetPoles, variance: np.ndarray) -> np.ndarray:
    """(F,) χ² per degree of freedom around each line, at least 1."""
    error = (data.response[:, 0] - fit.fitted)[:, None]
    free = (
        2 * error.size
        - 2 * fit.poles.size
        - data.entries * 2 * (fit.poles.size + len(data.lines.rest))
    )
    return excess(data, error, variance[:, None], free)


def _missing(
    data: Data, sets: tuple[np.ndarray, ...], fit: SetPoles, variance: np.ndarray
) -> np.ndarray:
    """Poles that the error still tells of, each tried on the lines around it."""
    added: list[complex] = []
    error = data.response[:, 0] - fit.fitted
    weight = 2 / variance / _excess(data, fit, variance)
    poles, fall = falls(data, weight, weight * error)
    failed, step = 0, data.frequency_hz[1] - data.frequency_hz[0]
    fall[poles.imag / (2 * np.pi) < LINES_BELOW * step] = 0.0
    # Most added.
    for _ in range(6):
        best = int(np.argmax(fall))
        # Most failed: candidates in a row that are no modes: weaker ones are not tried
        if fall[best] <= data.threshold or failed == 2:
            break
        pole = complex(poles[best])
        found = _tried(data, sets, fit, variance, pole)
        fall[np.abs(poles - pole) < REACH * abs(pole.real)] = 0.0
        if found is not None and any(abs(found - p) < abs(p.real) for p in added):
            found = None
        failed = failed + 1 if found is None else 0
        if found is not None:
            added.append(found)
            fall[np.abs(poles - found) < REACH * abs(found.real)] = 0.0
    return np.array(added, complex)


def _tried(
    data: Data, sets: tuple[np.ndarray, ...], fit: SetPoles, variance: np.ndarray, pole: complex
) -> complex | None:
    """The pole after a fit of the lines around it, where it is a mode; None where it is not."""
    local, lines, near = around(data, sets, fit, pole)
    start = np.append(fit.poles[near], pole)
    together = np.broadcast_to(variance[:, None, lines], local.response.shape)
    quick = refine(local.lines, local.response, together, start, local.allowed)
    if presences(local, quick.poles, quick.residues.residue)[-1] < PRESENT_ADDED / 2:
        return None
    known = fit.own[:, near]
    own = np.column_stack([known, np.full(len(known), quick.poles[-1])])
    start = np.append(fit.poles[near], quick.poles[-1])
    try:
        after = fit_sets(local, sets, variance[:, lines], start, known=own)
    except DivergedPolesError:
        return None
    new = after.poles[-1]
    inside = local.frequency_hz[0] < new.imag / (2 * np.pi) < local.frequency_hz[-1]
    present = presences(local, after.poles, after.residue)[-1]
    real = inside and present >= PRESENT_ADDED and -new.real < DAMPING_ADDED * abs(new)
    if not real:
        return None
    try:
        before = fit_sets(local, sets, variance[:, lines], fit.poles[near], SETTLING, known)
    except DivergedPolesError:
        return None
    return complex(new) if explains(local, before, after, variance[:, lines]) else None
