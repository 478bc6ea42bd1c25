"""How each hit of a campaign missed: told against what another engine drew, and taken out."""

from dataclasses import replace as changed
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from msgspec.structs import replace

from planner.campaign.build import build
from planner.campaign.campaign import Campaign
from planner.campaign.config import FidelityTable
from planner.campaign.hit_errors import CampaignHitErrors, HitErrorEstimate, systematic_errors
from planner.dataset.store import Store
from planner.fit.hit_error_fit import VisitHitErrors
from planner.measurement.nuisances import Tolerances
from planner.replay import replay
from planner.report import imports
from tests.support.hit_error_cases import MissedCell, missed_cell

NORMAL95 = 1.959964


def imported(cell: MissedCell, folder):
    campaign = Campaign.new(folder, cell.robot_toml, cell.campaign_toml)
    campaign = Campaign(folder, Store(None))
    return campaign, campaign.import_paths((cell.recordings,))


def told_of(cell: MissedCell, model):
    """Told, sds and truth (n, 4) of all hits of a campaign."""
    parts = [cell.misses(*own) for own in model.hit_errors.items()]
    return tuple(np.concatenate(part) for part in zip(*parts, strict=True))


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    folder = tmp_path_factory.mktemp("missed")
    made = missed_cell(folder, "irb6640", poses=2, repeats=2, seed=31)
    return made, *imported(made, folder / "campaign")


def test_every_accepted_hit_is_told(cell):
    made, campaign, reports = cell
    answer = imports.imported(reports, campaign.directory, False)[0].to_json()
    rows = (made.recordings / "recordings.csv").read_text().splitlines()[1:]
    files = [str(made.recordings / row.split(",")[-1]) for row in rows]
    assert [hit["file"] for hit in answer["hit_errors"]] == files
    assert answer["hit_errors"][-6:] == answer["poses"][-1]["hit_errors"]
    told, sd, true = told_of(made, campaign.model)
    for part, off in ((slice(0, 2), 0.35), (slice(2, 4), 4.0)):
        assert np.sqrt(np.mean((told - true)[:, part] ** 2)) < off
        assert np.mean(np.abs(told - true)[:, part] < NORMAL95 * sd[:, part]) > 0.8
    assert np.corrcoef(told[:, :2].ravel(), true[:, :2].ravel())[0, 1] > 0.9


def test_residues_are_those_of_hits_without_a_miss(cell):
    made, campaign, _ = cell
    frozen = replace(campaign.cell.config, fidelity=FidelityTable("frozen"))
    raw = build(changed(campaign.cell, config=frozen), campaign.state, campaign.recordings.hits)
    before, after = made.residue_errors(raw), made.residue_errors(campaign.model)
    assert np.sqrt(np.mean(after**2)) < 0.6 * np.sqrt(np.mean(before**2))
    counted = campaign.cell.config.modes.count
    for x, y in zip(raw.labelled, campaign.model.labelled, strict=True):
        both = {m.frequency_hz for m in x.modes if m}, {m.frequency_hz for m in y.modes if m}
        assert len(both[0] & both[1]) >= counted - 1  # poles are those of the modal analysis


def test_it_is_replayed_identically(cell):
    _, campaign, _ = cell
    steps = list(replay(campaign))
    assert {step.check for step in steps} <= {"identical", "kept"}
    again = steps[-1].model.hit_errors
    for pose, first in campaign.model.hit_errors.items():
        for a, b in zip(again[pose], first, strict=True):
            assert a.tilt_deg == pytest.approx(b.tilt_deg, abs=1e-9)
            assert a.offset_mm == pytest.approx(b.offset_mm, abs=1e-9)


def test_what_hits_have_in_common_is_said():
    def hit(name, tilt, offset):
        return HitErrorEstimate("f", name, tilt, (0.2, 0.2), offset, (1.0, 1.0))

    z = [hit("+z", (2.3 + k, 0.1), (4.0 + k, -0.5)) for k in (-0.1, 0.0, 0.1)]
    assert systematic_errors(z) == (
        "Your z hits land 4 ± 1 mm towards +x and tilt by 2.3 ± 0.2° towards +x.",
    )
    assert systematic_errors([hit("-x", (0.1, -2.0), (0.0, 0.0))] * 2) == (
        "Your −x hits tilt by 2.0 ± 0.2° towards −z.",
    )
    assert systematic_errors([hit("+y", (0.3, 0.3), (1.0, 1.0))] * 3) == ()


HAND = Tolerances()


def campaign(times: float, discrepancy: float) -> CampaignHitErrors:
    """Nine hits that miss by so many times what hands do."""
    sd = np.repeat([HAND.angle_rad, HAND.offset_m], 2)
    mean = times * sd * np.random.default_rng(2).choice([-1.0, 1.0], (9, 4))
    told = SimpleNamespace(discrepancy=discrepancy, visits=(VisitHitErrors(mean, np.eye(36)),))
    return CampaignHitErrors((), cast(Any, told), HAND, (4.0, 60.0))


@pytest.mark.parametrize(
    ("times", "discrepancy", "trusted"),
    [(1.0, 1e-3, True), (2.5, 3e-2, True), (1.0, 0.3, False), (8.0, 1e-3, False)],
)
def test_hits_are_told_by_a_simulation_that_is_right_enough(times, discrepancy, trusted):
    """What one lacks that is too wrong would be called the hand's."""
    found = campaign(times, discrepancy)
    assert found.trusted is trusted
    assert trusted or not found.poses
