"""Joints that are not linear are named from hits of different force; linear robots are not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.diagnosis.levels import Levels, level_laws
from planner.effects.parameters import CAD_INERTIAS
from planner.effects.table import Repertoire
from planner.fit.fitted import StructureFit, converged, settled
from planner.fit.gauss_newton import minimised
from planner.fit.misfit import FrfMisfit
from planner.fit.search import Search
from planner.fit.structure import RobotPrior, RobotStructure
from planner.measurement.nuisances import Tolerances
from planner.truth.laws import Backlash
from tests.support import level_cases
from tests.support.level_cases import LevelCase, Protocol, made

HOW = Protocol(repeats=1, poses=4)
NUMBERS = {"friction": ("presliding_stiffness", "coulomb_torque"),
           "backlash": ("lost_stiffness", "half_gap")}  # fmt: skip


def linear_fit(case: LevelCase) -> StructureFit:
    """Of the averages over all hits: logarithms first, then the FRFs."""
    robot, recorded = case.simulation.robot, case.recorded
    prior = RobotPrior(Repertoire.of(case.simulation, CAD_INERTIAS))
    tolerances = Tolerances.of(robot.config, robot.joints.slides)
    search = Search(prior, recorded.ended_frfs, recorded.q, recorded.band_hz, tolerances)
    structure = RobotStructure(prior)
    misfit = FrfMisfit(structure, search.data(28), tolerances, None)
    at = minimised(misfit, structure.mean, 15)
    misfit = misfit.with_rho(0.1)
    return converged(settled(misfit, minimised(misfit, at.x, 8)))


def seen(case: LevelCase) -> Levels:
    """What the levels of a case tell."""
    return level_laws(case.recorded, linear_fit(case))


@pytest.mark.parametrize("seed", range(3))
def test_a_linear_robot_hit_by_hand_is_proportional(tmp_path: Path, seed: int) -> None:
    levels = seen(made(seed, tmp_path, HOW))
    assert levels.laws == ()
    assert not levels.unexplained


@pytest.mark.parametrize(("seed", "joint"), [(3, "joint_2"), (4, "joint_3")])
def test_a_joint_that_hardens_is_named(tmp_path: Path, seed: int, joint: str) -> None:
    levels = seen(made(seed, tmp_path, HOW, hardening=0.8, joint=joint))
    law = levels.laws[0]
    assert (law.effect, law.at) == ("nonlinear_stiffness", joint)
    assert law.parameters["stiffness_change"][0] > 0
    assert levels.candidates[0][:2] == (law.effect, joint)
    assert levels.candidates[0][2] > 0.9
    assert levels.explained > 0.5
    assert not levels.unexplained
    assert sum(p for *_, p in levels.candidates) == pytest.approx(1)


@pytest.mark.parametrize("effect", NUMBERS)
def test_the_numbers_of_a_law_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, effect: str
) -> None:
    concealed = []

    def law(k: float, top: float, hardening: float, friction: float, how: Protocol):
        own = friction * k, top / max(how.levels) / 3
        concealed.append((own[0], own[0] * own[1]) if effect == "friction" else own)
        return usual(k, top, hardening, friction, how) if effect == "friction" else Backlash(*own)

    usual = level_cases._law
    monkeypatch.setattr(level_cases, "_law", law)
    found = seen(made(5, tmp_path, HOW, friction=0.4, joint="joint_2")).laws[0]
    assert (found.effect, found.at) == (effect, "joint_2")
    for name, true in zip(NUMBERS[effect], concealed[0], strict=True):
        value, sd, unit = found.parameters[name]
        assert value == pytest.approx(true, abs=3 * sd)
        assert sd < 0.2 * true
        assert unit == {"coulomb_torque": "N·m", "half_gap": "rad"}.get(name, "N·m/rad")


def test_what_no_joint_explains_is_unexplained(tmp_path: Path) -> None:
    """The hardest hits of each pose are answered in other directions: contact, loose parts."""
    case, rng, visits = made(1, tmp_path, HOW), np.random.default_rng(0), []
    for visit in case.recorded.visits:
        mixed = np.eye(3) + 0.15 * rng.standard_normal((3, 3))
        hits = [
            replace(h, acceleration_m_s2=mixed @ h.acceleration_m_s2)
            if case.recorded.level(h) == 2 else h
            for h in visit.hits
        ]  # fmt: skip
        visits.append(replace(visit, hits=tuple(hits)))
    levels = seen(replace(case, recorded=case.recorded.corrected(visits)))
    assert levels.laws == ()
    assert levels.unexplained


def test_one_level_says_nothing(tmp_path: Path) -> None:
    levels = seen(made(2, tmp_path, replace(HOW, levels=(1.0,)), hardening=0.8))
    assert levels.laws == ()
    assert not levels.unexplained
