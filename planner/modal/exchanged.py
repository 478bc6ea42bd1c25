"""Which rows of a matrix stand under another point's name.

The column of a point says how it moves in each mode, and so does its row: where another row moves
so, the two were exchanged. Rows without a column are told by how their neighbours move.
"""

from dataclasses import dataclass

import numpy as np

from planner.modal.matrix_sides import Sides
from planner.modal.node_places import exchanged_nodes
from planner.recording.dof import Dof
from planner.recording.geometry import Geometry

# Two rows are called exchanged where rows and columns then differ by less than FITS, and by less
# than this share of what they do as stated and with any other two exchanged. Chosen on simulated
# plates and aeroplanes whose rows wander by 3 % in scale and 0.1 % in frequency.
FITS, BETTER = 0.3, 0.6


@dataclass(frozen=True)
class Exchange:
    """Two points whose rows fit each other's places.

    `stated` and `exchanged` are how much rows differ from columns, relatively; NaN where only the
    neighbours tell: of nodes then, in all their directions.
    """

    first: Dof
    second: Dof
    stated: float
    exchanged: float

    def concerns(self, dof: Dof) -> bool:
        """Whether the row of a point stands elsewhere."""
        if np.isnan(self.stated):
            return dof.node in (self.first.node, self.second.node)
        return dof in (self.first, self.second)

    @property
    def text(self) -> str:
        """One sentence for the engineer."""
        a, b = self.first, self.second
        if np.isnan(self.stated):
            return (
                f"Nodes {a.node} and {b.node} are probably swapped: as labelled they move against "
                "the points around them in the modes, swapped they move with them. Check the "
                "labels."
            )
        pair = f"Nodes {a.node} and {b.node} ({a.direction})"
        if a.direction != b.direction:
            pair = f"The channels {a.at} and {b.at}"
        return (
            f"{pair} are probably swapped: as labelled, hitting and listening there differ by "
            f"{100 * self.stated:.0f} %, swapped by {100 * self.exchanged:.0f} %. Check the labels."
        )


def exchanges(sides: Sides, geometry: Geometry | None) -> tuple[Exchange, ...]:
    """Points that were exchanged: told by rows and columns, else by the neighbours."""
    motions = sides.motions
    if motions is None:
        return ()
    return _against_columns(sides, *motions) or exchanged_by_neighbours(sides, geometry)


def exchanged_by_neighbours(sides: Sides, geometry: Geometry | None) -> tuple[Exchange, ...]:
    """Points that were exchanged, told by the neighbours alone."""
    if sides.motions is None or geometry is None:
        return ()
    pair = exchanged_nodes(sides.rows, sides.motions[0].real, geometry)
    return () if pair is None else (_named(sides, pair),)


def _named(sides: Sides, pair: tuple[str, str]) -> Exchange:
    """Two nodes of which only the neighbours tell, in all directions."""
    first, second = (next(dof for dof in sides.rows if dof.node == node) for node in pair)
    return Exchange(first, second, float("nan"), float("nan"))


def turning_helps(sides: Sides, turned: tuple[Dof, ...]) -> bool:
    """Whether columns and rows of the same points agree once turned columns are turned back."""
    if sides.motions is None or not turned:
        return False
    shape, columns = sides.motions
    sign = np.array([-1.0 if dof in turned else 1.0 for dof in sides.columns])
    stayed = [i for _, i in sides.driving]
    rows = [o for o, _ in sides.driving]
    return _misfit(shape, (sign[:, None] * columns)[stayed], rows) < FITS


def _against_columns(sides: Sides, shape: np.ndarray, columns: np.ndarray) -> tuple[Exchange, ...]:
    rows = [o for o, _ in sides.driving]
    weights = columns[[i for _, i in sides.driving]]
    if len(rows) < 2:
        return ()
    stated = _misfit(shape, weights, rows)
    tried: dict[tuple[Dof, Dof], float] = {}
    for row in rows:
        for other, dof in enumerate(sides.rows):
            if other != row and dof.direction == sides.rows[row].direction:
                places = [other if r == row else row if r == other else r for r in rows]
                pair = sides.rows[min(row, other)], sides.rows[max(row, other)]
                tried[pair] = _misfit(shape, weights, places)
    ranked = sorted(tried, key=lambda pair: tried[pair])
    if not ranked or tried[ranked[0]] > min(FITS, BETTER * stated):
        return ()
    if len(ranked) > 1 and tried[ranked[1]] < tried[ranked[0]] / BETTER:
        return ()
    return (Exchange(*ranked[0], stated, tried[ranked[0]]),)


def _misfit(shape: np.ndarray, columns: np.ndarray, rows: list[int]) -> float:
    """Relative difference between how points move as columns and as rows, over all modes.

    The scale of each mode is free and positive up to a common phase: a shape of unit mass.
    """
    felt = shape[rows]
    if not np.all(np.isfinite(felt)):
        return 1.0
    # residue = row·column = φφ: column/row is a positive number where both are φ.
    along = np.maximum(np.sum(felt.conj() * columns, axis=0).real, 0.0)
    power = np.sum(np.abs(columns) ** 2, axis=0)
    wrong = power - along**2 / np.maximum(np.sum(np.abs(felt) ** 2, axis=0), 1e-300)
    return float(np.sqrt(max(np.sum(wrong), 0.0) / max(np.sum(power), 1e-300)))
