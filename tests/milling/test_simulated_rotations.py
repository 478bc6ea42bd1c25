"""Motions of a robot's tcp completed by its simulation: a tool put on is a payload carried."""

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from planner.campaign.cut_source import tip_of
from planner.dynamics.simulation import Elasticity, Simulation
from planner.errors import InputError
from planner.milling.beam import Segment, ToolMaterial
from planner.milling.coupling import couple
from planner.milling.cutter_frf import CutterFrf
from planner.milling.tip_files import completed
from planner.milling.tool import Tool
from planner.robot.config import Payload
from planner.robot.robot import Robot
from tests.support.direct_solution import direct_accelerance

ROBOT = Path(__file__).parents[2] / "campaigns" / "kr240_plane" / "robot" / "robot.toml"
FREQUENCY = np.arange(4.0, 60.0, 0.5)
Q = np.deg2rad([14.0, -95.0, 100.0, 10.0, -40.0, 20.0])
ROD = Segment(0.25, 0.06, 0.06, ToolMaterial(2e16, 7850.0, 0.3))  # as good as rigid
TOOL = Tool("a rod", (0.0, 0.0, 1.0), (ROD,))


@pytest.fixture(scope="module")
def simulation():
    return Simulation(Robot.load(ROBOT))


def carrying(simulation):
    """The same robot with the rod as a payload of its tcp."""
    length, radius = ROD.length, ROD.diameter / 2
    m = ROD.material.density_kg_m3 * np.pi * radius**2 * length
    across, along = m * (3 * radius**2 + length**2) / 12, m * radius**2 / 2
    body = Payload("tcp", m, (0.0, 0.0, length / 2), (across, 0.0, 0.0, across, 0.0, along))
    config = simulation.robot.config
    config = msgspec.structs.replace(config, payload=(*config.payload, body))
    return Simulation(replace(simulation.robot, config=config))


def rods_tip(simulation):
    """Receptances (3, 3, F) where the rod's tip would be, of a robot whose tcp stays its own."""
    m = simulation.elastic.matrices(Q)
    lever = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 0]]) * ROD.length  # θ × (0, 0, L)
    moved = m.hit[0] + lever @ m.hit_turn[0]
    matrices = m.mass[0], simulation.damping, simulation.stiffness + m.geometric[0]
    return direct_accelerance(*matrices, moved, moved, FREQUENCY) / (2j * np.pi * FREQUENCY) ** 2


def motion(simulation, noise=0.01):
    h = simulation.accelerance(Q[None], FREQUENCY)[0] / (2j * np.pi * FREQUENCY) ** 2
    return CutterFrf("P1", FREQUENCY, h, noise * np.abs(h), joints_rad=Q)


def test_a_rigid_tool_is_a_payload(simulation):
    """The sensor is 0.13 m beside the tcp: that is bridged too."""
    truth = rods_tip(carrying(simulation))
    found = couple(completed(motion(simulation), simulation, Q), TOOL).receptance[:3, :3]
    assert np.abs(found - truth).max() < 1e-5 * np.abs(truth).max()
    changed = np.linalg.norm(motion(simulation).receptance - truth)
    assert changed > 0.3 * np.linalg.norm(truth)


def test_a_simulation_that_is_off_matters_less_than_by_itself(simulation):
    e = simulation.elasticity
    truth, worse, covered = rods_tip(carrying(simulation)), [], []
    for seed in range(3):
        factor = np.exp(0.1 * np.random.default_rng(seed).standard_normal(len(e.stiffness)))
        other = Elasticity(e.stiffness * factor, e.damping, e.loss_factor)
        found = couple(completed(motion(simulation), simulation.changed(other), Q), TOOL)
        alone = rods_tip(carrying(simulation).changed(other))
        off = np.abs(found.receptance[:3, :3] - truth)
        worse.append(np.linalg.norm(off) / np.linalg.norm(alone - truth))
        covered.append(np.mean(off < 2 * found.sd[:3, :3]))
    assert np.median(worse) < 0.5
    assert np.mean(covered) > 0.85


def test_an_npz_of_predict_needs_its_joint_angles(simulation, tmp_path):
    one = motion(simulation)
    s2 = (2j * np.pi * FREQUENCY) ** 2
    stored = {
        "frequency_hz": FREQUENCY, "frf_mean": (one.receptance * s2)[None],
        "frf_sd": (one.sd * np.abs(s2))[None], "pose": np.array(["P1"]),
    }  # fmt: skip
    np.savez(tmp_path / "alone.npz", **stored)
    np.savez(tmp_path / "with.npz", **stored, joints_deg=np.rad2deg(Q)[None])
    with pytest.raises(InputError, match="joint angles"):
        tip_of(tmp_path / "alone.npz", None, None, ROBOT, 0.0)
    tip, pose = tip_of(tmp_path / "with.npz", None, "P1", ROBOT, 0.0)
    assert pose == "P1"
    assert tip.receptance[:, :3, :3].shape == (len(FREQUENCY), 3, 3)
    with pytest.raises(InputError, match="has no pose P9"):
        tip_of(tmp_path / "with.npz", None, "P9", ROBOT, 0.0)
    np.savez(tmp_path / "beside.npz", **stored, sensor_at_tcp=False)
    with pytest.raises(InputError, match="sensor beside the tip"):
        tip_of(tmp_path / "beside.npz", None, "P1", ROBOT, 0.0)
