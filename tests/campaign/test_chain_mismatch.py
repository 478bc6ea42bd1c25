"""Wrong units, signs and axes are asked about at the first pose, good imports are not."""

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import msgspec
import numpy as np
import pytest

from planner.campaign.campaign import Campaign
from planner.campaign.chain_faults import SCALED, TURNED, ChainFault
from planner.campaign.import_checks import Claim, question_about
from planner.campaign.state import CampaignState
from planner.dataset.measure import MeasuredPose, measure
from planner.dataset.screened_files import Source
from planner.frf.frf import Frf
from planner.recording.folder import TABLE
from planner.recording.records import Hit
from tests.support.case_campaigns import lacking
from tests.support.chain_cases import FAULTS, SLIGHTEST, fault, judged, scaled, shown_by, sums_of
from tests.support.outside import call
from tests.support.shipped_campaign import RECORDINGS, shipped_campaign, shipped_pool


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
    campaign, pool = shipped_campaign(tmp_path), shipped_pool()
    lines = (RECORDINGS / TABLE).read_text().splitlines()
    names = [row.file.name for row in pool["A11"]]
    own = [line for line in lines[1:] if any(line.endswith(name) for name in names)]
    for factor in ("1000", "9.81"):
        (folder := tmp_path / f"times {factor}").mkdir()
        paths = [scaled(row, folder, float(factor)) for row in pool["A11"]]
        (folder / TABLE).write_text("\n".join([lines[0], *own]).replace("data/", "") + "\n")
        code, out, err = call("import", campaign.directory, folder / TABLE, "--json")
        assert code == 3
        assert json.loads(out)["question"]["about"] == "chain"
        assert f"{factor} times too large: units or sensitivity" in err
        assert f"planner undo {campaign.directory}" in err
        assert f"planner confirm {campaign.directory} A11" in err
        held = Campaign(campaign.directory)
        assert len(held.state.held["A11"].hits) == len(paths)
        if factor == "1000":
            held.undo()
    held.confirm("A11")
    assert [m.pose for m in held.state.used] == ["A11"]
    # Of a chain that the engineer called right the same is not asked again; another one is.
    rows, band_hz = pool["A57"], held.cell.config.modes.band_hz
    for factor, doubted in (("9.81", ""), ("1", "accelerations are 9.81 times too small")):
        (folder := tmp_path / f"then times {factor}").mkdir()
        sources = tuple(Source(scaled(r, folder, float(factor)), r.file.name, r.hit) for r in rows)
        claim = Claim(held.model, held.state, "A57", rows[0].joints_deg)
        asked = question_about(claim, measure(sources, band_hz))
        assert (asked is not None and asked.about == "chain") == bool(doubted)
        assert doubted in (asked.text if asked else "")


def test_a_window_that_nobody_stated_is_asked_about(tmp_path):
    campaign, pool = shipped_campaign(tmp_path), shipped_pool()
    rows, band_hz = pool["A11"], campaign.cell.config.modes.band_hz

    def faded(hit: Hit, rate_1_s: float) -> Hit:
        t = (np.arange(len(hit.force_n)) - hit.pulse.peak) / hit.sampling_rate_hz
        by = np.exp(-rate_1_s * np.maximum(t, 0.0))
        return replace(hit, force_n=hit.force_n * by, acceleration_m_s2=hit.acceleration_m_s2 * by)

    for rate_1_s, stated_1_s, asks in ((0.0, 0.0, False), (2.0, 0.0, True), (2.0, 2.0, False)):
        read = (Source(row.file, row.file.name, row.hit).read()[0] for row in rows)
        hits = tuple(faded(hit, rate_1_s) for own in read for hit in own)
        cell = campaign.cell
        modes = msgspec.structs.replace(cell.config.modes, window_rate_1_s=stated_1_s)
        cell = replace(cell, config=msgspec.structs.replace(cell.config, modes=modes))
        claim = Claim(replace(campaign.model, cell=cell), campaign.state, "A11", rows[0].joints_deg)
        asked = question_about(claim, MeasuredPose((), band_hz, "h1", stated_1_s, given=hits))
        assert (asked is not None and "[modes] window_rate_1_s" in asked.text) == asks
        if asked is not None:
            assert float(asked.text.split("fades by ")[1].split()[0]) == pytest.approx(
                2.0, rel=0.03
            )
            assert asked.about == "chain"


def test_a_readback_far_from_its_setpoint_is_asked_about_at_the_first_pose(tmp_path):
    campaign, pool = shipped_campaign(tmp_path), shipped_pool()
    rows, band_hz = pool["A11"], campaign.cell.config.modes.band_hz
    stated = np.array(rows[0].joints_deg)
    measured = measure(tuple(Source(r.file, r.file.name, r.hit) for r in rows), band_hz)
    for off_deg, asks in ((3.0, False), (60.0, True)):
        setpoint = tuple(stated + off_deg * (np.arange(len(stated)) == 4))
        proposal = SimpleNamespace(pose="A11", joints_deg=setpoint)
        state = cast("CampaignState", SimpleNamespace(measurements={}, proposals={"A11": proposal}))
        asked = question_about(Claim(campaign.model, state, "A11", rows[0].joints_deg), measured)
        assert (asked is not None and "60.00° from its setpoint" in asked.text) == asks
        assert asked is None or asked.about == "readback"
