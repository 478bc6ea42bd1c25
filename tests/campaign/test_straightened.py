"""A campaign at several force levels on a robot whose robot.toml states a joint's law."""

import numpy as np
import pytest

from planner.campaign.campaign import Campaign
from planner.dataset.store import Store
from planner.dynamics.at_force import change_at_force
from planner.proof.deviation import Deviation
from planner.proof.fault_injection import HitVisit, InjectedFaults, frfs, hit_poses, once
from planner.proof.hits import Hammer
from planner.proof.laws import Hardening
from planner.proof.load import load_truth
from planner.proof.nonlinear import Port
from planner.proof.recordings import stated, write_recordings
from tests.support.plain_arm import make_plain_arm, plain_campaign

BAND_HZ = (3.0, 60.0)
LAW = Hardening(4.0e4, 4e-4)
TABLE = """
[[law]]
joint = "joint_2"
kind = "hardening"
stiffness_n_m_rad = 4.0e4
angle_rad = 4e-4
[hammer]
pulse_ms = 5.1
"""
LEVELS = (10.0, 90.0)  # N
MEASURED, UNSEEN = np.deg2rad([[10.0, -40.0, 60.0, 20.0], [-15.0, -55.0, 45.0, 40.0]])
HAMMER = Hammer(peak_n=30.0, duration_s=0.008, record_s=2.56, sampling_rate_hz=400.0)


@pytest.fixture(scope="module")
def struck(tmp_path_factory):
    """Truth, what it conceals, and a campaign of one pose, hit at two levels along each axis."""
    root = tmp_path_factory.mktemp("straightened")
    robot, rng = make_plain_arm(root / "robot", damping_s=2e-3), np.random.default_rng(1)
    deviation = Deviation(3, stiffness=0.08, damping=0.08, inertia=0.02, com_m=0.002)
    truth = load_truth(robot, deviation)
    injected = InjectedFaults(deviation, (Port(LAW, joint="joint_2"),))
    shots = [(f"+{axis}", level) for axis in "xyz" for level in LEVELS]
    (hits,) = hit_poses(truth, injected, [HitVisit(MEASURED, shots)], HAMMER, rng)
    rows = [("P0", stated(MEASURED, ()), hits)]
    write_recordings(root / "hits", truth.joint_names, rows, HAMMER, "SIMULATED")
    robot.write_text(robot.read_text() + TABLE)
    Campaign.new(root / "cell", robot, plain_campaign(root / "plan" / "campaign.toml"))
    campaign = Campaign(root / "cell", Store(None))
    campaign.import_paths((root / "hits",))
    return truth, injected, campaign


def test_each_level_is_predicted_and_nothing_swings_instead(struck):
    """FRFs averaged over levels as a linear robot's were 9 to 13 % off, and a mass swung."""
    truth, injected, campaign = struck
    for q in (MEASURED, UNSEEN):
        for force_n in (5.0, 50.0, 200.0):
            lines, true = frfs(truth, injected, [once(q, force_n)], HAMMER, BAND_HZ)
            change = change_at_force(campaign.model.struck, q[None], np.array([force_n]), lines)
            off = campaign.frf_at(q, lines)[0] + change - true
            assert np.linalg.norm(off) < 0.075 * np.linalg.norm(true)
    assert campaign.model.remarks == ()
