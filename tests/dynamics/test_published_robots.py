"""The papers' robots: figures as printed, and the published frequencies of Busch et al. 2020."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.campaign.config import load_campaign_config
from planner.demo import shipped
from planner.dynamics.simulation import Simulation
from planner.frf.metrics import agreement, complex_frac
from planner.proof.load import load_truth
from planner.robot.robot import Robot
from planner.robot.workspace import Workspace

ROBOTS = [
    ("kr240_busch2020", "robot"), ("kr240_busch2020", "robot_b"), ("kr240_busch2022", "robot"),
    ("kr10_birk2025", "robot_12p"), ("kr10_birk2025", "robot_24p"),
]  # fmt: skip
# Busch et al. 2020, appendix, about x, y, z (N·m/rad).
STIFFNESS = np.array([
    (16028000, 16028000, 5823000), (9566000, 4255000, 11361000), (3766000, 2717000, 13247000),
    (3246000, 3246000, 1056000), (2528000, 2528000, 1203000), (2191000, 2191000, 454000),
])  # fmt: skip
# Birk et al. 2025: k_rot (N·m/°) and d_rot (N·m·s/°), then k_trans and d_trans.
TABLE_6 = [(1962.5, 0.55), (765.2, 0.553), (789.5, 0.523), (577.3, 0.059), (232.0, 0.012),
           (268.4, 0.258)]  # fmt: skip
TABLE_7 = [
    (881.7, 0.316, 5500.9, 0.204), (1503.8, 0.457, 22403.9, 0.029), (896.7, 0.468, 10884.6, 0.235),
    (600.8, 0.045, 10358.5, 0.118), (208.8, 0.01, 6176.4, 0.154), (409.6, 0.233, 5528.6, 0.178),
]  # fmt: skip
# Simulated by Busch et al. 2020, joint 3 at 70° and 120°, in Hz.
PUBLISHED = np.array([[7.0, 28.0], [11.0, 20.0]])
OTHER_JOINTS_DEG = (-75.0, 0.0, 45.0, 90.0)  # joints 2, 4, 5, 6: see NOTES.md


def load(folder: str, name: str) -> Robot:
    return Robot.load(shipped(folder) / "robot" / f"{name}.toml")


@pytest.mark.parametrize(("folder", "name"), ROBOTS)
def test_every_robot_can_be_simulated_all_over_its_campaign(folder, name):
    robot = load(folder, name)
    table = load_campaign_config(shipped(folder) / "campaign.toml")
    poses = Workspace.from_table(table.workspace, robot).candidates(robot, 16, 0).q
    assert len(poses) == 16  # reachable, and touching nothing
    modes = Simulation(robot).modes(poses, 3)
    assert np.all((modes.frequency_hz > 5) & (modes.frequency_hz < 100))
    assert np.all((modes.damping_ratio > 0.001) & (modes.damping_ratio < 0.2))


@pytest.mark.parametrize(("folder", "name"), ROBOTS)
def test_another_engine_reads_the_same_robot(folder, name):
    robot = load(folder, name)
    truth = load_truth(robot.path)
    low, high = np.deg2rad(
        load_campaign_config(shipped("kr10_birk2025") / "campaign.toml").workspace.joints_deg
    ).T
    poses = np.random.default_rng(0).uniform(low, high, (3, 6))
    lines = np.linspace(*robot.config.band_hz, 300)
    ours = Simulation(robot).accelerance(poses, lines)
    theirs = np.array([truth.accelerance(q, lines) for q in poses])
    assert complex_frac(theirs, ours).min() > 1 - 1e-9
    assert agreement(theirs, ours).frobenius.min() > 1 - 1e-6


@pytest.mark.parametrize(("folder", "name"), [*ROBOTS[:3], ("kr240_plane", "robot")])
def test_kr240_has_the_stiffnesses_as_printed(folder, name):
    """Reading B exchanges y and z at joints 2 and 3. Damping is β = 9.5e-4 s, not the misprint."""
    expected = STIFFNESS.copy()
    if name == "robot_b":
        expected[1:3] = expected[1:3][:, [0, 2, 1]]
    blocks = load(folder, name).config.compliance
    assert [b.stiffness for b in blocks] == expected.ravel().tolist()
    assert [b.joint for b in blocks] == [f"joint_{j}" for j in range(1, 7) for _ in range(3)]
    assert [b.axis for b in blocks] == [(1, 0, 0), (0, 1, 0), (0, 0, 1)] * 6
    for block in blocks:
        assert block.damping == pytest.approx(9.5e-4 * block.stiffness, rel=1e-4)


@pytest.mark.parametrize("name", ["robot_12p", "robot_24p"])
def test_kr10_has_the_tables_per_radian(name):
    robot = load("kr10_birk2025", name)
    for j, (joint, axis) in enumerate(zip(robot.joint_names, robot.joint_axes, strict=True)):
        for block in (b for b in robot.config.compliance if b.joint == joint):
            own = abs(np.dot(axis, block.axis)) == 1
            row = TABLE_6[j] if name == "robot_12p" else TABLE_7[j][:2] if own else TABLE_7[j][2:]
            assert own or name == "robot_24p"
            assert block.stiffness == pytest.approx(row[0] * 180 / np.pi, rel=1e-5)
            assert block.damping == pytest.approx(row[1] * 180 / np.pi, rel=1e-4)
    axes = {(b.joint, b.axis) for b in robot.config.compliance}
    assert len(axes) == len(robot.config.compliance) == (6 if name == "robot_12p" else 18)


def test_kr10_bodies_stand_in_the_world_where_those_of_the_r1100_2_do(shared_data):
    """But for the sixx's forearm, 10 mm higher, and its flange, 10 mm nearer."""
    table = json.loads((shared_data / "robots" / "robots.json").read_text())["kuka_kr10_r1100_2"]
    place = {"base_link": (Rotation.identity(), np.zeros(3))}
    for joint in table["joints"]:
        turn, at = place[joint["parent"]]
        own = turn * Rotation.from_euler("xyz", joint["rpy_rad"])
        place[joint["child"]] = own, at + turn.apply(joint["xyz_m"])
    model = load("kr10_birk2025", "robot_24p").model
    origin = np.zeros(3)
    for j, link in enumerate(table["links"][1:], 1):
        turn, at = place[link["name"]]
        com = at + turn.apply(link["com_xyz_m"])
        com = com + np.array([-0.010 if j == 6 else 0, 0, 0.010 if j >= 4 else 0])
        frame = (turn * Rotation.from_euler("xyz", link["com_rpy_rad"])).as_matrix()
        moments = np.diag([link["inertia_kgm2"][f"i{k}{k}"] for k in "xyz"])
        origin = origin + model.jointPlacements[j].translation  # frames are the world's at q = 0
        body = model.inertias[j]
        assert body.mass == pytest.approx(link["mass_kg"], rel=1e-6)
        assert origin + body.lever == pytest.approx(com, abs=1e-6)
        np.testing.assert_allclose(body.inertia, frame @ moments @ frame.T, atol=1e-6)


