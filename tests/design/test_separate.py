"""Hits and sensors that part what is left tied, or tell more of the simulation a minute."""

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from planner.design.cost import Cost
from planner.design.discrimination import (
    WORTH,
    TiedExplanations,
    extra_sensor,
    next_hit,
    separation,
)
from planner.design.frequency_posterior import FrequencyOutputs, Poses, Target
from planner.design.parameter_sensitivity import FrfNoise, UncertainParameters, better_places
from planner.design.stopping import forecast
from planner.diagnosis.diagnose import searching
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import CAD_INERTIAS
from planner.fit.fitted import converged, settled
from planner.fit.identify import robot_prior
from planner.fit.misfit import FrfMisfit
from planner.fit.posterior import RobotBelief
from planner.fit.search import SEARCHED, Search
from planner.fit.structure import RobotStructure
from planner.frf.frf import Frf
from planner.measurement.nuisances import Tolerances
from planner.proof.deviation import Deviation, soft_floor
from planner.proof.load import load_truth
from planner.recording.points import Layout
from planner.robot.robot import Robot
from planner.surrogate.modal_surrogate import fit_surrogate
from tests.support.arm_with_points import poses, write_arm
from tests.support.surrogates import observed

LINES = np.linspace(5.0, 80.0, 64)
SOFT = soft_floor(6e6, 6e6, 2e3 / 6e6)
PLACES = {"soft_base at base": ("base_compliance", "base"),
          "transverse_compliance at joint_1": ("transverse_compliance", "joint_1")}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Cell:
    """An arm on a floor that gives way: alike from the tool is a first joint that tilts."""

    truth: Any
    search: Search

    def frf(self, q: np.ndarray, seed: int) -> Frf:
        """Measured at q (4,)."""
        rng, h = np.random.default_rng(seed), self.truth.accelerance(q, LINES)
        sd = np.full(h.shape, 0.02 * np.sqrt(np.mean(np.abs(h) ** 2)))
        noise = sd * (rng.standard_normal(h.shape) + 1j * rng.standard_normal(h.shape)) / np.sqrt(2)
        unknown = np.full(h.shape, np.nan)
        return Frf(LINES, h + noise, sd**2, unknown, (1, 1, 1), (5.0, 80.0))

    def candidates(self) -> tuple[TiedExplanations, ...]:
        """Both explanations, settled."""
        data, prior = self.search.data(SEARCHED), self.search.prior
        found, built = [], prior.built
        every = {effect.label: effect for effect in prior.effect_library.effects}
        for label, place in PLACES.items():
            structure = RobotStructure(prior, (*built, every[label]), data.sensors)
            misfit = FrfMisfit(structure, data, self.search.tolerances)
            fit = converged(settled(misfit, misfit(structure.mean), rounds=3))
            found.append(TiedExplanations((place,), 0.5, fit))
        return tuple(found)

    def found(self, tied: tuple[TiedExplanations, ...]) -> Any:
        """What of a diagnosis proposals look at."""
        names = tuple(f"P{i + 1}" for i in range(len(self.search.q)))
        recorded = SimpleNamespace(poses=names, q=self.search.q, visits=(1,), level_n=[60.0, 247.0])
        return SimpleNamespace(recorded=recorded, search=self.search, best=tied[0].fit)


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Cell:
    toml = write_arm(tmp_path_factory.mktemp("arm"))
    made = Cell(load_truth(toml, Deviation(extra=SOFT)), None)
    q = poses(2, 3)
    frfs = [made.frf(row, k) for k, row in enumerate(q)]
    return replace(made, search=searching(frfs, q, Simulation(Robot.load(toml))))


@pytest.fixture(scope="module")
def tied(cell: Cell) -> tuple[TiedExplanations, ...]:
    found = cell.candidates()
    assert len(found) == 2
    return found


def test_what_is_the_same_is_told_apart_by_nothing(tied: tuple[TiedExplanations, ...]) -> None:
    q = poses(2, 9)
    assert not separation(tied[:1], q).any()
    assert separation([tied[0], tied[0]], q) == pytest.approx(0.0, abs=1e-6)


def test_the_hit_that_is_proposed_tells_more_than_the_worst(
    cell: Cell, tied: tuple[TiedExplanations, ...]
) -> None:
    """By what measuring there does to the odds, all refitted."""
    q = poses(8, 11)
    gain = separation(tied, q).max(axis=1)
    assert gain.min() >= 0
    offered = {f"Q{i}": row for i, row in enumerate(q)}
    found = next_hit(cell.found(tied), tied, offered)
    assert found is not None
    assert found.pose == f"Q{int(np.argmax(gain))}"
    assert found.log_odds == pytest.approx(gain.max())
    assert found.force_n == (240.0,)
    assert "base compliance at base (50 %) from transverse compliance at joint_1" in found.sentence
    before = tied[0].fit.evidence - tied[1].fit.evidence
    odds = []
    for k in (int(np.argmax(gain)), int(np.argmin(gain))):
        q_more = np.vstack([cell.search.q, q[k]])
        frfs = (*cell.search.frfs, cell.frf(q[k], 7))
        base, joint = replace(cell, search=replace(cell.search, frfs=frfs, q=q_more)).candidates()
        odds.append(base.fit.evidence - joint.fit.evidence - before)
    assert odds[0] > odds[1]
    assert odds[0] > 1.0
    assert next_hit(cell.found(tied), tied, {}) is None
    assert next_hit(cell.found(tied), tied[:1], offered) is None


