"""Poles of a matrix of FRFs of any size: many references at once, missing entries allowed.

Poles of the diagram are fitted, every set with its own; which of them are modes is judged then.
"""

from dataclasses import replace

import numpy as np

from planner.frf.matrix import FrfMatrix
from planner.modal.estimate_modes import PoleIdentification
from planner.modal.fit_data import Data, too_few_lines
from planner.modal.mode_selection import (
    doubt,
    excess,
    falls,
    first_variance,
    presences,
    scatter,
)
from planner.modal.plscf import Diagram, ladder, plscf, row_errors
from planner.modal.pole_fit import ROUNDS, DivergedPolesError, PoleFit, fit_sets, refine
from planner.modal.set_search import reestimated_sets
from planner.modal.split_modes import REACH, around, explains, merged_modes, thinned

MAX_ORDER = 36
MARGIN = 0.05  # of the band, beyond its edges
# Of rows that fit the denominator of all the worse than the median by more than this, the weight is
# taken down, so many times over; fewer rows than these cannot tell.
ODD, REWEIGHED, LEAST_ROWS = 3.0, 3, 6
# Share of the response at its frequency that a mode must be: one of the diagram's stable lines,
# and one that only the fit's error tells of. Chosen on simulated plates and aeroplanes.
PRESENT, PRESENT_ADDED = 0.03, 0.2
# A pole that only the error tells of is no more damped than this, and lies above so many lines.
DAMPING_ADDED, LINES_BELOW = 0.1, 6
SETTLING = 2  # rounds of a fit that has been fitted before, to other lines or but for a few sets


def identify_matrix(matrix: FrfMatrix, band_hz: tuple[float, float]) -> PoleIdentification | None:
    """All poles that the matrix holds in and right beside a band; None where there is none.

    Raises RefusedError where too few lines lie in the band.
    """
    hit, matrix = matrix.hit, matrix.roved
    f = matrix.frequency_hz
    chosen = (f >= band_hz[0] / (1 + MARGIN)) & (f <= band_hz[1] * (1 + MARGIN))
    if np.count_nonzero(chosen) < 16:
        raise too_few_lines(chosen, f, band_hz)
    rows, columns = np.nonzero(matrix.measured)
    response = matrix.accelerance[rows, columns][:, None, chosen]
    rate = matrix.exponential_rate_1_s
    # Entries measured together: those of one node of the side that roved
    nodes = np.array([matrix.responses[k].node for k in rows])
    sets = tuple(np.flatnonzero(nodes == node) for node in dict.fromkeys(nodes.tolist()))
    data = Data(
        f[chosen], response, None, rate, tail_s=matrix.tail_s, near=True, above=True, sets=sets,
        row=rows, column=columns, hit=hit,
    )  # fmt: skip
    # A record cut off while it rings leaves ripples, which polynomials take for poles.
    smooth = matrix.ended or matrix
    found = _diagram(smooth, chosen)
    start = found.start + smooth.exponential_rate_1_s
    if not start.size:
        return None
    fit = select_modes(data, data.with_one_above(start))
    return PoleIdentification(data, found, fit) if fit.poles.size else None


def _diagram(matrix: FrfMatrix, chosen: np.ndarray) -> Diagram:
    """Poles of every model order, from the rows that hold all of the references used."""
    table, measured = matrix.accelerance[..., chosen], matrix.measured
    columns = _references(measured)
    complete = np.all(measured[:, columns], axis=1)
    block = table[complete][:, columns]
    level = np.mean(np.abs(block) ** 2, axis=(1, 2))
    weight = np.ones(block.shape[::2]) / np.maximum(level, 1e-300)[:, None]
    order, frequency = ladder(MAX_ORDER, block.shape[-1])[-1], matrix.frequency_hz[chosen]
    changed = weight
    for _ in range(REWEIGHED if block.shape[0] >= LEAST_ROWS and block.shape[1] > 1 else 0):
        errors = row_errors(frequency, block, order, changed)
        usual = max(float(np.median(errors)), 1e-300)
        changed = weight * np.minimum(1.0, ODD * usual / np.maximum(errors, 1e-300))[:, None] ** 2
    return plscf(frequency, block, MAX_ORDER, changed)


def _references(measured: np.ndarray) -> np.ndarray:
    """Columns of measured (o, i) used together: as many FRFs as possible in complete rows."""
    columns = list(np.argsort(-np.sum(measured, axis=0), kind="stable"))
    best, size = columns[:1], 0
    # Most references at once: the order of the polynomial counts for each of them
    for count in range(1, min(len(columns), 6) + 1):
        complete = int(np.sum(np.all(measured[:, columns[:count]], axis=1))) * count
        if complete > size:
            best, size = columns[:count], complete
    return np.array(best)


