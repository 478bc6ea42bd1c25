"""What sensors along the arm tell of 24P on the KR10 that the tool's alone leaves open.

    pytest -m slow -s tests/fit/test_undetermined_by_sensors.py

prints, over the number of poses, how many of the 24 parameters are not told (their sd is more than
half of what it was before) and in how many directions. The truth is the other engine's with all
springs softer than stated, hit once along each axis by hand; all sensors hear the same hits.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.dataset.dataset import Dataset
from planner.demo import shipped
from planner.dynamics.simulation import Simulation
from planner.fit.identify import identify
from planner.fit.result import Identification
from planner.robot.robot import Robot
from planner.truth.arms import KR10
from planner.truth.deviation import Deviation
from planner.truth.fault_injection import HitVisit, InjectedFaults, hit_poses
from planner.truth.hits import write_recordings
from planner.truth.load import load_truth
from planner.truth.measurement_errors import EVERYDAY
from tests.support.studied import part

HAMMER = part("birk2025", "data").HAMMER

ALONG = (
    ("foot", "base_link", (0.15, 0.0, 0.05), 11),
    ("shoulder", "link_1", (0.0, 0.12, -0.1), 12),
    ("elbow", "link_2", (0.45, 0.0, -0.1), 13),
)
SENSORS = ("sensor", *(name for name, *_ in ALONG))
POSES = 1, 3, 6


def robot_with_points(folder: Path) -> Path:
    """The shipped 24P with sensors on base, shoulder and elbow."""
    source = shipped("kr10_birk2025") / "robot"
    text = (source / "robot_24p.toml").read_text()
    for name, link, place, node in ALONG:
        text += f'\n[[point]]\nname = "{name}"\nlink = "{link}"\n'
        text += f"position_m = {list(place)}\nnode = {node}\n"
    (folder / "robot.urdf").write_text((source / "robot.urdf").read_text())
    (folder / "robot.toml").write_text(text)
    return folder / "robot.toml"


def recorded(folder: Path, toml: Path, seed: int) -> Dataset:
    """Hits at the last of POSES, heard by all sensors."""
    rng = np.random.default_rng(seed)
    chains = {name: EVERYDAY.chain(rng) for name in SENSORS}
    truth = load_truth(toml, Deviation(seed, inertia=0.05, com_m=0.005, common=0.7))
    q, shots = KR10.poses(POSES[-1], seed=seed), [(f"+{axis}", 300.0) for axis in "xyz"]
    visits = [
        HitVisit(
            one + np.deg2rad(EVERYDAY.readback_deg) * rng.standard_normal(6),
            shots, 0.0, EVERYDAY.aims([0, 1, 2], rng), sensors=SENSORS,
        )
        for one in q
    ]  # fmt: skip
    injected = InjectedFaults(truth.deviation, chain=chains["sensor"], chains=chains)
    found = hit_poses(truth, injected, visits, replace(HAMMER, noise=0.01), rng)
    rows = [
        (f"P{i}", np.rad2deg(one), 1, hit)
        for i, (one, hits) in enumerate(zip(q, found, strict=True))
        for hit in hits
    ]
    nodes = {"sensor": 10} | {name: node for name, *_, node in ALONG}
    write_recordings(folder, truth.joint_names, rows, HAMMER, truth.description, nodes)
    robot = Robot.load(toml)
    return Dataset.read(folder, robot)


def told(robot: Robot, heard: Dataset, poses: int) -> Identification:
    """By the first poses."""
    frfs, q = heard.one_hit_frfs[:poses], heard.q[:poses]
    return identify(frfs, q, Simulation(robot), extend=False).identified


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_four_sensors_leave_fewer_parameters_open(tmp_path: Path, capsys) -> None:
    toml = robot_with_points(tmp_path)
    robot, all_ = Robot.load(toml), recorded(tmp_path / "hits", toml, 41)
    open_: dict[tuple[int, int], int] = {}
    for poses in POSES:
        for heard in (all_, all_.channels_of("sensor")):
            found = told(robot, heard, poses)
            count = len(heard.sensors)
            open_[count, poses] = sum(not e.identifiable for e in found.estimates)
            with capsys.disabled():
                print(
                    f"{count} sensor(s), {poses} pose(s): {open_[count, poses]} of "
                    f"{len(found.estimates)} parameters and {len(found.undetermined)} directions "
                    f"not determined, misfit {found.misfit:.2f}"
                )
    assert all(open_[4, poses] <= open_[1, poses] for poses in POSES)
    assert any(open_[4, poses] < open_[1, poses] for poses in POSES)
