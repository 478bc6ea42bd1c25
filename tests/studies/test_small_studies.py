"""A small version of every study from hits to claims: that it runs, and what must hold even so."""

import numpy as np
import pytest

from planner.progress import quietly
from planner.studies import registry
from planner.studies.conduct import conduct
from planner.studies.report import StudyAnswer


def holds(answer: StudyAnswer, part: str) -> bool:
    (found,) = [f.verdict for f in answer.findings if part in f.paper]
    return found.startswith("holds")


MUST_HOLD = {
    "busch2022": ("No kernel follows the damping ratios",),
    "busch2020": ("The simulation alone, which lacks a mode",),
    "seyedhosseini2025": ("Damping ratios are predicted less surely",),
    "lei2023": ("Groups halve the number of models",),
    "birk2025": ("24P reproduces FRFs far better than 12P", "Nobody reaches 100 %"),
}


LONG = {"birk2025", "busch2020", "busch2022"}  # minutes; the others take the same way


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow if n in LONG else ()) for n in registry.NAMES]
)
def test_a_small_study_runs_from_hits_to_claims(name, tmp_path):
    answer = conduct(name, tmp_path, True, quietly)
    assert answer.small
    assert answer.data.startswith("SIMULATED")
    page = (tmp_path / f"{name}.html").read_text()
    assert registry.load(name).PAPER.citation.replace("&", "&amp;") in page
    assert page.count("data:image/png;base64,") >= 2
    for finding in answer.findings:
        assert finding.here
        assert finding.rule
        assert finding.reason
    assert all(holds(answer, part) for part in MUST_HOLD[name])
    for table in answer.tables:
        numbers = [v for row in table.rows for v in row if not isinstance(v, str)]
        assert np.isfinite(numbers).any()
