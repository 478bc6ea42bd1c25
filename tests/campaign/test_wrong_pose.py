"""Hits of another pose, with a wrong angle, by another chain or tool, after few measurements.

How often it is asked after more, and of what else: test_pose_mismatch_rates.py. Files of another
pose before: `pytest -m slow tests/campaign/test_wrong_pose.py`.
"""

import csv
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from planner.campaign.alternatives import OTHER_TOOL
from planner.campaign.campaign import Campaign
from planner.campaign.events import Question
from planner.campaign.import_checks import Claim, question_about
from planner.campaign.low_fidelity import LowFidelity
from planner.campaign.model import Model
from planner.campaign.pose_mismatch import known_poses
from planner.dataset.measure import MeasuredPose, measure
from planner.dataset.screened_files import Source
from planner.proof.deviation import Deviation
from planner.proof.fault_injection import InjectedFaults
from planner.proof.load import load_truth
from planner.proof.measurement_errors import MeasurementErrors
from planner.proof.model import Truth
from planner.recording.folder import TABLE
from planner.report.imports import how_to_answer
from tests.support.case_campaigns import CaseCampaign
from tests.support.fitted_cases import Case, one_thing
from tests.support.outside import HAMMER
from tests.support.plain_arm import BAND_HZ, JOINTS_DEG, make_plain_arm, plain_campaign
from tests.support.struck_poses import record_by_hand

OTHERS = 3  # poses of the workspace that are hit beside
ASKEW = MeasurementErrors(angle_deg=2.0, readback_deg=0.005)
BOX_RAD = np.deg2rad(JOINTS_DEG)


@dataclass(frozen=True)
class Arm:
    """A campaign of a small arm, and its true robot, whose springs are off by some 15 %."""

    campaign: Campaign
    truth: Truth

    @classmethod
    def of(cls, folder: Path) -> "Arm":
        robot = make_plain_arm(folder / "robot")
        plan = plain_campaign(folder / "campaign.toml")
        off = Deviation(923, stiffness=0.15, damping=0.1, inertia=0.04, com_m=0.003)
        return cls(Campaign.new(folder / "campaign", robot, plan), load_truth(robot, off))

    def record(self, folder: Path, poses: Mapping[str, np.ndarray], number: int) -> Path:
        """Two hits an axis at each pose, in rad."""
        stated = [(name, np.round(np.rad2deg(q), 4)) for name, q in poses.items()]
        axes = [f"+{axis}" for axis in "xyz" for _ in range(2)]
        rng = np.random.default_rng([923, number])
        record_by_hand(folder, self.truth, InjectedFaults(Deviation()), ASKEW, stated, axes, HAMMER,
                       rng)  # fmt: skip
        return folder


@pytest.fixture(scope="module")
def begun(tmp_path_factory) -> Arm:
    """With one measured pose."""
    folder = tmp_path_factory.mktemp("begun")
    arm = Arm.of(folder)
    (pose,) = arm.campaign.next()
    made = arm.record(folder / "hits", {pose.pose: np.deg2rad(pose.joints_deg)}, 0)
    (report,) = arm.campaign.import_paths((made,))
    assert report.question is None
    return arm


def measured_at(arm: Arm, folder: Path, q: np.ndarray) -> list[MeasuredPose]:
    """What the hits at each of the poses q (n, dof) in rad give."""
    made = arm.record(folder, {f"W{i}": row for i, row in enumerate(q)}, 9)
    with open(made / TABLE, newline="") as file:
        rows = list(csv.DictReader(file))
    sources = {
        f"W{i}": tuple(Source(made / r["file"], r["file"], r["hit"], int(r["repeat"]))
                       for r in rows if r["pose"] == f"W{i}")
        for i in range(len(q))
    }  # fmt: skip
    return [measure(own, BAND_HZ) for own in sources.values()]


def test_another_pose_is_asked_about_before_three_are_measured(begun, tmp_path):
    campaign = begun.campaign
    q = np.random.default_rng(924).uniform(*BOX_RAD.T, (OTHERS, 4))
    first = np.deg2rad(campaign.state.used[0].joints_deg)
    *found, again = measured_at(begun, tmp_path, np.vstack([q, first]))

    def asked(at: int, one: MeasuredPose):
        angles = tuple(np.rad2deg(q[at]).tolist())
        return question_about(Claim(campaign.model, campaign.state, "X", angles), one)

    assert not any(asked(i, found[i]) for i in range(OTHERS))
    repeated = [asked(i, again) for i in range(OTHERS)]
    assert [one and one.fits for one in repeated] == ["P001"] * OTHERS
    assert all("are like those measured at P001" in one.text for one in repeated if one)
    # Only what is like the hits of then may repeat them.
    claim = Claim(campaign.model, campaign.state, "X", tuple(np.rad2deg(q[0]).tolist()))
    for one, repeats in ((again, True), *((one, False) for one in found)):
        there = [a.pose for a in known_poses(claim, one.one_hit_frf.within(BAND_HZ))]
        assert ("P001" in there) == repeats