def select_modes(data: Data, poles: np.ndarray) -> PoleFit:
    """Fit with every set's own poles, weak modes left out and missing ones added."""
    # At first all entries share poles that stay as they are: poles that were refined so would leave
    # weak modes to imitate how strong ones drift.
    together = replace(data, sets=(np.arange(data.entries),))
    begun = scatter(data, fit_sets(together, first_variance(data), poles, rounds=0), alike=True)
    fit = _fit(data, begun, poles, rounds=0)
    # Rough rounds of the first fit, whose weights do not know yet how sets differ
    fit = _fit(data, begun, fit.poles, fit.own, 2)
    searched = False
    for _ in range(4):  # passes of leaving out and adding
        # Not before: sets would be moved to where they imitate the modes that a fit lacks.
        fit = _settled(data, fit) if searched else fit
        present = presences(data, fit.poles, fit.residue) >= PRESENT
        # Poles above the last line stand for all modes there.
        left = fit.part(data.is_above(fit.poles) | (doubt(data, fit) <= 1) & present)
        poles, own = merged_modes(data, left)
        # What a fit lacks is looked for where it has no mode too many.
        if poles.size == fit.poles.size:
            if searched:
                break
            added, searched = _missing(data, fit), True
            poles = np.append(poles, added)
            own = np.column_stack([own, np.tile(added, (len(own), 1))])
            if not added.size:
                continue
        if not poles.size:
            return left
        fit = _fit(data, fit.variance, poles, own)
    fit = _settled(data, fit)
    return _fit(data, fit.variance, fit.poles, fit.own, SETTLING, every=True)


def _settled(data: Data, fit: PoleFit) -> PoleFit:
    """The fit after those sets have been searched again that fit badly."""
    own = reestimated_sets(data, fit)
    return fit if own is None else _fit(data, fit.variance, fit.poles, own, SETTLING)


def _fit(
    data: Data, variance: np.ndarray, poles: np.ndarray, known: np.ndarray | None = None,
    rounds: int = ROUNDS, every: bool = False,
) -> PoleFit:  # fmt: skip
    """Fit on thinned lines (or `every` one near a mode); poles that stray are left out.

    Its variance is that of its own error, by which what follows is judged and weighted.
    """
    while True:
        try:
            lines = thinned(data, poles, every)
            found = fit_sets(data, variance, poles, rounds, known, lines)
        except DivergedPolesError as error:
            poles, known = poles[~error.astray], None
        else:
            found = replace(found, variance=scatter(data, found, alike=True))
            return replace(found, excess=excess(data, found))


def _missing(data: Data, fit: PoleFit) -> np.ndarray:
    """Poles that the error still tells of, each tried on the lines around it."""
    added: list[complex] = []
    weight = 2 / fit.variance / fit.excess
    poles, fall = falls(data, weight, weight * fit.error)
    failed, step = 0, data.frequency_hz[1] - data.frequency_hz[0]
    fall[poles.imag / (2 * np.pi) < LINES_BELOW * step] = 0.0
    for _ in range(6):  # most that are added
        best = int(np.argmax(fall))
        # After two candidates in a row that are no modes weaker ones are not tried.
        if fall[best] <= data.threshold or failed == 2:
            break
        pole = complex(poles[best])
        found = _tried(data, fit, pole)
        fall[np.abs(poles - pole) < REACH * abs(pole.real)] = 0.0
        if found is not None and any(abs(found - p) < abs(p.real) for p in added):
            found = None
        failed = failed + 1 if found is None else 0
        if found is not None:
            added.append(found)
            fall[np.abs(poles - found) < REACH * abs(found.real)] = 0.0
    return np.array(added, complex)


def _tried(data: Data, fit: PoleFit, pole: complex) -> complex | None:
    """The pole after a fit of the lines around it, where it is a mode; None where it is not."""
    local, lines, near = around(data, fit, pole)
    variance = fit.variance[:, lines]
    start = np.append(fit.poles[near], pole)
    quick = refine(local, variance, start)
    if presences(local, quick.poles, quick.residue)[-1] < PRESENT_ADDED / 2:
        return None
    known = fit.own[:, near]
    own = np.column_stack([known, np.full(len(known), quick.poles[-1])])
    start = np.append(fit.poles[near], quick.poles[-1])
    try:
        after = fit_sets(local, variance, start, known=own)
        new = after.poles[-1]
        inside = local.frequency_hz[0] < new.imag / (2 * np.pi) < local.frequency_hz[-1]
        present = presences(local, after.poles, after.residue)[-1]
        if not (inside and present >= PRESENT_ADDED and -new.real < DAMPING_ADDED * abs(new)):
            return None
        before = fit_sets(local, variance, fit.poles[near], SETTLING, known)
    except DivergedPolesError:
        return None
    return complex(new) if explains(local, before, after) else None
