"""What was otherwise at one pose: what it does to FRFs, and that it is found where it is."""

import numpy as np
import pytest

from planner.campaign.low_fidelity import LowFidelity
from planner.dynamics.simulation import Simulation
from planner.effects.one_visit import MisreadAngle, OfOneVisit, OtherTool, of_one_visit
from planner.effects.parameters import CAD_INERTIAS
from planner.effects.table import EffectLibrary, diagnosed
from planner.fit.data import FrfData
from planner.fit.identified_robot import IdentifiedRobot
from planner.fit.misfit import FrfMisfit
from planner.fit.search import Search
from planner.fit.structure import RobotPrior
from planner.measurement.nuisances import Tolerances
from planner.robot.robot import Robot
from tests.support.faulty_robots import mass_that_moves, urdf_of
from tests.support.fitted_cases import COUNTED, HEAVIER, Case, everyday

POSE, JOINT, OFF_DEG = 0, 2, 5.0
NAMES = "P001", "P002", "P003"


@pytest.fixture(scope="module")
def case(tmp_path_factory) -> Case:
    """A robot of another engine with a soft base, a link that bends and a hose."""
    return everyday("arm of four", 7, tmp_path_factory.mktemp("case"))


@pytest.fixture(scope="module")
def prior(case) -> RobotPrior:
    return RobotPrior(EffectLibrary.of(Simulation(Robot.load(case.toml)), CAD_INERTIAS))


def read(prior: RobotPrior, q: np.ndarray) -> tuple[OfOneVisit, ...]:
    stiff = prior.effect_library.stiff
    return of_one_visit(stiff.robot, q, NAMES[: len(q)], diagnosed(stiff))


def one(prior: RobotPrior, q: np.ndarray) -> OfOneVisit:
    return next(e for e in read(prior, q) if e.at == f"joint_{JOINT + 1} of {NAMES[POSE]}")


def test_its_slope_is_the_derivative(case, prior):
    data = FrfData.of(prior, case.frfs[:2], case.q[:2], case.band_hz, 12)
    misfit = FrfMisfit(prior.stated().with_effect(one(prior, case.q[:2])), data, Tolerances())
    x = misfit.structure.mean.copy()
    at = misfit.structure.own[-1].start
    x[at] = 0.05
    about = misfit.about(misfit.zero_nuisances(), x)
    _, columns, _ = misfit.placed(x).columns(x, about)
    step = 1e-5 * np.eye(len(x))[at]
    both = (x + step, x - step)
    ahead, behind = (misfit.placed(y).motion(y, about).accelerance for y in both)
    slope = (ahead - behind) / 2e-5
    np.testing.assert_allclose(columns[:, at], slope, rtol=0, atol=1e-3 * np.abs(slope).max())
    assert not slope[1 - POSE].any()
    assert slope[POSE].any()


@pytest.mark.parametrize("angle", [0.02, 0.5])
def test_frfs_are_those_of_where_the_joint_stood(case, prior, angle):
    structure = prior.stated().with_effect(one(prior, case.q[:2]))
    x = structure.mean.copy()
    x[structure.own[-1].start] = angle
    stood = case.q[:2] + structure.stood_off(x, case.q[:2])
    assert stood[POSE, JOINT] - case.q[POSE, JOINT] == pytest.approx(angle)
    both = []
    for s, q, here in ((structure, case.q[:2], x), (prior.stated(), stood, prior.stated().mean)):
        data = FrfData.of(prior, case.frfs[:2], q, case.band_hz, 12)
        misfit = FrfMisfit(s, data, Tolerances()).placed(here)
        both.append(misfit.motion(here, misfit.about(misfit.zero_nuisances(), here)).accelerance)
    np.testing.assert_allclose(both[0], both[1], rtol=0, atol=1e-9 * np.abs(both[1]).max())


def found(
    case: Case, prior: RobotPrior, q: np.ndarray, readings: tuple[OfOneVisit, ...], other=None
):
    measured = (*case.frfs[:3],) if other is None else other
    frfs = tuple(frf.within(case.band_hz) for frf in measured)
    robot = prior.effect_library.stiff.robot
    tolerances = Tolerances.of(robot.config, robot.joints.slides)
    search = Search(prior, frfs, q, case.band_hz, tolerances, readings=readings)
    return LowFidelity(COUNTED, Simulation(robot), tolerances, IdentifiedRobot.of(search.found()))


def test_a_joint_five_degrees_off_is_found_and_no_other(case, prior):
    wrong = case.q[:3].copy()
    wrong[POSE, JOINT] += np.deg2rad(OFF_DEG)
    low = found(case, prior, wrong, read(prior, wrong))
    assert low.identified_robot is not None
    told = low.identified_robot.posterior
    (effect,) = [e for e in told.structure.effects if isinstance(e, MisreadAngle)]
    assert effect.at == f"joint_{JOINT + 1} of {NAMES[POSE]}"
    angle, sd = np.rad2deg(told.values(effect)["angle"])
    assert angle == pytest.approx(-OFF_DEG, abs=3 * float(np.hypot(sd, 0.1)))
    (text,) = told.misread
    assert f"At {NAMES[POSE]} a{JOINT + 1} stood at" in text
    assert low.remark.startswith(text)
    assert low.remark.count(NAMES[POSE]) == text.count(NAMES[POSE])  # among no findings
    stood = low.stood(wrong)
    assert stood[POSE, JOINT] == pytest.approx(wrong[POSE, JOINT] + np.deg2rad(angle))
    stood[POSE, JOINT] = wrong[POSE, JOINT]
    np.testing.assert_array_equal(stood, wrong)


def test_a_heavier_tool_at_one_pose_is_found_with_its_mass(case, prior):
    q, pose = case.q[:3], 1
    frfs = [*case.frfs[:3]]
    frfs[pose] = case.heavier[pose].one_hit_frf
    low = found(case, prior, q, read(prior, q), frfs)
    assert low.identified_robot is not None
    told = low.identified_robot.posterior
    (effect,) = [e for e in told.structure.effects if isinstance(e, OfOneVisit)]
    assert isinstance(effect, OtherTool)
    assert effect.pose == NAMES[pose]
    mass, sd, _ = effect.parameters(told.values(effect))["mass"]
    more = HEAVIER * mass_that_moves(urdf_of(case.toml)[1])
    assert mass == pytest.approx(more, abs=3 * sd)
    assert sd < 0.2 * mass
    (text,) = told.misread
    assert f"At {NAMES[pose]} the last link carried" in text
    assert low.of_other_robots == {NAMES[pose]}


def test_none_is_found_where_all_are_right(case, prior):
    low = found(case, prior, case.q[:3], read(prior, case.q[:3]))
    assert low.identified_robot is not None
    right = low.identified_robot.posterior
    assert not [e for e in right.structure.effects if isinstance(e, OfOneVisit)]
    assert right.misread == ()
    assert low.of_other_robots == frozenset()
    np.testing.assert_array_equal(low.stood(case.q[:3]), case.q[:3])


def test_a_pose_not_measured_is_where_it_is_said_to_be(case, prior):
    structure = prior.stated().with_effect(one(prior, case.q[:2]))
    assert not structure.stood_off(structure.mean + 0.1, case.unseen).any()
