"""How each hit of a campaign missed: told against what another engine drew, and taken out."""

from dataclasses import dataclass
from dataclasses import replace as changed
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from msgspec.structs import replace

from planner.campaign.build import build
from planner.campaign.campaign import Campaign
from planner.campaign.config import FidelityTable
from planner.campaign.hit_errors import CampaignHitErrors, HitErrorEstimate, systematic_errors
from planner.campaign.model import Model
from planner.dataset.store import Store
from planner.fit.hit_error_fit import VisitHitErrors
from planner.measurement.nuisances import Tolerances
from planner.proof.arms import ARMS
from planner.proof.deviation import Deviation
from planner.proof.fault_injection import HitVisit, InjectedFaults
from planner.proof.hits import AXES, Hammer
from planner.proof.load import load_truth
from planner.proof.measurement_errors import EVERYDAY, MeasuringChain
from planner.proof.model import Truth
from planner.proof.scene import PULSE_S
from planner.replay import replay
from planner.report import imports
from tests.support.struck_poses import record_by_hand

NORMAL95, SEED = 1.959964, 31
OFF = Deviation(SEED, stiffness=0.15, damping=0.15, inertia=0.04, com_m=0.005)
HAND = changed(EVERYDAY, angle_deg=2.0, offset_m=0.005)  # beside the chain and aims of a real cell
SAME = 0.01  # relative difference of frequencies below which two modes are the same


@dataclass(frozen=True, eq=False)
class Missed:
    """Recordings and the truth: of each pose, where it stood and how its hits missed."""

    recordings: Path
    truth: Truth
    chain: MeasuringChain
    visits: dict[str, HitVisit]

    def misses(self, pose: str, hits: tuple[HitErrorEstimate, ...]) -> tuple[np.ndarray, ...]:
        """Told, its sds, and true misses (n, 4) of a pose's hits, in the order of the files."""
        told = np.array([[*hit.tilt_deg, *hit.offset_mm] for hit in hits])
        sd = np.array([[*hit.tilt_sd_deg, *hit.offset_sd_mm] for hit in hits])
        true = []
        for hit, aim in zip(hits, self.visits[pose].aims, strict=True):
            axis, sign = AXES.index(hit.hit[1]), -1.0 if hit.hit[0] == "-" else 1.0
            across = [(axis + 1) % 3, (axis + 2) % 3]
            # The force of a hit along −x is minus (x + aim.direction).
            tilt = sign * np.rad2deg(aim.direction[across])
            true.append([*tilt, *(1e3 * aim.offset_m[across])])
        return told, sd, np.array(true)

    def residue_errors(self, model: Model) -> np.ndarray:
        """(m,): of each labelled mode's residues to those that exact hits would give this chain."""
        out = []
        seen = changed(self.truth, sensor_offset_m=self.chain.offset_m)
        for pose, residues in zip(model.labelled, model.seen_exactly.residue, strict=True):
            frequency, _, residue = seen.modes(self.visits[pose.pose].q, 8)
            residue = self.chain.matrix @ residue / self.chain.force_gain
            for mode, found in zip(pose.modes, residues, strict=True):
                if mode is None:
                    continue
                k = int(np.argmin(np.abs(frequency - mode.frequency_hz)))
                if abs(frequency[k] / mode.frequency_hz - 1) < SAME:
                    off = np.linalg.norm(found - residue[k])
                    out.append(off / np.linalg.norm(residue[k]))
        return np.array(out)


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """Two hits along each axis, in both senses, at two poses: truth, campaign, its reports."""
    folder, arm = tmp_path_factory.mktemp("missed"), ARMS["irb6640"]
    rng, noise = np.random.default_rng([SEED, 24]), np.random.default_rng([SEED, 25])
    toml, plan = arm.write(folder / "robot", 1), folder / "campaign.toml"
    truth, hammer = load_truth(toml, OFF), Hammer(arm.peak_n, PULSE_S, noise=0.01)
    chain, common = HAND.chain(rng), HAND.common(rng)
    hits = [f"{sense}{axis}" for axis in AXES for sense in "+-"]
    poses = [(f"P{i:02d}", row) for i, row in
             enumerate(np.round(np.rad2deg(arm.poses(2, SEED)), 4), 1)]  # fmt: skip
    injected, recordings = InjectedFaults(OFF, chain=chain), folder / "recordings"
    visits = record_by_hand(recordings, truth, injected, HAND, poses, hits, hammer, rng,
                            common=common, noise=noise)  # fmt: skip
    made = Missed(recordings, truth, chain, dict(zip(dict(poses), visits, strict=True)))
    plan.write_text(arm.campaign())
    Campaign.new(folder / "campaign", toml, plan)
    campaign = Campaign(folder / "campaign", Store(None))
    return made, campaign, campaign.import_paths((recordings,))


def test_every_accepted_hit_is_told(cell):
    made, campaign, reports = cell
    answer = imports.imported(reports, campaign.directory, False)[0].to_json()
    rows = (made.recordings / "recordings.csv").read_text().splitlines()[1:]
    files = [str(made.recordings / row.split(",")[-1]) for row in rows]
    assert [hit["file"] for hit in answer["hit_errors"]] == files
    assert answer["hit_errors"][-6:] == answer["poses"][-1]["hit_errors"]
    parts = [made.misses(*own) for own in campaign.model.hit_errors.items()]
    told, sd, true = (np.concatenate(part) for part in zip(*parts, strict=True))
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


def campaign(times: float, discrepancy: float) -> CampaignHitErrors:
    """Nine hits that miss by so many times what hands do."""
    usual = Tolerances()
    sd = np.repeat([usual.angle_rad, usual.offset_m], 2)
    mean = times * sd * np.random.default_rng(2).choice([-1.0, 1.0], (9, 4))
    told = SimpleNamespace(discrepancy=discrepancy, visits=(VisitHitErrors(mean, np.eye(36)),))
    return CampaignHitErrors((), cast(Any, told), usual, (4.0, 60.0))


@pytest.mark.parametrize(
    ("times", "discrepancy", "trusted"),
    [(1.0, 1e-3, True), (2.5, 3e-2, True), (1.0, 0.3, False), (8.0, 1e-3, False)],
)
def test_hits_are_told_by_a_simulation_that_is_right_enough(times, discrepancy, trusted):
    """What one lacks that is too wrong would be called the hand's."""
    found = campaign(times, discrepancy)
    assert found.trusted is trusted
    assert trusted or not found.poses
