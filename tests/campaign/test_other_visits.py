"""One visit by another chain, or with another tool, than all others."""

import re
from dataclasses import replace

import pytest

from planner.campaign.alternatives import OTHER_TOOL
from planner.campaign.import_checks import Claim, question_about
from planner.dataset.measure import MeasuredPose
from tests.support.case_campaigns import CaseCampaign
from tests.support.fitted_cases import Case, everyday

POSES, LOUD = 4, 1.2


@pytest.fixture(scope="module")
def case(tmp_path_factory) -> Case:
    return everyday("arm of four", 7002, tmp_path_factory.mktemp("case"))


def test_another_tool_is_asked_about_and_the_same_one_is_not(case):
    campaign = CaseCampaign.of(case)
    state = campaign.state(POSES, unlisted=[POSES])
    claim = Claim(campaign.model(state), state, "X", campaign.angles(case.q[POSES]))
    asked = [
        question_about(claim, MeasuredPose((), case.band_hz, given=poses[POSES].hits))
        for poses in (case.measured, case.heavier)
    ]
    assert asked[0] is None
    assert OTHER_TOOL in asked[1].text


def louder(pose: MeasuredPose) -> MeasuredPose:
    hits = (replace(h, acceleration_m_s2=LOUD * h.acceleration_m_s2) for h in pose.hits)
    return MeasuredPose((), pose.band_hz, given=tuple(hits))


@pytest.mark.parametrize("visit", [None, 1])
def test_a_visit_with_another_gain_is_told_and_bends_nothing(case, visit):
    measured = list(case.measured)
    if visit is not None:
        measured[visit] = louder(measured[visit])
    model = CaseCampaign.of(replace(case, measured=tuple(measured))).after(POSES)
    told = " ".join(model.low.misread)
    if visit is None:
        assert told == ""
    else:
        size = re.search(rf"at P{visit} accelerations are (\S+) times as large", told)
        assert float(size[1]) == pytest.approx(LOUD, abs=0.05)
    posterior = model.low.identified_robot.posterior
    scale, allowed = posterior.chain_scale
    assert posterior.explains
    assert abs(scale) < 2 * allowed
