"""What a low fidelity that learns is worth: updated, frozen and no simulation, error by hits.

`pytest -m slow tests/studies/test_fidelity.py -s` prints all curves; STARTS=20 for more of them.
Truths are MuJoCo models; everything goes through hammer hits, FRFs and identified modes.
"""

import os

import numpy as np
import pytest

from planner.campaign.build import build
from planner.campaign.cell import Cell
from planner.campaign.state import CampaignState
from tests.support.fidelity_cells import CELLS, MeasuredCell

pytestmark = [pytest.mark.slow, pytest.mark.timeout(6000)]
STARTS = int(os.environ.get("STARTS", "5"))
COUNTS = (1, 2, 3, 4, 6, 8, 12)
EARLY = COUNTS.index(4)
KINDS = ("updated", "frozen", "none")


def run(
    measured: MeasuredCell, cell: Cell, start: int
) -> tuple[list[float], list[float], list[bool]]:
    """RMSE in %, share inside 95 % intervals, doubts said; after COUNTS poses in random order."""
    order = np.random.default_rng(start).permutation(len(measured.measurements))
    scored = measured.scored(order, max(COUNTS))
    true_hz = measured.true_hz[scored]
    errors, inside, doubts = [], [], []
    for n in COUNTS:
        used = [measured.measurements[i] for i in order[:n]]
        state = CampaignState(measurements={m.pose: m for m in used})
        model = build(cell, state, lambda m, _: measured.frfs[m.pose])
        found = model.predict(measured.unused[scored])
        rising = np.sort(found.frequency_hz, axis=1)
        errors.append(100 * float(np.sqrt(np.mean(np.log(rising / true_hz) ** 2))))
        off = np.abs(found.frequency_hz - true_hz) / found.frequency_sd_hz
        inside.append(float(np.mean(off < 1.96)))
        doubts.append(any("lacks" in remark for remark in model.remarks))
    return errors, inside, doubts


def needed(errors: np.ndarray) -> str:
    """Median number of poses from which on the error stays below 1 %; errors (starts, COUNTS)."""
    below = errors[:, ::-1] <= 1.0
    first = np.argmin(below, axis=1)  # from the end: how many in a row are below
    first = np.where(below.all(axis=1), len(COUNTS), first)
    counts = np.array([*COUNTS, np.inf])[len(COUNTS) - first]
    middle = float(np.median(counts))
    return f"{middle:.0f}" if np.isfinite(middle) else f"over {COUNTS[-1]}"


@pytest.mark.parametrize("name", CELLS)
def test_curves(name, tmp_path):
    measured = CELLS[name](tmp_path)
    print(f"\n{name}: median RMSE in % (95 % intervals hold, %) over {STARTS} starts")
    print("  poses        " + "".join(f"{n:>14}" for n in COUNTS) + "   for 1 %")
    medians, doubts = {}, np.zeros(len(COUNTS))
    for kind in KINDS:
        cell = measured.cells(kind)
        runs = [run(measured, cell, start) for start in range(STARTS)]
        errors = np.array([r[0] for r in runs])
        medians[kind] = np.median(errors, axis=0)
        inside = 100 * np.mean([r[1] for r in runs], axis=0)
        cells = "".join(f"{e:>8.2f} ({i:3.0f})" for e, i in zip(medians[kind], inside, strict=True))
        print(f"  {kind:<12}{cells}   {needed(errors)}", flush=True)
        if kind == "updated":
            doubts = np.mean([r[2] for r in runs], axis=0)
    print("  lack said, % " + "".join(f"{100 * d:>14.0f}" for d in doubts))
    assert np.all(medians["updated"] <= 1.1 * medians["none"])
    if "right" in name:
        assert medians["updated"][EARLY] <= 1.0
        assert medians["updated"][EARLY] <= medians["frozen"][EARLY]
        assert doubts[EARLY] <= 0.05
    else:
        assert doubts[EARLY] >= 0.95
