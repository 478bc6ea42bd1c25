"""Two nodes of a matrix under each other's names, where only the places of the points show it.

Exchanged back, both move as the points around them foretell; no other exchange does as much, nor
a turned sign at one node, and then neither asks to be exchanged with yet another.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from planner.modal.row_places import Foretold, foretold
from planner.recording.dof import Dof
from planner.recording.geometry import Geometry

# In surprise of the usual node: two exchanged nodes have more than SURPRISED each, less than
# EXPLAINED of theirs is left, an exchange of one of them with any other node brings less by CLEARER
# at least, turned signs at one node bring less than TURNED as much, and another exchange of one of
# them afterwards less than NEXT. Chosen on 60 frames, 25 panels and 25 pairs of bolted pieces
# (seeds 3000 ff.) with two nodes exchanged, three, signs turned, a row out of scale, and nothing.
SURPRISED, EXPLAINED, CLEARER, TURNED, NEXT = 2.0, 0.2, 2.0, 0.8, 1.0


@dataclass(frozen=True)
class Node:
    """A node's rows (k,) of what is foretold, in the order of their directions."""

    name: str
    directions: tuple[str, ...]
    rows: np.ndarray


def exchanged_nodes(
    dofs: Sequence[Dof], shapes: np.ndarray, geometry: Geometry
) -> tuple[str, str] | None:
    """Two nodes whose rows of shapes (n, m) fit each other's places, None where no two clearly do.

    Only nodes that were measured in the same directions.
    """
    found = foretold(dofs, shapes, geometry)
    if found is None:
        return None
    nodes = _nodes([dofs[k].positive for k in found.index])
    gains = _gains(found, nodes)
    a, b = (int(k) for k in np.unravel_index(np.argmax(gains), gains.shape))
    if not np.isfinite(gains[a, b]):
        return None
    surprise = _surprise(found, nodes)
    usual, before = float(np.median(surprise)), float(surprise[a] + surprise[b])
    after = _exchanged(found, nodes[a], nodes[b])
    left = float(np.sum(_surprise(after, nodes)[[a, b]]))
    rivals = np.delete(gains[[a, b]], [a, b], axis=1)
    clear = (
        before > 2 * SURPRISED * usual
        and left < EXPLAINED * before
        and np.max(rivals, initial=-np.inf) < gains[a, b] - CLEARER * usual
        and max(_turned(found, node) for node in nodes) < TURNED * gains[a, b]
        and np.max(_gains(after, nodes)[[a, b]]) < NEXT * usual
    )
    first, second = sorted((a, b))  # which of both is rounding's
    return (nodes[first].name, nodes[second].name) if clear else None


def _nodes(dofs: Sequence[Dof]) -> list[Node]:
    rows: dict[str, list[int]] = {}
    for k in sorted(range(len(dofs)), key=lambda k: dofs[k].direction):
        rows.setdefault(dofs[k].node, []).append(k)
    return [
        Node(name, tuple(dofs[k].direction for k in own), np.array(own))
        for name, own in rows.items()
    ]


def _surprise(found: Foretold, nodes: Sequence[Node]) -> np.ndarray:
    """(n,) of nodes, over all modes and directions."""
    each = np.sum(found.surprise, axis=1)
    return np.array([np.sum(each[node.rows]) for node in nodes])


def _exchanged(found: Foretold, one: Node, other: Node) -> Foretold:
    """As if the rows of two nodes had been exchanged."""
    values = found.values.copy()
    values[np.r_[one.rows, other.rows]] = found.values[np.r_[other.rows, one.rows]]
    return replace(found, values=values)


def _gains(found: Foretold, nodes: Sequence[Node]) -> np.ndarray:
    """(n, n) fall of −2 log likelihood where two nodes are exchanged, −∞ where they can't be."""
    gains = np.full((len(nodes), len(nodes)), -np.inf)
    for directions in {node.directions for node in nodes}:
        index = np.array([k for k, node in enumerate(nodes) if node.directions == directions])
        gains[np.ix_(index, index)] = _gains_alike(found, np.array([nodes[k].rows for k in index]))
    np.fill_diagonal(gains, -np.inf)
    return gains


def _gains_alike(found: Foretold, rows: np.ndarray) -> np.ndarray:
    """The same (n, n) of nodes with rows (n, k) in the same directions."""
    values, pull = found.values[rows], (found.precision @ found.values)[rows]
    joint = found.precision[rows[:, :, None, None], rows].transpose(0, 2, 1, 3)  # (n, n, k, k)
    square = np.einsum("adm,bem->abde", values, values)
    along = np.einsum("adm,bdm->ab", values, pull)
    # With change c = b − a at node a and −c at b: −(2 c·(pull_a − pull_b) + Σ c cᵀ · curve).
    slope = along + along.T - np.diag(along)[:, None] - np.diag(along)

    def both_ways(pairs: np.ndarray) -> np.ndarray:
        own = np.einsum("aade->ade", pairs)
        return own[:, None] + own[None] - pairs - pairs.swapaxes(2, 3)

    curve = np.einsum("abde,abde->ab", both_ways(square), both_ways(joint))
    return -(2 * slope + curve)


def _turned(found: Foretold, node: Node) -> float:
    """The same where signs of the node are turned, in whichever directions explain most."""
    pull = found.precision @ found.values
    best = -np.inf
    for size in range(1, node.rows.size + 1):
        for chosen in map(list, combinations(node.rows, size)):
            change = -2 * found.values[chosen]
            curve = found.precision[np.ix_(chosen, chosen)] @ change
            best = max(best, -float(np.sum(change * (2 * pull[chosen] + curve))))
    return best
