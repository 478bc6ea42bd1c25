"""FRFs under another point's name, where only the simulation can tell."""

from dataclasses import replace

import numpy as np
import pytest

from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.measurement.point_places import misplaced
from planner.proof.load import load_truth
from planner.recording.points import Layout
from planner.robot.robot import Robot
from tests.support.arm_with_points import poses, write_arm

HZ, BAND = np.linspace(6.0, 80.0, 150), (6.0, 80.0)
NAMES = "P001", "P002"
TRUE = Layout(("tcp", "elbow"), ("sensor", "shoulder", "elbow"))


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> tuple[Simulation, np.ndarray]:
    """The simulation and FRFs (2, r, c, F) of another engine between the points of TRUE."""
    toml = write_arm(tmp_path_factory.mktemp("arm"))
    truth = replace(load_truth(toml), sensors=TRUE.sensors)
    each = [
        [replace(truth, hit_point=name).accelerance(row, HZ) for name in TRUE.hits]
        for row in poses(2)
    ]
    rng = np.random.default_rng(2)
    h = np.array([np.concatenate(own, axis=1) for own in each])
    # Sensors and hammer err by 5 % as a whole.
    h = h * (1 + 0.05 * rng.normal(size=(1, *h.shape[1:3], 1)))
    return Simulation(Robot.load(toml)), h


def frfs(h: np.ndarray, layout: Layout) -> list[Frf]:
    unknown = np.full(h.shape[1:], np.nan)
    hits = (1,) * h.shape[2]
    return [Frf(HZ, own, unknown, unknown, hits, BAND, layout=layout) for own in h]


def asked(arm: tuple[Simulation, np.ndarray], layout: Layout) -> tuple[str, ...]:
    simulation, h = arm
    return misplaced([simulation], poses(2), frfs(h, layout), BAND, NAMES)


def test_points_that_are_right_are_not_questioned(arm: tuple[Simulation, np.ndarray]) -> None:
    assert asked(arm, TRUE) == ()


def test_exchanged_sensors_are_questioned(arm: tuple[Simulation, np.ndarray]) -> None:
    told = asked(arm, replace(TRUE, sensors=("sensor", "elbow", "shoulder")))
    assert len(told) == 1
    assert told[0].startswith("P001, P002: FRFs of elbow fit shoulder far better")
    assert told[0].endswith("and shoulder's fit elbow: were the two exchanged?")


def test_a_sensor_and_a_hit_at_another_point_are_questioned(
    arm: tuple[Simulation, np.ndarray],
) -> None:
    told = asked(arm, replace(TRUE, sensors=("sensor", "foot", "elbow")))
    assert [text.split(" (")[0] for text in told] == [
        "P001, P002: FRFs of foot fit shoulder far better"
    ]
    told = asked(arm, replace(TRUE, hits=("tcp", "shoulder")))
    assert [text.split(" (")[0] for text in told] == [
        "P001, P002: hits at shoulder fit elbow far better"
    ]


def test_a_simulation_that_describes_nothing_asks_nothing(
    arm: tuple[Simulation, np.ndarray],
) -> None:
    simulation, h = arm
    elasticity = replace(simulation.elasticity, stiffness=0.3 * simulation.elasticity.stiffness)
    wrong = replace(TRUE, sensors=("sensor", "elbow", "shoulder"))
    far = simulation.changed(elasticity)
    assert misplaced([far], poses(2), frfs(h, wrong), BAND, NAMES) == ()
    # Beside one that describes them, it does no harm.
    assert misplaced([far, simulation], poses(2), frfs(h, wrong), BAND, NAMES) != ()
