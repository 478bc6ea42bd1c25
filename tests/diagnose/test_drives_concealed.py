"""One law in two to four joints, concealed in robots of three kinds: pytest -m slow -s (minutes).

STUDY_SEEDS (12) and STUDY_FIRST (501) choose the cases; seeds 1 to 3 were looked at while this was
made.
"""

import os

import pytest

from planner.truth.arms import ARMS
from planner.truth.cases import make_case
from tests.support.screened_cases import Verdict, judge, table

SEEDS, FIRST = int(os.environ.get("STUDY_SEEDS", "12")), int(os.environ.get("STUDY_FIRST", "501"))


pytestmark = [pytest.mark.slow, pytest.mark.timeout(0)]


@pytest.fixture(scope="module")
def verdicts(tmp_path_factory) -> list[Verdict]:
    """What is said of the cases."""
    verdicts, place = [], tmp_path_factory.mktemp("drives")
    for seed in range(FIRST, FIRST + SEEDS):
        folder = place / str(seed)
        case = make_case("drives", sorted(ARMS)[seed % len(ARMS)], seed, folder)
        verdicts.append(judge(folder, case.answer))
        print(seed, verdicts[-1].hidden, "said", verdicts[-1].said, flush=True)
    print(table(verdicts))
    return verdicts


def test_joints_that_follow_one_law_are_named(verdicts):
    assert len(verdicts) == SEEDS > 0
    assert sum(v.right for v in verdicts) >= 0.5 * len(verdicts)


@pytest.mark.xfail(
    raises=AssertionError,
    reason="two cases of play are called hardening in the same joints (5 of 32 places)",
)
def test_hardly_any_law_is_made_up(verdicts):
    said = [place for v in verdicts for place in v.said]
    made_up = [p for v in verdicts for p in v.said if p not in v.hidden and p[0] != "unknown"]
    assert len(made_up) <= 0.1 * len(said)
