"""Proofs on fresh roving-hammer sets: shapes, intervals, naming of faults, beside a peer.

pytest -m slow -s tests/modal/test_matrix_proof.py
"""

import re
from collections import Counter

import numpy as np
import pytest

from planner.modal.consistency import check
from planner.modal.matrix_modes import modes_of_matrix
from tests.support.rough_hammer_sets import geometry_of, rough_set, spoiled, tellable, told

pytestmark = [pytest.mark.slow, pytest.mark.timeout(3000)]
SETS, MISSING = range(2000, 2042), range(2100, 2115)
# Whose sign nobody can tell: rows that move less than this (rms, of the usual row); and nodes whose
# rows differ by less than this, relatively, may stand under each other's names.
STILL, ALIKE = 0.3, 0.3


def figures(name, values):
    """Shares found, of the right shape and size, and covered by intervals; and printed."""
    got = [t for t in values if t is not None]
    found = {
        "found": len(got) / len(values),
        "MAC >= 0.995": np.mean([t.mac >= 0.995 for t in got]),
        "scale within 3 %": np.mean([abs(t.scale) < 0.03 for t in got]),
        "covered": np.mean([(t.real + t.imag) / 2 for t in got]),
    }
    print(name, found, flush=True)
    return found.values()


def faults_named(case, found, tally):
    """Turn signs and exchange points of one set, and count what is said about them."""
    rng = np.random.default_rng([*map(int, case.references), 7])
    n, nodes = len(case.structure.nodes), list(dict.fromkeys(case.structure.nodes))
    here = geometry_of(case.structure)
    hz = np.abs(found.found.fit.poles) / (2 * np.pi)
    low, high = case.band_hz
    modes = np.flatnonzero((hz >= low) & (hz <= high) & (found.found.weak <= 1))

    def said(order=None, rows=(), columns=(), geometry=here):
        sign = np.ones((n, 3))
        sign[list(rows)] *= -1
        sign[:, list(columns)] *= -1
        order = np.arange(n) if order is None else order
        return check(*spoiled(case, found.found, order, sign), modes, geometry)

    def count(kind, checks, right):
        tally[f"{kind}: named" if right else f"{kind}: silent or other"] += 1
        tally[f"{kind}: wrong"] += bool(checks.faults) and not right

    for geometry, name in ((here, "with geometry"), (None, "without")):
        tally[f"nulls {name}"] += 1
        tally[f"nulls {name}: accused"] += bool(said(geometry=geometry).faults)
        column = int(rng.integers(3))
        checks = said(columns=[column], geometry=geometry)
        right = checks.turned == (case.matrix.references[column],) and len(checks.faults) == 1
        count(f"column {name}", checks, right)
    true = case.shapes.real / np.sqrt(np.mean(case.shapes.real**2, axis=0))
    moves = np.sqrt(np.sum(true**2, axis=1) / np.mean(np.sum(true**2, axis=1)))
    for row in rng.choice(n, 2, replace=False).tolist():
        checks = said(rows=[row])
        right = checks.turned_rows == (case.matrix.responses[row],) and len(checks.faults) == 1
        # At a reference row and column are turned alike: which, only the neighbours can tell.
        right = right or checks.turned == (case.matrix.responses[row],)
        still = " that hardly moves" if moves[row] < STILL else ""
        count(f"row of a {case.kind}{still}", checks, right)
    for a, b in (rng.choice(len(nodes), 2, replace=False) for _ in range(2)):
        owner = np.array(case.structure.nodes)
        one, two = np.flatnonzero(owner == nodes[a]), np.flatnonzero(owner == nodes[b])
        order = np.arange(n)
        order[one], order[two] = two, one
        checks = said(order=order)
        named = rf"Nodes ({nodes[a]} and {nodes[b]}|{nodes[b]} and {nodes[a]})\b"
        right = len(checks.faults) == 1 and bool(re.match(named, checks.faults[0]))
        apart = np.linalg.norm(true[one] - true[two]) / np.linalg.norm(true[[*one, *two]])
        still = np.max(moves[[*one, *two]]) < STILL or apart < ALIKE
        alike = " of nodes that hardly move, or alike" if still else ""
        count(f"exchange on a {case.kind}{alike}", checks, right)


def test_fresh_sets():
    calm, tally = [], Counter()
    for seed in SETS:
        case = rough_set(seed)
        found = modes_of_matrix(case.matrix, case.band_hz, geometry_of(case.structure))
        calm += told(case, found.modes, found.dofs) if case.drift < 0.0025 else []
        faults_named(case, found, tally)
    share, right, sized, cover = figures("drift below 0.25 %", calm)
    print(tally)
    assert share > 0.97
    assert right > 0.95
    assert sized > 0.9
    assert 0.9 < cover < 0.985
    assert tally["nulls with geometry: accused"] == tally["nulls without: accused"] == 0
    assert tally["column with geometry: named"] > 0.95 * len(SETS)
    for kind, rows, nodes in (("panel", 0.9, 0.9), ("pieces", 0.9, 0.9), ("frame", 0.5, 0.8)):
        for fault, least in (("row of", rows), ("exchange on", nodes)):
            named, silent = (
                tally[f"{fault} a {kind}: {word}"] for word in ("named", "silent or other")
            )
            assert named > least * (named + silent)
            assert tally[f"{fault} a {kind}: wrong"] <= 1


def test_a_fifth_is_missing():
    values, known, placed = [], [], []
    for seed in MISSING:
        case = rough_set(seed, missing=0.2, drift=0.001)
        found = modes_of_matrix(case.matrix, case.band_hz, geometry_of(case.structure))
        placed += told(case, found.modes, found.dofs)
        found = modes_of_matrix(case.matrix, case.band_hz)
        seen = told(case, found.modes, found.dofs)
        values += seen
        known += [t for t, sure in zip(seen, tellable(case), strict=True) if sure]
    share, right, sized, cover = figures("a fifth missing, places known", placed)
    *_, bare = figures("a fifth missing, no geometry", values)
    sure = tuple(figures("of these, every point felt by a reference that moves", known))
    assert min(share, sure[0]) > 0.96
    assert min(right, sure[1]) > 0.9
    assert min(sized, sure[2]) > 0.9
    assert all(0.9 < c < 0.985 for c in (cover, bare))
