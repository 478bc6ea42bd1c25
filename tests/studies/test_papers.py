"""The papers' studies in full (`planner study all`): bounds that hold, and what does not, printed.

`pytest -m slow -s tests/studies/test_papers.py` takes some 20 minutes of one processor.
STUDY_FOLDER names where tables, pictures and pages are kept: studies that `planner study all --out`
has finished there are judged as they are.
"""

import os
from pathlib import Path

import numpy as np
import pytest

from planner.progress import quietly
from planner.studies.conduct import conduct_all

SMALL = bool(os.environ.get("STUDY_SMALL"))  # the versions cut down, to see that all runs
pytestmark = [pytest.mark.slow, pytest.mark.timeout(7200)]


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """All studies' answers by name, printed."""
    folder = Path(os.environ.get("STUDY_FOLDER") or tmp_path_factory.mktemp("studies"))
    told = conduct_all(folder, SMALL, quietly)
    for answer in told.studies:
        for table in (*answer.tables, answer.claims):
            print(f"\n{table.title}\n" + " | ".join(table.columns))
            for row in table.rows:
                print(" | ".join(c if isinstance(c, str) else f"{c:.3f}" for c in row))
    assert all(Path(file).stat().st_size > 0 for file in told.files)
    return {answer.study: answer for answer in told.studies}


@pytest.fixture
def report(request, answers):
    """The study's answer, with its files there."""
    answer = answers[request.param]
    assert all(Path(file).stat().st_size > 0 for file in answer.files)
    return answer


def table_of(report, name):
    return {table.name: table for table in report.tables}[name]


def numbers(report, name):
    return np.array([row[1:] for row in table_of(report, name).rows], dtype=float)


def holds(report, part):
    """Whether the one finding that contains this text holds, be it in kind."""
    (found,) = [f.verdict for f in report.findings if part in f.paper]
    return found.startswith("holds")


@pytest.mark.parametrize("report", ["busch2022"], indirect=True)
def test_busch2022(report):
    seven = table_of(report, "busch2022_figure_7_r2")
    r2 = dict(zip(seven.columns[1:], np.median(numbers(report, seven.name), axis=0), strict=True))
    assert min(r2[n] for n in ("rbf", "AR1", "NARGP")) > 0.9
    assert r2["rbf"] > r2["linear"]
    assert holds(report, "mostly reach R² > 0.9")
    assert holds(report, "cannot follow the frequencies")
    assert holds(report, "No kernel follows the damping ratios")
    names = {Path(file).stem for file in report.files}
    assert {f"busch2022_figure_{n}" for n in (7, 8, 9, 10, 11, 12)} <= names


@pytest.mark.parametrize("report", ["busch2020"], indirect=True)
def test_busch2020(report):
    table = table_of(report, "busch2020_r2")
    r2 = {row[0]: row[1] for row in table.rows}
    assert r2["simulation"] < 0.5
    published = [r2[name] for name in ("GP", "NARGP", "MFDGP") if name in r2]
    assert r2["fused modes"] > max(published)
    robots = numbers(report, "busch2020_robots")
    assert np.all(robots[:, :-1] > 0.8)  # every, every 2nd, 3rd, 4th experiment
    assert np.all(robots[:, -1] > 85)


@pytest.mark.parametrize("report", ["seyedhosseini2025"], indirect=True)
def test_seyedhosseini2025(report):
    errors = numbers(report, "seyedhosseini2025_errors")
    assert errors[:, 0].mean() < 5.0
    assert holds(report, "Damping ratios are predicted less surely")
    steps = dict(table_of(report, "seyedhosseini2025_steps").rows)
    assert steps["f off by, after: mean %"] < 1.0


@pytest.mark.parametrize("report", ["lei2023"], indirect=True)
def test_lei2023(report):
    assert holds(report, "Groups halve the number of models")
    kinds = table_of(report, "lei2023_kinds")
    frequencies = dict(zip(kinds.columns[1:], numbers(report, "lei2023_kinds")[0], strict=True))
    for way in ("one by one", "groups of three", "groups, others known", "by kind"):
        assert frequencies[f"{way}: mean"] > 0.9
    assert frequencies["all at once: mean"] > 0.9
    cost = numbers(report, "lei2023_cost")
    assert np.nanmax(cost[:, 2]) < 1e-3  # log-likelihoods, Kronecker against a direct Cholesky


@pytest.mark.parametrize("report", ["birk2025"], indirect=True)
def test_birk2025(report):
    frac = dict(zip(("12P", "24P"), numbers(report, "birk2025_table_4")[:2, 0], strict=True))
    assert frac["12P"] + 10 < frac["24P"] < 95
    assert len(table_of(report, "birk2025_table_5").rows) == 9
    assert holds(report, "24P with inertias free")
    assert holds(report, "24P by least squares of logarithms")
    assert holds(report, "Nobody reaches 100 %")
