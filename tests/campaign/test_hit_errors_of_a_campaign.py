"""How each hit of a campaign missed: told against what another engine drew, and taken out."""

import numpy as np
import pytest

from planner.campaign.build import build
from planner.campaign.campaign import Campaign
from planner.campaign.hit_errors import HitErrorEstimate, systematic_errors
from planner.dataset.store import Store
from planner.replay import replay
from planner.report.imports import ImportedPoses
from planner.truth.handling import LABORATORY
from tests.support.missed_hits import MissedCell, missed_cell

NORMAL95 = 1.959964


def imported(cell: MissedCell, folder):
    campaign = Campaign.new(folder, cell.robot_toml, cell.campaign_toml)
    campaign = Campaign(folder, Store(None))
    return campaign, campaign.import_paths((cell.recordings,))


def told_of(cell: MissedCell, model):
    """Told, sds and truth (n, 4) of all hits of a campaign."""
    parts = [cell.misses(pose.pose, pose.hits) for pose in model.hit_errors]
    return tuple(np.concatenate(part) for part in zip(*parts, strict=True))


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    folder = tmp_path_factory.mktemp("missed")
    made = missed_cell(folder, "irb6640", poses=3, repeats=2, seed=31)
    return made, *imported(made, folder / "campaign")


def test_every_accepted_hit_is_told(cell):
    made, campaign, reports = cell
    answer = ImportedPoses.of(reports).to_json()
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
    raw = build(campaign.cell, campaign.state, campaign.frf_of)
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
    for again, first in zip(steps[-1].model.hit_errors, campaign.model.hit_errors, strict=True):
        for a, b in zip(again.hits, first.hits, strict=True):
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


CELLS = (("kr10", 1, 51), ("irb6640", 1, 52), ("kr210", 3, 53))


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_216_hits_of_three_robots(tmp_path, capsys):
    """Correlation of at least 0.9, coverage of 90 to 98 %, residues at least twice as good."""
    every, errors = [], []
    lines = ["robot, tilt: corr, cover, offset: corr, cover, residues: raw, corrected, exact hits"]
    for robot, per_joint, seed in CELLS:
        made = missed_cell(tmp_path / robot, robot, per_joint, seed=seed)
        campaign, _ = imported(made, tmp_path / robot / "campaign")
        raw = build(campaign.cell, campaign.state, campaign.frf_of)
        folder = tmp_path / f"{robot}_exact"
        exact = missed_cell(folder, robot, per_joint, seed=seed, handling=LABORATORY)
        calm, _ = imported(exact, folder / "campaign")
        every.append(told_of(made, campaign.model))
        three = (made, raw), (made, campaign.model), (exact, calm.model)
        errors.append([one.residue_errors(model) for one, model in three])
        lines.append(row(robot, every[-1], errors[-1]))
    whole = tuple(np.concatenate(part) for part in zip(*every, strict=True))
    pooled = [np.concatenate(kind) for kind in zip(*errors, strict=True)]
    lines.append(row("all", whole, pooled))
    with capsys.disabled():
        print("\n" + "\n".join(lines))
    assert len(whole[0]) >= 200
    for part in (slice(0, 2), slice(2, 4)):
        correlation, covered = agreement(*(one[:, part] for one in whole))
        assert correlation >= 0.9
        assert 0.90 <= covered <= 0.98
    assert rms(pooled[1]) <= 0.5 * rms(pooled[0])


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def agreement(told: np.ndarray, sd: np.ndarray, true: np.ndarray) -> tuple[float, float]:
    correlation = np.corrcoef(told.ravel(), true.ravel())[0, 1]
    return float(correlation), float(np.mean(np.abs(told - true) < NORMAL95 * sd))


def row(name: str, parts: tuple, errors: list) -> str:
    tilt = agreement(*(one[:, :2] for one in parts))
    offset = agreement(*(one[:, 2:] for one in parts))
    numbers = [f"{v:.3f}" for v in (*tilt, *offset)] + [f"{100 * rms(e):.2f} %" for e in errors]
    return ", ".join([name, *numbers])
