"""Drift that is none: a fit that found a better minimum is no change in time."""

from dataclasses import replace

import numpy as np
import pytest

from planner.dataset.dataset import Dataset
from planner.diagnosis.effects.drift import Drift
from planner.diagnosis.linear.drift_fit import problem_of
from planner.diagnosis.linear.predict import similarity
from planner.diagnosis.screens import drift
from planner.diagnosis.screens.drift import screen
from planner.dynamics.simulation import Simulation
from planner.robot.robot import Robot
from tests.support.known_robots import KR210
from tests.support.synthetic_hits import recorded


@pytest.fixture(scope="module")
def simulation(tmp_path_factory):
    return Simulation(Robot.load(KR210.write(tmp_path_factory.mktemp("robot"))))


def test_no_drift_where_only_the_fit_without_it_went_wrong(simulation, monkeypatch):
    still = recorded(simulation, KR210.poses(4, 3))
    plain, *found = drift.fits(still, simulation)
    monkeypatch.setattr(drift, "fits", lambda *_: (plain, *found))
    assert screen(still, simulation) == ()
    x = plain.x + np.log(2.0) * (np.arange(len(plain.x)) == 1)  # a joint twice as stiff
    stuck = replace(plain, x=x, data=plain.misfit.by_pose(x))
    monkeypatch.setattr(drift, "fits", lambda *_: (stuck, *found))
    assert stuck.per_value > 3 * min(f.per_value for f in found)
    assert screen(still, simulation) == ()
    monkeypatch.setattr(drift, "DRIFT_MOVED", 0.0)  # a change that is sure, and next to none
    assert screen(still, simulation) == ()


def test_drift_that_is_there_is_found(simulation):
    def softer(visit: int, level: int) -> float:
        return 1.0 - 0.05 * visit

    moving = recorded(simulation, KR210.poses(4, 3), softer)
    (found,) = screen(moving, simulation)
    change, sd, _ = found.parameters["change"]
    assert change == pytest.approx(-0.15, abs=4 * sd)
    assert problem_of(moving, simulation).order[-1] == 1.0
    fits = found.drift_fits
    assert fits is not None
    assert fits.refitted.per_value > 3 * fits.best.per_value
    refitted, explained = (similarity(fits.problem, f) for f in (fits.refitted, fits.best))
    assert explained.frac > max(0.999, refitted.frac)


def test_a_step_is_told_where_springs_also_differ_from_pose_to_pose(simulation):
    """Nothing fits closely then, and other steps are tried in other orders of the visits."""
    rng = np.random.default_rng(5)
    factor = 1 + 0.03 * rng.standard_normal((8, len(simulation.elasticity.stiffness)))
    factor[4:, :3] *= (0.75, 0.85, 0.8)
    moving = recorded(simulation, KR210.poses(8, 3), lambda visit, level: factor[visit], (300.0,))
    (found,) = screen(moving, simulation)
    assert found.misfit > drift.DRIFT_CRUDE
    assert "at once" in found.text
    assert -0.26 < found.parameters["change"][0] < -0.13


def test_a_small_step_of_one_joint_is_none_of_a_gradual_course(simulation):
    factor = np.ones((6, len(simulation.elasticity.stiffness)))
    factor[3:, 1] *= 0.97
    moving = recorded(simulation, KR210.poses(6, 3), lambda visit, level: factor[visit], (300.0,))
    _, *found = drift.fits(moving, simulation)
    best = drift._likeliest(found)
    assert isinstance(best.effect, Drift)
    assert (best.effect.kind, best.effect.joints) == ("step", ("joint_2",))
    assert best.effect.since == pytest.approx(0.6)
    assert best.x[-1] == pytest.approx(np.log(0.97), abs=0.003)


@pytest.mark.parametrize("heavier_first", [False, True])
def test_a_tool_that_was_changed_is_told_as_such(tmp_path, heavier_first):
    """Not as springs that all grew softer, or stiffer, at once."""
    path, other = KR210.write(tmp_path / "robot"), tmp_path / "robot" / "heavier.toml"
    tool = '\n[[payload]]\nlink = "link_6"\nmass = 25.0\ncom_m = [0.05, 0.02, 0.15]\n'
    other.write_text(path.read_text() + tool)
    both = [Simulation(Robot.load(toml)) for toml in (path, other)]
    if heavier_first:
        both.reverse()
    first, then = (recorded(one, KR210.poses(6, 3), peaks_n=(300.0,)).visits for one in both)
    changed = Dataset.of_visits((*first[:3], *then[3:]), both[0].robot.config.band_hz)
    (found,) = screen(changed, both[0])
    assert (found.effect, found.at) == ("drift", "campaign")
    mass, sd, unit = found.parameters["mass"]
    assert unit == "kg"
    assert abs(mass) == pytest.approx(25.0, abs=4 * sd + 0.5)
    assert (mass < 0) is heavier_first
    assert "From the visit of P4 on, link_6 carries 2" in found.text
    assert ("less" if heavier_first else "more") in found.text
    assert found.misfit < 1.2


def test_springs_that_all_grow_softer_are_no_load(simulation):
    factor = np.ones((6, len(simulation.elasticity.stiffness)))
    factor[3:] *= 0.94
    moving = recorded(simulation, KR210.poses(6, 3), lambda visit, level: factor[visit], (300.0,))
    (found,) = screen(moving, simulation)
    assert "mass" not in found.parameters
    assert found.parameters["change"][0] == pytest.approx(-0.06, abs=0.01)


def test_no_drift_where_other_orders_of_the_visits_explain_as_much(simulation, monkeypatch):
    """Three springs differ from pose to pose without any order."""
    own = np.arange(len(simulation.elasticity.stiffness)) < 3
    rng = np.random.default_rng(2)
    factor = 1.0 + 0.06 * rng.standard_normal((4, len(own))) * own
    restless = recorded(simulation, KR210.poses(4, 2), lambda visit, level: factor[visit], (300.0,))
    assert not drift.along_a_joint(restless)
    assert screen(restless, simulation) == ()
    monkeypatch.setattr(drift, "DRIFT_ORDER", -np.inf)  # any order would do
    assert len(screen(restless, simulation)) == 1


def test_a_sweep_of_a_joint_is_known(simulation):
    q = KR210.poses(6, 3)
    assert not drift.along_a_joint(recorded(simulation, q, peaks_n=(300.0,)))
    q[:, 2] = np.linspace(1.6, 0.8, 6)
    assert drift.along_a_joint(recorded(simulation, q, peaks_n=(300.0,)))
