"""Do the FRFs of a matrix fit one another? Driving points, reciprocity, signs, nodes' places.

A passive structure takes power in where it is hit, so that the imaginary part of a driving point's
accelerance is nowhere negative, and each mode's residue has one sign there: between two
resonances lies an antiresonance. Maxwell: H_ij = H_ji. Between the columns of a matrix a mode has
one shape, and between neighbours it changes smoothly. What is turned, exchanged or out of scale
breaks one of these, and is named where only one explanation does.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from planner.frf.matrix import FrfMatrix
from planner.modal.estimate_modes import PoleIdentification
from planner.modal.motion_fields import turned_rows
from planner.modal.node_exchange import (
    Exchange,
    RovingSides,
    exchanged_by_columns,
    exchanged_by_neighbours,
    turning_helps,
)
from planner.recording.points import Dof
from planner.recording.uff import Geometry


class DrivingPoint:
    """A point hit where it was felt; shares in [0, 1].

    `positive` is the share of |Im H| that has the right sign, `modes` that of the modes' residues.
    """

    def __init__(
        self, matrix: FrfMatrix, sides: RovingSides, lines: np.ndarray, row: int, column: int
    ) -> None:
        imag, residues = matrix.roved.accelerance[row, column, lines].imag, sides.table[row, column]
        size, self.dof = np.abs(residues), sides.columns[column]
        self.positive = float(np.sum(imag[imag > 0]) / max(np.sum(np.abs(imag)), 1e-300))
        self.modes = float(np.sum(size[np.real(residues) > 0]) / max(np.sum(size), 1e-300))


@dataclass(frozen=True)
class Reciprocity:
    """H_ij beside H_ji at the modes: difference beyond noise, ratio (least squares; −1: turned)."""

    first: Dof
    second: Dof
    difference: float
    ratio: float


@dataclass(frozen=True, eq=False)
class Consistency:
    """What the checks say; `faults` are the sentences about what is wrong, `remarks` the rest.

    `turned` are points of the side that stayed whose FRFs all have the wrong sign, `turned_rows`
    those of the side that roved, `untied` points whose column does not go with the row, `odd`
    (roved, stayed) single FRFs that do not fit the others.
    """

    driving: tuple[DrivingPoint, ...]
    faults: tuple[str, ...]
    remarks: tuple[str, ...]
    turned: tuple[Dof, ...]
    turned_rows: tuple[Dof, ...]
    untied: tuple[Dof, ...]
    odd: tuple[tuple[Dof, Dof], ...]


def check(
    matrix: FrfMatrix,
    found: PoleIdentification,
    modes: np.ndarray,
    geometry: Geometry | None = None,
) -> Consistency:
    """Check FRFs and residues of the modes (indices) that were established."""
    sides, (low, high) = RovingSides(matrix, found, modes), found.data.frequency_hz[[0, -1]]
    lines = (matrix.frequency_hz >= low) & (matrix.frequency_hz <= high)
    driving = tuple(DrivingPoint(matrix, sides, lines, *pair) for pair in sides.driving)
    reciprocity = _reciprocity(matrix, found, modes)
    # Least modes that tell of signs and places
    enough = modes.size >= 3
    # A sign is called wrong where less than this share of the modes' residues has the right one.
    wrong = tuple(point.dof for point in driving if point.modes < 0.3)
    rows: tuple[Dof, ...] = ()
    if enough and geometry is not None and sides.motions is not None:
        against = turned_rows(sides.rows, sides.motions[0].real, geometry)
        rows = tuple(sides.rows[k] for k in against)
    # At a point that both roved and stayed either may be turned; its neighbours tell.
    turned = tuple(dof for dof in wrong if dof not in rows)
    swapped: Exchange | None = None
    # Two exchanged points may look like two turned signs: one fault is likelier than two.
    if len(rows) == 1 and not turned:
        swapped = exchanged_by_neighbours(sides, geometry)
    elif enough and not turning_helps(sides, turned):
        swapped = exchanged_by_columns(sides) or exchanged_by_neighbours(sides, geometry)
    turned, rows = ((), ()) if swapped else (turned, rows)
    faults = [swapped[0]] if swapped else []
    faults += _turned(turned, len(driving), reciprocity)
    done = "hit" if sides.hit else "felt"
    faults += [
        f"The sign {dof.at} is turned where it was {done}: in all modes it moves against the"
        f" points around it. The sign of all FRFs {done} there was inverted before the analysis."
        for dof in rows
    ]
    single, entries = odd_entries(sides) if enough else ([], [])
    faults += single
    odd = tuple((sides.rows[row], sides.columns[column]) for row, column in entries)
    untied = tuple(dof for dof in sides.columns if swapped and dof in swapped[1])
    told = () if faults else _remarks(reciprocity)
    if not driving:
        told = (*told, "No point was hit where it was felt: shapes are not scaled.")
    return Consistency(driving, tuple(faults), told, turned, rows, untied, odd)


def _reciprocity(
    matrix: FrfMatrix, found: PoleIdentification, modes: np.ndarray
) -> tuple[Reciprocity, ...]:
    """Of all pairs of points that were measured both ways."""
    # The heights of the peaks; the lines themselves differ wherever frequencies drift.
    decay, fit = np.abs(found.fit.poles[modes].real), found.fit
    height = fit.residue[:, modes] / decay
    noise = 2 * found.scale[modes] * fit.residue_variance[:, modes] / decay**2
    entry = {pair: e for e, pair in enumerate(zip(*found.data.places, strict=True))}
    out = []
    for (o, i), (o_too, i_too) in combinations(matrix.both, 2):
        # Response at the second point to a hit at the first, and the other way round
        e, other = entry.get((o_too, i)), entry.get((o, i_too))
        if e is None or other is None:
            continue
        one, two = height[e], height[other]
        size = np.linalg.norm(one) * np.linalg.norm(two)
        ratio = float(np.real(np.vdot(one, two)) / max(np.linalg.norm(one) ** 2, 1e-300))
        beyond = np.linalg.norm(one - two) ** 2 - np.sum(noise[e] + noise[other])
        apart = float(np.sqrt(max(beyond, 0.0) / max(size, 1e-300)))
        points = matrix.references[i_too], matrix.references[i]
        out.append(Reciprocity(*points, apart, ratio))
    return tuple(out)


def _turned(
    wrong: tuple[Dof, ...], driving: int, reciprocity: tuple[Reciprocity, ...]
) -> list[str]:
    """Sentences about channels whose sign is turned."""
    if len(wrong) == driving > 1:
        return [
            "All driving points have the wrong sign (Im H < 0 at resonances): the force, or all "
            "responses, were measured with a turned sign. Their sign was inverted before the "
            "analysis."
        ]
    sentences = []
    for dof in wrong:
        others = [r for r in reciprocity if dof in (r.first, r.second) and r.ratio < 0]
        more = f" and {len(others)} × H_ij = −H_ji" if others else ""
        sentences.append(
            f"The sign of the channel {dof.at} is turned: its driving point has Im H < 0 "
            f"at resonances{more}. The sign of all FRFs with this reference was inverted before "
            "the analysis."
        )
    return sentences


def _remarks(reciprocity: tuple[Reciprocity, ...]) -> tuple[str, ...]:
    worst = max(reciprocity, key=lambda r: r.difference, default=None)
    # Reciprocity is remarked upon where H_ij and H_ji differ by more than this.
    if worst is None or worst.difference < 0.15:
        return ()
    return (
        f"Between hits {worst.first.at} and {worst.second.at} H_ij and H_ji differ by "
        f"{100 * worst.difference:.0f} % (ratio {worst.ratio:.2f}). Shapes, modal masses and "
        "stiffnesses suppose that they agree; right and left vectors (--json, --export) do not.",
    )


# An entry fits where its residues differ from what the rest of its row asks for by less than this,
# over all modes; what turned it round differs by more than the second as stated.
FITS, ODD = 0.3, 1.0


def odd_entries(sides: RovingSides) -> tuple[list[str], list[tuple[int, int]]]:
    """FRFs with a turned sign, and two of a column that are exchanged: sentences and entries."""
    expected = _expected(sides)
    if expected is None:
        return [], []
    seen = sides.table
    size = np.maximum(np.linalg.norm(expected, axis=-1), 1e-300)
    stated = np.linalg.norm(seen - expected, axis=-1) / size
    turned = np.linalg.norm(seen + expected, axis=-1) / size
    wrong = [(a, b) for a, b in np.argwhere((turned < FITS) & (stated > ODD)).tolist()]
    sentences = [
        f"The FRF {_named(sides, row, column)} has a turned sign beside the others of its row and "
        "was left out; check its polarity."
        for row, column in wrong
    ]
    for column in range(len(sides.columns)):
        odd = np.flatnonzero((stated[:, column] > ODD / 2) & (turned[:, column] > FITS))
        for a, b in combinations(odd.tolist(), 2):
            off = np.linalg.norm(seen[[a, b], column] - expected[[b, a], column], axis=-1)
            if np.all(off < FITS * size[[b, a], column]):
                wrong += [(a, column), (b, column)]
                sentences.append(
                    f"The FRFs {_named(sides, a, column)} and {_named(sides, b, column)} are "
                    "probably swapped and were left out. Check the labels."
                )
    # Most entries that can be odd: beyond, what they are compared with is
    few = len(sentences) <= 0.2 * np.count_nonzero(np.isfinite(stated))
    return (sentences, wrong) if few else ([], [])


def _expected(sides: RovingSides) -> np.ndarray | None:
    """(r, c, m) of each entry what the rest of its row asks for; NaN where that says nothing.

    The rest of the row tells how the point moves; the columns tell what that makes here.
    """
    if sides.motions is None or len(sides.columns) < 3 or len(sides.rows) < 4:
        return None
    columns, seen = sides.motions[1], sides.table
    expected = np.full(seen.shape, np.nan + 0j)
    for row, column in np.argwhere(np.isfinite(seen[..., 0])):
        others = [c for c in range(len(columns)) if c != column and np.isfinite(seen[row, c, 0])]
        if len(others) < 2:
            continue
        a, b = columns[others], seen[row, others]
        point = np.sum(a.conj() * b, axis=0) / np.maximum(np.sum(np.abs(a) ** 2, axis=0), 1e-300)
        if np.linalg.norm(b - point * a) < FITS * np.linalg.norm(b):
            expected[row, column] = point * columns[column]
    return expected


def _named(sides: RovingSides, row: int, column: int) -> str:
    one, other = sides.rows[row].at, sides.columns[column].at
    felt, hit = (other, one) if sides.hit else (one, other)
    return f"felt {felt} and hit {hit}"
