"""Wrong units, signs and axes, another gain or tool are asked about, good imports are not."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from planner.campaign.alternatives import OTHER_TOOL
from planner.campaign.campaign import Campaign
from planner.campaign.chain_faults import SCALED, TURNED, ChainFault
from planner.campaign.import_checks import Claim, question_about
from planner.campaign.model import Model
from planner.dataset.measure import MeasuredPose, measure
from planner.dataset.screened_files import Source
from planner.frf.frf import Frf
from planner.recording.folder import TABLE
from planner.recording.records import Hit
from tests.support import plain_arm
from tests.support.case_campaigns import CaseCampaign, lacking
from tests.support.chain_cases import FAULTS, SLIGHTEST, fault, judged, scaled, shown_by, sums_of
from tests.support.fitted_cases import Case, everyday, one_thing
from tests.support.outside import call, record
from tests.support.plain_arm import measured_poses
from tests.support.robots import BAND_HZ


@pytest.mark.parametrize(("robot", "kind"), [("kr240 plane", "nothing"), ("kr10", "soft base")])
def test_faults_of_a_chain_are_asked_about_and_named(robot, kind, tmp_path):
    rng = np.random.default_rng(700)
    for sums in sums_of(lacking(robot, kind, 700, tmp_path), 2):
        assert judged(sums) is None
        for name in FAULTS:
            if name in SLIGHTEST:  # told at most poses
                continue
            true = fault(name, rng)
            found = judged(shown_by(sums, true))
            assert found is not None, name
            np.testing.assert_allclose(found.matrix, true, rtol=0.6)


@pytest.mark.parametrize(
    ("one", "said"),
    [
        (
            ChainFault(1e3 * np.eye(3), (0, 1, 2), 1030.0),
            "1000 times too large: units or sensitivity",
        ),
        (ChainFault(np.eye(3), (1,), 0.104), "channel y is 9.81 times too small"),
        (ChainFault(np.eye(3), (0, 1, 2), 2.1), "about 2.1 times too large"),
        (ChainFault(-np.eye(3)), "answers against every hit"),
        (ChainFault(np.diag([1.0, -1, 1])), "channel y a wrong sign"),
        (
            ChainFault(np.array([[0, -1.0, 0], [1, 0, 0], [0, 0, 1]])),
            "turned by 90°: x reads what −y",
        ),
        (ChainFault(np.eye(3)[[1, 0, 2]]), "axes look exchanged: x reads what y should"),
        (ChainFault(np.eye(3), order=(1, 0, 2)), "were those along x along y, y along x?"),
        (ChainFault(np.eye(3), (0, 1, 2), 0.89), "accelerations are 11 % too small"),
        (ChainFault(np.eye(3), delay_s=2e-3), "accelerations come 2 ms after forces"),
        (ChainFault(np.eye(3), delay_s=-2e-3), "forces come 2 ms after accelerations"),
        (
            ChainFault(np.eye(3), corner_hz=1.5),
            "accelerations lack what is slow, as by",
        ),
        (ChainFault(np.eye(3), corner_hz=-1.5), "forces lack what is slow"),
        (ChainFault(np.eye(3), window_rate_1_s=3.0), "3 1/s faster: does the analyser lay"),
        (ChainFault(np.eye(3), window_rate_1_s=-3.0), "3 1/s slower: was the analyser's"),
    ],
)
def test_faults_in_words(one, said):
    assert said in one.asked


def test_filters_are_undone():
    """Of an oscillator under an exponential window, by what a delay and a high-pass are there."""
    hz, rate = np.linspace(2.0, 40.0, 80), 3.0
    s = 2j * np.pi * hz + rate
    true = np.eye(3)[..., None] * s**2 / (s**2 + 6 * s + (2 * np.pi * 15) ** 2)
    flat = np.ones((3, 3, 80))
    fault = ChainFault(np.eye(3), delay_s=1e-3, corner_hz=1.5)
    shown = true * np.exp(-1e-3 * s) * s / (s + 2 * np.pi * 1.5)
    frf = Frf(hz, shown, 1e-4 * flat, flat, (1, 1, 1), (2.0, 40.0), rate)
    found, volume = fault.undone(frf)
    np.testing.assert_allclose(found.accelerance, true, rtol=1e-12, atol=1e-15)
    grown = np.abs(found.accelerance[0, 0] / shown[0, 0])
    np.testing.assert_allclose(found.variance[0, 0], 1e-4 * grown**2)
    assert volume == pytest.approx(6 * np.mean(np.log(grown)))
    windowed = ChainFault(np.eye(3), window_rate_1_s=2.0).undone(frf)[0]
    assert windowed.exponential_rate_1_s == 5.0


def test_every_fault_can_be_told_in_words():
    assert all(one.asked.endswith("?") for one in (*TURNED, *(f for own in SCALED for f in own)))


def test_the_commands_ask_about_units_and_take_the_answer(tmp_path):
    begun, truth = measured_poses(tmp_path, 0)
    (proposal,), cell = begun.next(), begun.directory
    pose, (a, *others) = proposal.pose, proposal.joints_deg
    made = record(truth, tmp_path / "made", pose, [a, *others])
    for factor in ("1000", "9.81"):
        folder = tmp_path / f"times {factor}"
        paths = [scaled(path, folder / "data", float(factor)) for path in hits_in(made)]
        shutil.copy(made / TABLE, folder)
        code, out, err = call("import", cell, folder / TABLE, "--json")
        assert code == 3
        assert json.loads(out)["question"]["about"] == "chain"
        assert f"{factor} times too large: units or sensitivity" in err
        assert f"planner undo {cell}" in err
        assert f"planner confirm {cell} {pose}" in err
        held = Campaign(cell)
        assert len(held.state.held[pose].hits) == len(paths)
        if factor == "1000":
            held.undo()
    held.confirm(pose)
    assert [m.pose for m in held.state.used] == [pose]
    # Of a chain that the engineer called right the same is not asked again; another one is.
    there = a + 20, *others
    files = hits_in(record(truth, tmp_path / "there", "X2", list(there)))
    for factor, doubted in (("9.81", ""), ("1", "times too small: units or sensitivity")):
        paths = [scaled(path, tmp_path / f"then times {factor}", float(factor)) for path in files]
        measured = measure([Source(path, path.name) for path in paths], plain_arm.BAND_HZ)
        asked = question_about(Claim(held.model, held.state, "X2", there), measured)
        assert (asked is not None and asked.about == "chain") == bool(doubted)
        assert doubted in (asked.text if asked else "")


def hits_in(folder: Path) -> list[Path]:
    return sorted((folder / "data").iterdir())


def test_a_window_that_nobody_stated_is_asked_about(first_pose):
    campaign, joints_deg = Campaign(first_pose.cell), tuple(first_pose.joints_deg)

    def faded(hit: Hit, rate_1_s: float) -> Hit:
        t = (np.arange(len(hit.force_n)) - hit.pulse.peak) / hit.sampling_rate_hz
        by = np.exp(-rate_1_s * np.maximum(t, 0.0))
        return replace(hit, force_n=hit.force_n * by, acceleration_m_s2=hit.acceleration_m_s2 * by)

    read = [hit for path in first_pose.files for hit in Source(path, path.name).read()[0]]
    for rate_1_s, stated_1_s, asks in ((0.0, 0.0, False), (2.0, 0.0, True), (2.0, 2.0, False)):
        cell, hits = campaign.cell, tuple(faded(hit, rate_1_s) for hit in read)
        modes = msgspec.structs.replace(cell.config.modes, window_rate_1_s=stated_1_s)
        cell = replace(cell, config=msgspec.structs.replace(cell.config, modes=modes))
        claim = Claim(replace(campaign.model, cell=cell), campaign.state, "X", joints_deg)
        asked = question_about(claim, MeasuredPose((), BAND_HZ, "h1", stated_1_s, given=hits))
        assert (asked is not None and "[modes] window_rate_1_s" in asked.text) == asks
        if asked is not None:
            told = float(asked.text.split("fades by ")[1].split()[0])
            assert told == pytest.approx(2.0, rel=0.03)
            assert asked.about == "chain"


POSES, LOUD = 3, 1.2


@pytest.fixture(scope="module")
def case(tmp_path_factory) -> Case:
    """Nothing is wrong but what is changed: quick (others: test_pose_mismatch_rates.py)."""
    return one_thing("arm of four", "nothing", 7003, tmp_path_factory.mktemp("case"))


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
def test_an_early_pose_whose_files_are_of_another_is_asked_about(tmp_path):
    """The hits of a pose that is never listed were given for the second one."""
    case = everyday("arm of four", 7002, tmp_path)
    changed = list(case.measured)
    changed[1] = case.measured[-1]
    campaign = CaseCampaign.of(replace(case, measured=tuple(changed)))
    state = campaign.state(2, unlisted=[2])
    claim = Claim(campaign.model(state), state, "X", campaign.angles(case.q[2]))
    asked = question_about(claim, MeasuredPose((), case.band_hz, given=case.measured[2].hits))
    assert asked is not None
    assert (asked.about, asked.fits) == ("earlier", "P1")
    assert "without them all others agree. Are its files and angles right" in asked.text


def test_a_visit_with_another_gain_is_told_and_bends_nothing(case):
    changed = list(case.measured)
    louder = (replace(h, acceleration_m_s2=LOUD * h.acceleration_m_s2) for h in changed[1].hits)
    changed[1] = MeasuredPose((), case.band_hz, given=tuple(louder))
    model = CaseCampaign.of(replace(case, measured=tuple(changed))).after(POSES)
    told = " ".join(model.low.misread)
    size = re.search(r"at P1 accelerations are (\S+) times as large", told)
    assert float(size[1]) == pytest.approx(LOUD, abs=0.05)
    assert_chain_bends_nothing(model)


def assert_chain_bends_nothing(model: Model) -> None:
    posterior = model.low.identified_robot.posterior
    scale, allowed = posterior.chain_scale
    assert posterior.explains
    assert posterior.structure.effects == ()
    assert abs(scale) < 2 * allowed