def test_only_24_parameters_give_the_kr10_a_resonance_between_50_and_80_hz():
    """Birk et al. 2025, section 3.2: from about 30 to 80 Hz along a path; 12P lacks it."""
    share = np.linspace(0, 1, 11)[:, None]
    first, last = np.deg2rad([(0, -90, 90, 0, 45, 0), (0, -45, 60, 0, 0, 0)])
    path = first + share * (last - first)
    f12 = Simulation(load("kr10_birk2025", "robot_12p")).modes(path, 6).frequency_hz
    f24 = Simulation(load("kr10_birk2025", "robot_24p")).modes(path, 6).frequency_hz
    assert not np.any((f12 > 51) & (f12 < 200))
    assert np.all(np.diff(f24[:, 3]) > 0)
    assert f24[[0, -1], 3] == pytest.approx([49, 81], abs=1)
    assert np.isnan(f12[:, 5]).all()  # the wrist's roll is overdamped


def test_first_frequency_falls_away_from_the_base_and_2022_is_nearly_2020():
    """Busch et al. 2022, section 2.1 and 2.3.1 ("equivalent to the model published in [16]")."""
    robot, older = load("kr240_busch2022", "robot"), load("kr240_busch2020", "robot")
    table = load_campaign_config(shipped("kr240_busch2022") / "campaign.toml")
    found = Workspace.from_table(table.workspace, robot).candidates(robot, 64, 0)
    frequency = Simulation(robot).modes(found.q, 4).frequency_hz
    distance = np.hypot(*found.position_m[:, :2].T)
    assert np.corrcoef(distance, frequency[:, 0])[0, 1] < -0.95
    np.testing.assert_allclose(
        frequency, Simulation(older).modes(found.q, 4).frequency_hz, rtol=0.01
    )


def driving_point(joint_3_deg: np.ndarray, lines_hz: np.ndarray) -> np.ndarray:
    """Horizontal driving-point accelerance (n, F), across the arm's plane, in m/s²/N."""
    robot = load("kr240_busch2020", "robot")
    q2, *rest = OTHER_JOINTS_DEG
    q = np.deg2rad([(0.0, q2, q3, *rest) for q3 in joint_3_deg])
    across = robot.forward_batch(q)[0][:, 1]  # the world's y axis in the tcp frame
    frf = Simulation(robot).accelerance(q, lines_hz)
    return np.einsum("ni,nijf,nj->nf", across, frf, across)


def resonances(frf: np.ndarray, lines_hz: np.ndarray) -> np.ndarray:
    """Frequencies (n, 2) of the peaks of FRFs (n, F), each of which must have two."""
    size = np.abs(frf)
    peak = (size[:, 1:-1] > size[:, :-2]) & (size[:, 1:-1] > size[:, 2:])
    assert np.all(peak.sum(axis=1) == 2)
    return lines_hz[1:-1][np.nonzero(peak)[1]].reshape(-1, 2)


def test_the_horizontal_frf_has_the_published_resonances():
    lines = np.arange(5.0, 35.0, 0.01)
    found = resonances(driving_point(np.arange(70, 121, 2.0), lines), lines)
    assert np.all(np.diff(found[:, 0]) > 0)
    assert np.all(np.diff(found[:, 1]) < 0)
    assert np.all(np.abs(found[[0, -1]] / PUBLISHED - 1) < 0.15)
