"""What may be missing where a joint slides: springs along it, and tilts of its carriage."""

import os

import numpy as np
import pytest

from planner.api import diagnose
from planner.campaign.campaign import Campaign
from planner.dataset.dataset import Dataset
from planner.diagnosis.effects.angle_dependent_stiffness import AngleDependentStiffness
from planner.diagnosis.effects.base_compliance import BaseCompliance
from planner.diagnosis.effects.joint_stiffness import JointStiffness
from planner.diagnosis.effects.transverse_compliance import TransverseCompliance
from planner.diagnosis.laws.equivalent_stiffness import own_springs
from planner.diagnosis.laws.torque_laws import LAWS
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Priors, parametrise
from planner.effects.table import Repertoire
from planner.robot.robot import Robot
from planner.truth.deviation import Deviation, ScaledJoint
from planner.truth.hits import Hammer, record_poses
from planner.truth.load import load_truth
from tests.support.rails import GANTRY, GANTRY_BOX, RAIL_ARM, RAIL_BOX, make_sliding
from tests.support.rails import sliding_campaign as campaign_over

SEED = int(os.environ.get("SEED", "61"))
HAMMER = Hammer(80.0, 0.006, 400.0, 2.56, noise=0.01)
ROBOTS = {
    "rail": (RAIL_ARM, RAIL_BOX, "0.4 0.04 0.05"),
    "gantry": (GANTRY, GANTRY_BOX, "0 0.03 -0.25"),
}
SCATTER = {"stiffness": 0.1, "damping": 0.2, "inertia": 0.02, "com_m": 0.003}


@pytest.fixture
def simulation(tmp_path) -> Simulation:
    return Simulation(Robot.load(make_sliding(tmp_path)))


def test_springs_of_slides_have_their_own_units(simulation):
    found = parametrise(simulation, Priors()).parameters
    units = {p.name: p.unit for p in found}
    assert units["stiffness of rail along y"] == "N/m"
    assert units["damping of rail along y"] == "N·s/m"
    assert units["stiffness of turn about z"] == "N·m/rad"
    assert own_springs(simulation)[0] == ("joint_1", "joint_2", "joint_3")
    assert LAWS[1].names_at(True) == (("presliding_stiffness", "N/m"), ("coulomb_force", "N"))


def test_effects_at_a_rail(simulation):
    (stiffness,) = (e for e in JointStiffness.everywhere(simulation) if e.at == "joint_1")
    assert stiffness.springs(simulation) == ("stiffness of rail along y",)
    assert {e.at for e in AngleDependentStiffness.everywhere(simulation)} == {"joint_2", "joint_3"}
    (tilts,) = (e for e in TransverseCompliance.everywhere(simulation) if e.at == "joint_1")
    assert len(tilts.gives) == 3  # the carriage rolls, too
    assert not any(give.slide for give in tilts.gives)


def test_a_base_without_mass_does_not_shift_along_the_rail(simulation):
    whole = BaseCompliance.everywhere(simulation)[-1]
    shifts = [give.axis for give in whole.gives if give.slide]
    assert (0.0, 1.0, 0.0) not in shifts
    assert len(shifts) == 2
    whole.structure(simulation)


def test_an_extended_rail_tilts_about_its_own_axis_too(simulation):
    wide = Repertoire.of(simulation, Priors())
    added = wide.simulation.robot.config.compliance[wide.stated :]
    added = [b for b in added if not b.slide]
    assert {b.axis for b in added if b.joint == "rail"} == {(1, 0, 0), (0, 1, 0), (0, 0, 1)}
    # No stiffer than rotations elsewhere are, whatever the rail's N/m are.
    assert max(b.stiffness for b in added) < 1e2 * max(a.stiffness for a in RAIL_ARM[1:])


def true_poses(truth, box, n, seed):
    rng = np.random.default_rng(seed)
    stated = np.array([[rng.uniform(*ends) for ends in box] for _ in range(n)])
    return np.where(truth.slides, 1e-3 * stated, np.deg2rad(stated))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ROBOTS)
@pytest.mark.parametrize("softer", [1.0, 0.4])
def test_diagnosis_names_a_soft_rail_and_nothing_else(kind, softer, tmp_path):
    """`SEED=… pytest -m slow -s`: a null, and the first joint's drive at 40 %."""
    axes, box, tip = ROBOTS[kind]
    toml = make_sliding(tmp_path / "robot", axes, tip)
    scaled = () if softer == 1 else (ScaledJoint(axes[0].name, softer),)
    truth = load_truth(toml, Deviation(SEED, **SCATTER, scaled=scaled))
    poses = [(f"P{i}", q) for i, q in enumerate(true_poses(truth, box, 6, SEED))]
    folder = record_poses(truth, poses, tmp_path / "hits", repeats=2, hammer=HAMMER, seed=SEED)
    robot = Robot.load(toml)
    found = diagnose(Dataset.read(folder, robot), robot)
    told = [(f.effect, f.at, f.parameters) for f in found.findings]
    print(f"\n{kind}, spring times {softer}: {found.verdict}, {told}, {truth.springs[0].stiffness}")
    assert found.verdict == ("consistent" if softer == 1 else "explained")
    assert [(f.effect, f.at) for f in found.findings] == (
        [] if softer == 1 else [("joint_stiffness", "joint_1")]
    )


@pytest.mark.slow
@pytest.mark.parametrize("kind", ROBOTS)
def test_four_poses_tell_frequencies_at_unseen_ones(kind, tmp_path):
    """`SEED=… pytest -m slow -s`: proposed poses, hit on a true robot; ten others predicted."""
    axes, box, tip = ROBOTS[kind]
    toml, count = make_sliding(tmp_path / "robot", axes, tip), len(axes)
    truth = load_truth(toml, Deviation(SEED, **SCATTER | {"stiffness": 0.15}))
    plan = campaign_over(tmp_path / "campaign.toml", box, count)
    campaign = Campaign.new(tmp_path / "cell", toml, plan)
    joints = campaign.cell.robot.joints
    for number in range(4):
        (proposal,) = campaign.next()
        pose = (proposal.pose, joints.internal(proposal.joints_deg))
        folder = tmp_path / f"hits{number}"
        record_poses(truth, [pose], folder, repeats=3, hammer=HAMMER, seed=10 * SEED + number)
        campaign.import_paths((folder,))
    q = true_poses(truth, box, 10, SEED + 99)
    found = campaign.model.predict(q)
    real = np.array([truth.modes(one, count)[0] for one in q])
    off = np.abs(found.frequency_hz / real - 1)
    inside = np.mean(np.abs(found.frequency_hz - real) < 2 * found.frequency_sd_hz)
    print(f"\n{kind}: worst {100 * off.max():.4f} %, inside 2 sd {100 * inside:.0f} %")
    assert off.max() < 0.01
