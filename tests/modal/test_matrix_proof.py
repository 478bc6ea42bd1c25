"""Proofs on fresh roving-hammer sets: shapes, intervals, naming of faults, beside a peer.

SEED=5000 pytest -m slow -s tests/modal/test_matrix_proof.py
"""

import os
import re
from collections import Counter

import numpy as np
import pytest

from planner.modal.consistency import check
from planner.modal.matrix_modes import modes_of_matrix
from tests.support.rough_hammer_sets import geometry_of, rough_set, spoiled, tellable, told

pytestmark = [pytest.mark.slow, pytest.mark.timeout(3000)]
SEED = int(os.environ.get("SEED", "2000"))
SETS, MISSING = (range(SEED + first, SEED + first + count) for first, count in ((0, 42), (100, 15)))
# Whose sign nobody can tell: rows that move less than this (rms, of the usual row); and nodes whose
# rows differ by less than this, relatively, may stand under each other's names.
STILL, ALIKE = 0.3, 0.3


def line(name, values):
    """Figures over modes; returns the shares within the limits and covered."""
    got = [t for t in values if t is not None]
    macs = np.array([t.mac for t in got])
    scales = np.abs([t.scale for t in got])
    right, sized = np.mean(macs >= 0.995), np.mean(scales < 0.03)
    real, imag = np.mean([t.real for t in got]), np.mean([t.imag for t in got])
    f = np.mean([abs(t.frequency_z) < 1.96 for t in got])
    d = np.mean([abs(t.damping_z) < 1.96 for t in got])
    print(
        f"{name}: found {len(got)} of {len(values)}; MAC >= 0.995 {100 * right:.0f} % (least "
        f"{macs.min():.3f}); scale within 3 % {100 * sized:.0f} % (worst {100 * scales.max():.1f});"
        f" 95 % intervals cover shapes {real:.3f} real, {imag:.3f} imaginary, frequency {f:.3f},"
        f" damping {d:.3f}",
        flush=True,
    )
    return len(got) / len(values), right, sized, (real + imag) / 2


def faults_named(case, found, tally):
    """Turn signs and exchange points of one set, and count what is said about them."""
    rng = np.random.default_rng([*map(int, case.references), 7])
    n, nodes = len(case.structure.nodes), list(dict.fromkeys(case.structure.nodes))
    here = geometry_of(case)
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
    values, calm, tally, extra = [], [], Counter(), []
    for seed in SETS:
        case = rough_set(seed)
        found = modes_of_matrix(case.matrix, case.band_hz, geometry_of(case))
        seen = told(case, found.modes, found.dofs)
        values += seen
        calm += seen if case.drift < 0.0025 else []
        extra.append(max(0, len(found.modes) - case.poles.size))
        faults_named(case, found, tally)
    print(f"\n{len(SETS)} sets; more modes than there are: {extra}")
    line("all", values)
    share, right, sized, cover = line("drift below 0.25 %", calm)
    for name in sorted(tally):
        print(f"  {name}: {tally[name]}")
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
        found = modes_of_matrix(case.matrix, case.band_hz, geometry_of(case))
        placed += told(case, found.modes, found.dofs)
        found = modes_of_matrix(case.matrix, case.band_hz)
        seen = told(case, found.modes, found.dofs)
        values += seen
        known += [t for t, sure in zip(seen, tellable(case), strict=True) if sure]
    print()
    share, right, sized, cover = line("a fifth missing, places known", placed)
    bare = line("a fifth missing, no geometry", values)[3]
    sure = line("of these, every point felt by a reference that moves", known)
    assert min(share, sure[0]) > 0.96
    assert min(right, sure[1]) > 0.9
    assert min(sized, sure[2]) > 0.9
    assert all(0.9 < c < 0.985 for c in (cover, bare))
