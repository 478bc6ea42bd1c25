"""FRFs between any points: against another engine, as recorded, identified, in a campaign."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.campaign.campaign import Campaign
from planner.dataset.dataset import Dataset
from planner.dynamics.gradient import laplace, moved, response
from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.fit.identify import identify
from planner.frf.frf import Frf
from planner.measurement.measured_frfs import matrices_at
from planner.measurement.nuisances import Tolerances
from planner.proof.deviation import Deviation, Spring, soft_floor
from planner.proof.fault_injection import InjectedFaults
from planner.proof.load import load_truth
from planner.proof.measurement_errors import EVERYDAY
from planner.proof.model import Truth
from planner.recording.points import Layout
from planner.robot.robot import Robot
from tests.support.arm_with_points import poses, record, write_arm

HZ = np.linspace(6.0, 80.0, 30)
WIDE = Layout(("elbow", "tcp"), ("foot", "sensor", "elbow"))
LIGHT_BASE = '[[compliance]]\njoint = "base"\naxis = [1.0, 0.0, 0.0]\nstiffness = 8e5\n'


@pytest.fixture(scope="module")
def toml(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_arm(tmp_path_factory.mktemp("arm"))


def truth_between(toml: Path, q: np.ndarray, layout: Layout, **changes: object) -> np.ndarray:
    """(r, c, F) of the other engine."""
    truth = replace(load_truth(toml), sensors=layout.sensors, **changes)
    each = [replace(truth, hit_point=name).accelerance(q, HZ) for name in layout.hits]
    return np.concatenate(each, axis=1)


def test_simulation_between_points_is_that_of_another_engine(tmp_path: Path) -> None:
    toml = write_arm(tmp_path, LIGHT_BASE + "damping = 240.0\n")  # so that the foot moves
    simulation, q = Simulation(Robot.load(toml)), poses(1)
    matrices = simulation.elastic.matrices(q, layout=WIDE)
    h = response(matrices, simulation.elasticity, laplace(HZ[None]))[0]
    expected = truth_between(toml, q[0], WIDE)
    assert np.abs(h - expected).max() < 1e-5 * np.abs(expected).max()
    assert np.abs(h[:3]).max() > 0


def test_points_of_a_link_that_bends_lie_on_its_halves(toml: Path, tmp_path: Path) -> None:
    near = '[[point]]\nname = "near"\nlink = "l2"\nposition_m = [0.0, 0.0, 0.1]\n'
    bends = '[[compliance]]\njoint = "l2"\naxis = [1.0, 0.0, 0.0]\nstiffness = 3e4\ndamping = 9.0\n'
    robot = Robot.load(write_arm(tmp_path, near + bends))
    rigid = Robot.load(write_arm(tmp_path / "rigid", near))
    soft, stiff = (
        Simulation(one).elastic.matrices(poses(1), layout=Layout(("tcp",), ("near", "elbow")))
        for one in (robot, rigid)
    )
    moved = np.abs(soft.sensor[0][:, -1])
    assert moved[:3].max() == 0
    assert moved[3:].max() > 0.05
    assert np.allclose(soft.sensor[0][:, :4], stiff.sensor[0], atol=1e-3)


def test_a_sensor_weighs_where_it_is(tmp_path: Path) -> None:
    heavy = '[[point]]\nname = "lump"\nlink = "l3"\nposition_m = [0.1, 0, 0.2]\nmass_kg = 5.0\n'
    toml = write_arm(tmp_path, heavy)
    robot, q = Robot.load(toml), poses(2)
    simulation = Simulation(robot)
    unknown = np.full((3, 3, 2), np.nan)
    frf = Frf(HZ[:2], unknown + 0j, unknown, unknown, (1, 1, 1), (6.0, 80.0))
    there = replace(frf, layout=Layout(("tcp",), ("lump",)))
    matrices = matrices_at(simulation.elastic, q, (there, frf))
    h = response(matrices, simulation.elasticity, laplace(np.tile(HZ, (2, 1))))
    expected = truth_between(toml, q[0], Layout(("tcp",), ("lump",)))
    assert np.abs(h[0, :3] - expected).max() < 1e-4 * np.abs(expected).max()
    bare = truth_between(toml, q[1], Layout())
    assert np.abs(h[1, 3:] - bare).max() < 1e-4 * np.abs(bare).max()


def test_slopes_by_joint_angles_hold_between_points(toml: Path) -> None:
    simulation, q, step = Simulation(Robot.load(toml)), poses(1), 1e-5
    s = laplace(HZ[None, ::5])

    def h(off: np.ndarray) -> np.ndarray:
        matrices = simulation.elastic.matrices(q + off, layout=WIDE)
        return response(matrices, simulation.elasticity, s)

    matrices = simulation.elastic.matrices(q, layout=WIDE, slopes=True)
    by_angle = moved(matrices, simulation.elasticity, s).by_angle
    assert by_angle is not None
    for joint, unit in list(enumerate(np.eye(4)))[1:]:  # turning about the vertical changes nothing
        measured = (h(step * unit) - h(-step * unit)) / (2 * step)
        assert np.abs(by_angle[:, joint] - measured).max() < 2e-2 * np.abs(measured).max()


def test_hits_elsewhere_and_sensors_that_rove(toml: Path, tmp_path: Path) -> None:
    """One pose in two sets of sensors, one with a hit at another point and none at the tool."""
    (a, b), robot = poses(2), Robot.load(toml)
    stays = [
        ("P1", a, "tcp", ("sensor", "elbow")),
        ("P1", a, "tcp", ("elbow", "shoulder")),
        ("P2", b, "elbow", ("foot", "shoulder")),
    ]
    # A base that gives a little: the foot moves.
    soft = Deviation(extra=(Spring("base", (1.0, 0.0, 0.0), 4e6, 1e3),))
    truth = record(tmp_path / "hits", toml, stays, InjectedFaults(soft))
    found = Dataset.read(tmp_path / "hits", robot, (4.0, 90.0))
    assert not found.refused
    assert found.sensors == ("sensor", "elbow", "shoulder", "foot")
    first, second = found.frfs
    assert first.layout == Layout(("tcp", "tcp"), ("sensor", "elbow", "shoulder"))
    heard = np.isfinite(first.accelerance[::3, ::3, 0])
    assert heard.tolist() == [[True, False], [True, True], [False, True]]
    assert second.layout == Layout(("elbow",), ("foot", "shoulder"))
    inside = (second.frequency_hz > 8) & (second.frequency_hz < 60)
    hz = second.frequency_hz[inside]
    expected = replace(truth, hit_point="elbow", sensors=("foot", "shoulder")).accelerance(b, hz)
    off = np.abs(second.accelerance[..., inside] - expected)
    assert np.median(off) < 0.08 * np.median(np.abs(expected))
    one, other = found.measured
    assert one.measured.frf is not None
    assert one.measured.frf.accelerance.shape[:2] == (3, 3)
    assert one.measured.modal is not None
    assert other.measured.frf is None
    assert "modes of the tool are not told" in (other.measured.remarks[-1])


def test_a_dead_channel_leaves_the_other_sensors_of_its_hits(toml: Path, tmp_path: Path) -> None:
    robot, sensors = Robot.load(toml), ("sensor", "elbow")
    stays = [(f"P{i}", q, "tcp", sensors) for i, q in enumerate(poses(2))]
    record(tmp_path / "hits", toml, stays, InjectedFaults(Deviation(3)), dead={"P1": 4})
    found = Dataset.read(tmp_path / "hits", robot, (4.0, 90.0))
    assert not found.refused
    assert [frf.layout.sensors for frf in found.frfs] == [sensors, ("sensor",)]
    whole, lacking = found.measured
    assert whole.measured.modal is not None
    assert lacking.measured.modal is not None
    assert all("elbow y" in " ".join(v.remarks) for v in lacking.measured.verdicts)
    assert not any(v.remarks for v in whole.measured.verdicts)


def test_springs_are_identified_from_hits_away_from_the_tool(toml: Path, tmp_path: Path) -> None:
    stays = [
        (f"P{i}", q, "elbow" if i % 2 else "tcp", ("elbow", "shoulder", "sensor")[: 3 - i % 2])
        for i, q in enumerate(poses(4, seed=3))
    ]
    truth = record(
        tmp_path / "hits", toml, stays, InjectedFaults(Deviation(3, stiffness=0.2, damping=0.1))
    )
    robot = Robot.load(toml)
    found = Dataset.read(tmp_path / "hits", robot, (4.0, 90.0))
    exact = Tolerances(angle_rad=1e-3, offset_m=1e-4, position_m=1e-4)
    told = identify(
        found.one_hit_frfs, found.q, Simulation(robot), extend=False, tolerances=exact
    ).identified
    assert told.misfit < 1.3
    for estimate, spring in zip(told.estimates, truth.springs, strict=False):
        off = np.log(estimate.value / spring.stiffness)
        assert abs(off) < 0.05, (estimate, spring)


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ('[[point]]\nname = "foot"\nlink = "l1"\n', "is named like an earlier one"),
        ('[[point]]\nname = "p"\nlink = "l1"\nnode = 12\n', "node 12, which is shoulder's"),
        ('[[point]]\nname = "p"\nlink = "l9"\n', 'link "l9" is no frame of arm.urdf'),
        ('[[point]]\nname = "p"\nlink = "l1"\naxes = ["u"]\n', "has axes ['u']"),
        ('[[point]]\nname = "tcp"\nlink = "l1"\n', "is not where robot.toml's tcp_frame is"),
    ],
)
def test_points_that_make_no_sense_are_refused(tmp_path: Path, more: str, told: str) -> None:
    with pytest.raises(InputError) as refused:
        Robot.load(write_arm(tmp_path, more))
    assert told in str(refused.value)


PLAN = "[workspace]\njoints_deg = [[-60, 60], [-40, 30], [20, 100], [-50, 50]]\n"
PLAN += "[modes]\ncount = 3\nband_hz = [4.0, 80.0]\n"
SOFT_FLOOR = soft_floor(1.1e6, 1.1e6)


def measured(folder: Path) -> tuple[Campaign, Truth]:
    """Hit once along each axis at three poses, by hand, on a floor that gives way."""
    toml = write_arm(folder / "robot")
    (folder / "campaign.toml").write_text(PLAN)
    injected = InjectedFaults(Deviation(31, 0.12, 0.3, 0.05, 0.006, extra=SOFT_FLOOR))
    sensors = ("sensor", "shoulder", "elbow"), ("sensor", "foot"), ("sensor", "shoulder", "elbow")
    where = zip(poses(3, 77), sensors, strict=True)
    stays = [(f"P{i}", q, "tcp", s) for i, (q, s) in enumerate(where)]
    hand = replace(EVERYDAY, angle_deg=2.0, offset_m=0.005)
    truth = record(folder / "hits", toml, stays, injected, hand, seed=5)
    campaign = Campaign.new(folder / "new", toml, folder / "campaign.toml")
    campaign.import_paths((folder / "hits",))
    return campaign, truth


def worst_percent(campaign: Campaign, truth: Truth) -> float:
    """Root mean square error of the worst mode at poses never hit."""
    unseen = poses(12, 5)
    true_hz = np.array([truth.modes(q, 3)[0] for q in unseen])
    off = np.log(campaign.model.predict(unseen).frequency_hz / true_hz)
    return float(100 * np.sqrt(np.mean(off**2, axis=0)).max())


@pytest.mark.slow
def test_the_simulation_explains_what_all_sensors_heard(tmp_path: Path) -> None:
    campaign, truth = measured(tmp_path)
    model = campaign.model
    assert model.low.is_identified
    assert "The base gives way (stiffness about x" in model.remarks[0]
    assert worst_percent(campaign, truth) < 0.1
    assert model.frequency_sd_percent.max() < 0.3