def test_a_sensor_at_the_foot_parts_floor_and_first_joint(
    cell: Cell, tied: tuple[TiedExplanations, ...]
) -> None:
    found = extra_sensor(cell.found(tied), tied, {})
    assert found is not None
    assert found.point == "foot"  # the floor moves it, the joint does not
    assert found.log_odds > found.log_odds_without + WORTH
    assert "A sensor at foot would tell base compliance at base" in found.sentence
    row = cell.search.q[["P1", "P2"].index(found.pose)]
    alone = separation(tied, row[None], ("foot",))
    assert alone[0]["xyz".index(found.hit)] == pytest.approx(found.log_odds)
    assert extra_sensor(cell.found(tied), tied[:1], {}) is None
    assert extra_sensor(cell.found(tied), (tied[0], tied[0]), {}) is None


COST = Cost(np.full(4, 0.2))


@pytest.fixture(scope="module")
def open_(tmp_path_factory) -> UncertainParameters:
    """An arm whose sensor at the tool has one axis; joint 2 and 3 tilt, springs are guessed."""
    springs = "".join(
        f'[[compliance]]\njoint = "{joint}"\naxis = {axis}\nstiffness = 1e6\ndamping = 300.0\n'
        for joint in ("a2", "a3")
        for axis in ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    )
    toml = write_arm(tmp_path_factory.mktemp("arm"), springs)
    one_axis = toml.read_text().replace('name = "sensor"\n', 'name = "sensor"\naxes = ["x"]\n')
    toml.write_text(one_axis)
    simulation = Simulation(Robot.load(toml))
    robot = RobotBelief.stated(robot_prior(simulation, CAD_INERTIAS), Tolerances())
    return UncertainParameters(robot, FrfNoise(0.01, 0.02, 0.5), (4.0, 90.0))


@pytest.fixture(scope="module")
def outputs(open_) -> FrequencyOutputs:
    surrogate, q = fit_surrogate(observed(6, 0)), poses(12, 5)
    said, x = open_.simulation.modes(q, 4), np.random.default_rng(0).uniform(size=(12, 2))
    low = np.zeros((12, 4))
    target = Target.evenly(open_.poses(x, low, q, said, informed=True))
    return FrequencyOutputs.of(surrogate, target, covariance=open_.covariance)


def proposed(open_) -> tuple[str, Poses, np.ndarray]:
    q = poses(1, 9)
    said = open_.simulation.modes(q, 4)
    return "P002", open_.poses(np.zeros((1, 2)), np.zeros((1, 4)), q, said, False), q[0]


def test_a_sensor_more_tells_no_less(open_):
    q = poses(2, 3)
    fewer = open_.information(q, Layout(("tcp",), ("sensor",)))
    more = open_.information(q, Layout(("tcp",), ("sensor", "elbow")))
    assert np.allclose(fewer, open_.information(q))
    gained = np.linalg.eigvalsh(more - fewer)
    assert gained.min() > -1e-8 * gained.max()
    assert gained.max() > 0


def test_what_is_proposed_holds_what_it_promises(open_, outputs):
    name, at, q = proposed(open_)
    found = better_places(open_, outputs, (name, at, q), COST, 0.5, 1.0)
    assert found is not None
    assert found.sentence.startswith("At P002 ")
    # By hand: Σ' = (Σ⁻¹ + F)⁻¹, and its mean variance over the workspace.
    for sensors, point, stated in (
        (found.sensors, found.hit_point, found.sd_percent),
        (("sensor",), "", found.sd_percent_as_it_is),
    ):
        told = open_.information(q[None], Layout(("tcp",), sensors))[0].sum(axis=0)
        if point:
            told = told + open_.information(q[None], Layout((point,), sensors))[0].sum(axis=0)
        after = np.linalg.inv(np.linalg.inv(open_.covariance) + told)
        slope = outputs.workspace.poses.slope * outputs.trust[:, None]
        variance = np.einsum("ukp,pr,ukr->uk", slope, after, slope)
        left = 100 * np.sqrt(np.sum(outputs.workspace.importance * variance))
        assert stated == pytest.approx(left, rel=1e-3)
    left = np.array([found.sd_percent, found.sd_percent_as_it_is])
    minutes = np.array([found.minutes, found.minutes_as_it_is])
    rate = np.log(found.sd_percent_now / left) / minutes
    assert rate[0] > rate[1]
    more = COST.per_sensor * bool(found.added) + COST.hitting((0, 1, 2)) * bool(found.hit_point)
    assert minutes[0] - minutes[1] == pytest.approx(more)


def test_no_sensor_is_asked_for_where_all_are_there(open_, outputs):
    every = ("sensor", "foot", "shoulder", "elbow")
    there = replace(open_, noise=replace(open_.noise, sensors=every))
    found = better_places(there, outputs, proposed(open_), COST, 0.5, 1.0)
    assert found is None or not found.added


def test_nothing_is_asked_for_once_the_tool_reaches_the_target(open_, outputs):
    assert better_places(open_, outputs, proposed(open_), COST, 0.5, 10.0) is None


def test_a_forecast_counts_what_parameters_gain(open_, outputs):
    best = outputs.workspace.poses[[0]]
    told = forecast(outputs, best, 1.0, 0.95)
    blind = forecast(outputs, best.uninformed, 1.0, 0.95)
    assert told.gain_percent > 2 * blind.gain_percent
