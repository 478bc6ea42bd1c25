"""What only the simulation tells of sensors and hits: whether they were there, what they weigh."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.measurement.point_places import misplaced
from planner.measurement.sensor_loading import unloaded
from planner.modal.modes import Mode
from planner.proof.deviation import Deviation
from planner.proof.fault_injection import InjectedFaults
from planner.proof.load import load_truth
from planner.recording.points import Layout
from planner.robot.robot import Robot
from tests.support.arm_with_points import poses, record, write_arm
from tests.support.outside import told

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


# Two heavy clusters of sensors; the tool's own weighs nothing.
KG = {"shoulder": 3.0, "elbow": 1.5}
BOTH = ("sensor", "shoulder", "elbow")
HEARD = ("sensor", "elbow")


def heavy_arm(folder: Path) -> Path:
    """robot.toml of the arm whose points carry masses."""
    toml = write_arm(folder)
    text = toml.read_text()
    for name, kg in KG.items():
        text = text.replace(f'name = "{name}"\n', f'name = "{name}"\nmass_kg = {kg}\n')
    toml.write_text(text)
    return toml


@pytest.fixture(scope="module")
def surveyed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, np.ndarray]:
    """Folder, robot.toml and joint angles; at P002 the clusters roved."""
    folder = tmp_path_factory.mktemp("loaded")
    toml, q = heavy_arm(folder / "robot"), poses(2)
    stays = [
        ("P001", q[0], "tcp", HEARD),
        ("P002", q[1], "tcp", HEARD),
        ("P002", q[1], "tcp", BOTH[:2]),
    ]
    record(folder / "recordings", toml, stays, InjectedFaults(Deviation()))
    return folder / "recordings", toml, q


def bare(toml: Path, q: np.ndarray, sensors: tuple[str, ...] = ("sensor",)) -> np.ndarray:
    """True frequencies in Hz with the masses of some sensors."""
    return replace(load_truth(toml), sensors=sensors).modes(q, 4)[0]


@pytest.mark.slow
def test_frequencies_are_given_without_the_sensors(surveyed: tuple[Path, Path, np.ndarray]) -> None:
    folder, toml, q = surveyed
    found = told("modes", folder, "--robot", toml)
    for pose, row in zip(found["poses"], q, strict=True):
        true = bare(toml, row)
        for mode in (*pose["modes"], *pose["unlabelled"]):
            nearest = true[np.argmin(np.abs(np.log(true / mode["frequency_hz"])))]
            off = abs(mode["frequency_hz"] - nearest)
            assert off < 3 * mode["frequency_sd_hz"]
            assert off < 0.003 * nearest
    lowered = [m["sensors_lowered_percent"] for m in found["poses"][0]["modes"]]
    loaded = bare(toml, q[0], HEARD)
    expected = 100 * (1 - loaded / bare(toml, q[0]))
    assert max(lowered) == pytest.approx(np.max(expected[: len(lowered)]), rel=0.1)
    assert max(lowered) > 1.0
    assert "elbow (1.5 kg)" in found["remarks"][0]
    assert any(text.startswith("P002: sensors were moved") for text in found["remarks"])
    assert not any(text.startswith("P001: sensors were moved") for text in found["remarks"])


def test_without_masses_nothing_is_corrected(tmp_path: Path) -> None:
    nothing = np.full((3, 3), np.nan)
    modes = [Mode(24.0, 0.1, 0.02, 0.001, nothing, nothing, np.array([1.0, 0.0, 0.0]))]
    light = Simulation(Robot.load(write_arm(tmp_path / "light")))
    assert unloaded(modes, light, poses(1)[0], BOTH).modes == tuple(modes)
    heavy = Simulation(Robot.load(heavy_arm(tmp_path / "heavy")))
    assert unloaded(modes, heavy, poses(1)[0], ("sensor",)).modes == tuple(modes)
    far = [replace(modes[0], frequency_hz=5.0)]
    found = unloaded(far, heavy, poses(1)[0], BOTH)
    assert np.isnan(found.lowered).all()
    assert found.modes == tuple(far)