def test_a_wrong_angle_at_the_first_pose_is_asked_about(tmp_path):
    """FRFs tell nothing then, for the simulation alone lacks too much: the setpoint does."""
    arm = Arm.of(tmp_path)
    (pose,) = arm.campaign.next()
    folder = arm.record(tmp_path / "P001", {"P001": np.deg2rad(pose.joints_deg)}, 0)
    read = other_sign(folder, "joint_4_deg")
    (report,) = arm.campaign.import_paths((folder,))
    asked = report.question
    assert asked is not None
    assert asked.about == "readback"
    assert f"{abs(read - pose.joints_deg[3]):.2f}° from its setpoint" in asked.text


def test_how_an_angle_of_a_pose_before_is_corrected(tmp_path):
    asked = Question("These hits contradict those of P001.", fits="P001", about="earlier")
    assert "--pose P001b" in how_to_answer(tmp_path, "P002", asked)
    # Of new hits of the same pose `withdraw` would set aside these: their import is undone first.
    own = how_to_answer(tmp_path, "P001", asked)
    assert own.index("planner undo") < own.index("planner withdraw") < own.index("--pose P001b")
    assert "--pose P001c" in own


def test_other_commands_take_poses_where_they_stood(begun, monkeypatch):
    campaign = begun.campaign
    stated = np.deg2rad(campaign.state.used[0].joints_deg)
    assert all(np.array_equal(r.q, stated) for r in campaign.used_recordings)
    monkeypatch.setattr(LowFidelity, "stood", lambda self, q: q + 0.1)
    monkeypatch.setattr(LowFidelity, "misread", ("At P001 a1 stood elsewhere.",))
    np.testing.assert_allclose(campaign.used_recordings[0].q, stated + 0.1)
    assert campaign.dataset(BAND_HZ).remarks[0] == "At P001 a1 stood elsewhere."


def other_sign(folder: Path, column: str) -> float:
    """A table that says the other sign of a joint's angle, in degrees: what it says then."""
    with open(folder / TABLE, newline="") as file:
        rows = list(csv.DictReader(file))
    read = -float(rows[0][column])
    with open(folder / TABLE, "w", newline="") as file:
        table = csv.DictWriter(file, list(rows[0]))
        table.writeheader()
        table.writerows({**row, column: read} for row in rows)
    return read


POSES, LOUD = 3, 1.2


@pytest.fixture(scope="module")
def case(tmp_path_factory) -> Case:
    return one_thing("arm of four", "soft base", 7002, tmp_path_factory.mktemp("case"))


def test_another_tool_and_a_wrong_unit_are_asked_about_and_nothing_else(case):
    campaign = CaseCampaign.of(case)
    state = campaign.state(POSES, unlisted=[POSES])
    claim = Claim(campaign.model(state), state, "X", campaign.angles(case.q[POSES]))
    right = case.measured[POSES].hits
    in_millinewtons = tuple(replace(hit, force_n=1e3 * hit.force_n) for hit in right)
    asked = [
        question_about(claim, MeasuredPose((), case.band_hz, given=hits))
        for hits in (right, case.heavier[POSES].hits, in_millinewtons)
    ]
    assert asked[0] is None
    assert OTHER_TOOL in asked[1].text
    assert "1000 times too small: units" in asked[2].text
    assert not claim.model.low.misread
    assert_chain_bends_nothing(claim.model)


@pytest.mark.slow
def test_an_early_pose_whose_files_are_of_another_is_asked_about(case):
    """The hits of a pose that is never listed were given for the second one."""
    changed = list(case.measured)
    changed[1] = case.measured[-1]
    campaign = CaseCampaign.of(replace(case, measured=tuple(changed)))
    state = campaign.state(2, unlisted=[2])
    claim = Claim(campaign.model(state), state, "X", campaign.angles(case.q[2]))
    asked = question_about(claim, MeasuredPose((), case.band_hz, given=case.measured[2].hits))
    assert (asked.about, asked.fits) == ("earlier", "P1")
    assert "without them all others agree. Are its files and angles right" in asked.text


def louder(pose: MeasuredPose) -> MeasuredPose:
    hits = (replace(h, acceleration_m_s2=LOUD * h.acceleration_m_s2) for h in pose.hits)
    return MeasuredPose((), pose.band_hz, given=tuple(hits))


def test_a_visit_with_another_gain_is_told_and_bends_nothing(case):
    changed = list(case.measured)
    changed[1] = louder(changed[1])
    model = CaseCampaign.of(replace(case, measured=tuple(changed))).after(POSES)
    told = " ".join(model.low.misread)
    size = re.search(r"at P1 accelerations are (\S+) times as large", told)
    assert float(size[1]) == pytest.approx(LOUD, abs=0.05)
    assert_chain_bends_nothing(model)


def assert_chain_bends_nothing(model: Model) -> None:
    posterior = model.low.identified_robot.posterior
    scale, allowed = posterior.chain_scale
    assert posterior.explains
    assert abs(scale) < 2 * allowed
