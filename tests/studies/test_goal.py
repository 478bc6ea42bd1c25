"""Knowing a milling path best: what naming it as the goal saves there.

`pytest -m slow tests/studies/test_goal.py -s` prints errors along the path; STUDY_SEEDS (4) and
STUDY_FIRST (201) as in test_acquisitions.py. A path is a straight line in joint space, a quarter
of the box long; errors are those at ten poses of it that are never measured.
"""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.campaign.cell import Cell
from planner.campaign.config import GoalTable
from planner.design.space_filling import NESTED
from tests.support.acquisition_cases import CELLS, OF_FRFS, Case, campaign, make

pytestmark = [pytest.mark.slow, pytest.mark.timeout(0)]
SEEDS, FIRST = int(os.environ.get("STUDY_SEEDS", "4")), int(os.environ.get("STUDY_FIRST", "201"))
ALONG, LONG, BUDGET = 10, 0.25, 3
STRATEGIES = "maximin_lhs", "integrated_variance", "mixed", "goal"


def on_a_path(case: Case) -> Case:
    """The case judged along a path, which its cell knows as the goal."""
    rng = np.random.default_rng([case.seed, 7])
    low, high = np.deg2rad(np.array(case.cell.config.workspace.joints_deg)).T
    begin = low + (1 - LONG) * (high - low) * rng.random(6)
    path = begin + np.linspace(0, LONG, ALONG)[:, None] * (high - low)
    cell = with_goal(case, np.rad2deg(path).tolist())
    return replace(
        case,
        cell=cell,
        unused=path,
        true_hz=np.array([case.truth.modes(q, case.true_hz.shape[1])[0] for q in path]),
        true_frf=np.array([case.truth.accelerance(q, case.lines_hz) for q in path[:OF_FRFS]]),
    )


def with_goal(case: Case, path_deg: list[list[float]]) -> Cell:
    """The cell with the path in its [goal] table."""
    table = {f: getattr(case.cell.config, f) for f in case.cell.config.__struct_fields__}
    config = type(case.cell.config)(**{**table, "goal": GoalTable(joints_deg=path_deg)})
    return Cell.load(Path(config.robot), config)


def test_the_path_is_known_better(tmp_path):
    errors = {s: [] for s in STRATEGIES}
    for name, seed in ((n, s) for s in range(FIRST, FIRST + SEEDS) for n in CELLS):
        robot, lacking = CELLS[name]
        plain = make(robot, seed, "updated", tmp_path / f"{robot}{seed}{lacking}", lacking)
        case = on_a_path(plain)
        for strategy, rows in errors.items():
            plan: str | list[int] = strategy
            if strategy in NESTED:
                plan = NESTED[strategy](case.cell.candidates.features, BUDGET, seed).tolist()
            rows.append([step.rmse_percent for step in campaign(case, [], plan, BUDGET)])
    print(f"\nfrequency RMSE in % along the path, {len(rows)} runs: after 1, 2, 3 measurements")
    for strategy, rows in errors.items():
        median, worst = np.median(rows, axis=0), np.quantile(rows, 0.9, axis=0)
        text = "  ".join(f"{m:.2f} ({w:.2f})" for m, w in zip(median, worst, strict=True))
        print(f"  {strategy:20s} median (9 of 10)  {text}")
    assert all(np.isfinite(rows).all() for rows in errors.values())
    # Naming the path has not been shown to beat the others; that it is known well, it must be.
    assert np.median(errors["goal"], axis=0)[-1] <= 0.3
