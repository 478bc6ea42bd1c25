"""Where one more sensor would part what the tool's sensor leaves tied."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from planner.diagnosis.effects import library
from planner.diagnosis.linear.fit import FINE, Fit, Problem, fit, settle

from planner.design.discrimination import separation
from planner.design.extra_sensor import WORTH, extra_sensor
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.recording.points import Layout
from planner.robot.robot import Robot
from planner.truth.deviation import Deviation, Spring
from planner.truth.load import load_truth
from tests.support.arm_with_points import poses, write_arm

LINES = np.linspace(5.0, 80.0, 64)
SOFT = tuple(Spring("base", axis, 6e6, 2e3) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))


@pytest.fixture(scope="module")
def tied(tmp_path_factory: pytest.TempPathFactory) -> tuple[Problem, list[Fit]]:
    """A floor that gives way a little, and a first joint that tilts: alike from the tool."""
    toml = write_arm(tmp_path_factory.mktemp("arm"))
    truth, q, rng = load_truth(toml, Deviation(extra=SOFT)), poses(2, 3), np.random.default_rng(0)
    frfs = []
    for one in q:
        h = truth.accelerance(one, LINES)
        sd = np.full(h.shape, 0.02 * np.sqrt(np.mean(np.abs(h) ** 2)))
        noise = sd * (rng.standard_normal(h.shape) + 1j * rng.standard_normal(h.shape)) / np.sqrt(2)
        unknown = np.full(h.shape, np.nan)
        frfs.append(Frf(LINES, h + noise, sd**2, unknown, (1, 1, 1), (5.0, 80.0)))
    problem = Problem(tuple(frfs), q, Simulation(Robot.load(toml)), (5.0, 80.0))
    all_ = {(e.name, e.at): e for e in library(problem.simulation)}
    both = ("base_compliance", "base"), ("transverse_compliance", "joint_1")
    return problem, [settle(problem, fit(problem, all_[place]), FINE) for place in both]


def told(problem: Problem, fits: list[Fit]) -> Any:
    places = [((f.effect.name, f.effect.at),) for f in fits]
    undecided = [
        SimpleNamespace(fit=f, probability=0.5, places=place)
        for f, place in zip(fits, places, strict=True)
    ]
    diagnosis = SimpleNamespace(undecided=undecided, problem=problem, temper=1.0)
    recorded = SimpleNamespace(poses=("P1", "P2"), q=problem.q)
    judged = SimpleNamespace(diagnosis=diagnosis)
    return extra_sensor(cast(Any, SimpleNamespace(recorded=recorded, judged=judged)), {})


def test_a_sensor_at_the_foot_parts_floor_and_first_joint(tied: tuple[Problem, list[Fit]]) -> None:
    problem, fits = tied
    found = told(problem, fits)
    assert found.point == "foot"  # the floor moves it, the joint does not
    assert found.log_odds > found.log_odds_without + WORTH
    assert "A sensor at foot would tell base compliance at base" in found.sentence
    row = problem.q[["P1", "P2"].index(found.pose)]
    layout = Layout(("tcp",), ("sensor", "foot"))
    alone = separation(problem, fits, [0.5, 0.5], row, 1.0, layout)
    assert alone[0]["xyz".index(found.hit)] == pytest.approx(found.log_odds)


def test_nothing_is_proposed_where_nothing_is_tied(tied: tuple[Problem, list[Fit]]) -> None:
    problem, fits = tied
    assert told(problem, fits[:1]) is None
    assert told(problem, [fits[0], fits[0]]) is None
