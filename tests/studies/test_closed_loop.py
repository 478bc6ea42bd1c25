"""Live campaigns on robots whose simulation has torsion springs only: the loop closed.

The truth (MuJoCo) also tilts in every joint and stands on a soft floor. Each campaign proposes its
own poses; every one is hit, turned into FRFs and modes, and taught to the model.
`SEEDS=10 pytest -m slow tests/studies/test_closed_loop.py -s` prints all curves.
"""

import os

import numpy as np
import pytest

from planner.campaign.build import build
from planner.campaign.events import Proposal
from planner.campaign.proposals import propose
from planner.campaign.state import CampaignState
from tests.support.fidelity_cells import MODES, UNUSED, band_of, cell_of, hit, soft, truth_of
from tests.support.known_robots import IRB6640, KR10, KR210

pytestmark = [pytest.mark.slow, pytest.mark.timeout(6000)]
SEEDS = int(os.environ.get("SEEDS", "3"))
MOST = int(os.environ.get("MOST", "8"))
FIRST_SEED = 301
ROBOTS = {"KR10": KR10, "KR210": KR210, "IRB 6640": IRB6640}


def live(robot, directory, seed: int, simulation: str) -> tuple[list[float], str]:
    """RMSE of four frequencies in % after 1, 2, ... measurements, and what was said last."""
    toml, truth = truth_of(robot, directory, soft(robot, seed), 1)
    cell, band = cell_of(robot, toml, simulation), band_of(robot)
    low, high = np.deg2rad(np.transpose(robot.joints_deg))
    unused = np.random.default_rng(seed).uniform(low, high, (UNUSED, 6))
    true_hz = np.array([truth.modes(q, MODES)[0] for q in unused])
    measurements, frfs, errors = {}, {}, []
    model = build(cell, CampaignState(), lambda m, _: frfs[m.pose])
    for n in range(MOST):
        state = CampaignState(measurements=dict(measurements), events=n)
        proposal: Proposal = propose(model, state, 1, cell.config.acquisition.name)[0]
        name, q = f"P{n}", np.deg2rad(proposal.joints_deg)
        measurements[name], frfs[name] = hit(truth, q, name, band, seed)
        state = CampaignState(measurements=dict(measurements))
        model = build(cell, state, lambda m, _: frfs[m.pose])
        rising = np.sort(model.predict(unused).frequency_hz, axis=1)
        errors.append(100 * float(np.sqrt(np.mean(np.log(rising / true_hz) ** 2))))
    return errors, " ".join(model.remarks)


def test_a_campaign_repairs_its_simulation(tmp_path):
    kinds = ("updated", "frozen", "none")
    errors = {kind: [] for kind in kinds}
    for name, robot in ROBOTS.items():
        for seed in range(FIRST_SEED, FIRST_SEED + SEEDS):
            for kind in kinds:
                folder = tmp_path / f"{name}{seed}{kind}"
                found, said = live(robot, folder, seed, kind)
                errors[kind].append(found)
                print(f"{name} {seed} {kind:8}" + "".join(f"{e:8.2f}" for e in found), flush=True)
                assert kind != "updated" or "lacks" in said
    for kind in kinds:
        middle = np.median(errors[kind], axis=0)
        print(f"median, {kind:8}  " + "".join(f"{e:8.2f}" for e in middle))
    assert np.median(errors["updated"], axis=0)[-1] <= 1.0
    assert np.max(np.array(errors["updated"])[:, -1]) <= 2.0
