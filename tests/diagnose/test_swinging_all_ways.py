"""What hangs on three unlike springs, as it is written for the simulation."""

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.effects.hanging_resonator import HangingResonator
from planner.diagnosis.effects.local_resonator import LocalResonator
from planner.diagnosis.effects.two_hanging_resonators import TwoHangingResonators
from planner.diagnosis.linear import three_axis_resonators
from planner.diagnosis.linear.predict import misfit_at
from planner.diagnosis.linear.problem import Problem
from planner.diagnosis.linear.second_resonators import second_resonators
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.robot.config import EffectTable
from planner.robot.robot import Robot
from tests.support.known_robots import KR210

LINES = np.linspace(6.0, 60.0, 109)
HUNG_HZ, OTHER_HZ = (14.0, 24.0, 40.0), (8.0, 11.0, 18.0)


@pytest.fixture(scope="module")
def stated(tmp_path_factory) -> Simulation:
    return Simulation(Robot.load(KR210.write(tmp_path_factory.mktemp("robot"))))


def hanging(stated: Simulation) -> tuple[HangingResonator, np.ndarray]:
    """What hangs on link 3, and its ψ."""
    slides = next(e for e in LocalResonator.everywhere(stated) if e.at == "link_3")
    hangs = HangingResonator.of(slides)
    turn, place = [0.3, -0.4, 0.2], [q.mean + 0.05 for q in hangs.quantities[-3:]]
    return hangs, np.array([np.log(12.0), *np.log(HUNG_HZ), np.log(0.05), *turn, *place])


def two_hanging(stated: Simulation) -> tuple[TwoHangingResonators, np.ndarray]:
    """A heavier one beside it, and their ψ."""
    hangs, psi = hanging(stated)
    turn, place = [-0.2, 0.5, 0.1], [q.mean - 0.1 for q in hangs.quantities[-3:]]
    other = [np.log(30.0), *np.log(OTHER_HZ), np.log(0.03), *turn, *place]
    return TwoHangingResonators.of(hangs), np.concatenate([psi, other])


@pytest.mark.parametrize("hung", [hanging, two_hanging])
def test_as_elements_it_answers_alike(stated, hung):
    """Three that slide, and twice the mass taken away, move the robot as the one that hangs."""
    hangs, psi = hung(stated)
    q = KR210.poses(2, 3)
    misfit = misfit_at(Problem((), q, stated, (6.0, 60.0)), hangs, q, LINES)
    x = misfit.mean.copy()
    x[misfit.split[1] :] = psi
    values = {
        part.name: (part.value(p), 0.0, part.unit)
        for part, p in zip(hangs.quantities, psi, strict=True)
    }

    block = {"effect": hangs.name, "at": hangs.at, **hangs.elements(stated, values)}
    springs = [{} for _ in stated.robot.config.compliance]
    bodies = stated.elastic.bodies
    nothing = np.zeros((len(bodies), 10))
    with_it = stated.with_effects(springs, [msgspec.convert(block, EffectTable)], bodies, nothing)
    h, wanted = with_it.accelerance(q, LINES), misfit.values(x)[0]
    mass = sum(v for name, (v, _, _) in values.items() if name.endswith("mass"))
    # But for its weight, which bears on the joints.
    assert np.linalg.norm(h - wanted) < 1e-4 * mass * np.linalg.norm(wanted)


def with_it(stated: Simulation, effect: Effect, psi: np.ndarray) -> Problem:
    """FRFs of the robot with an effect."""
    q, nothing = KR210.poses(4, 3), np.full((3, 3, len(LINES)), np.nan)
    misfit = misfit_at(Problem((), q, stated, (6.0, 60.0)), effect, q, LINES)
    x = misfit.mean.copy()
    x[misfit.split[1] :] = psi
    frfs = tuple(
        Frf(LINES, h, 1e-4 * np.abs(h) ** 2, nothing, (3, 3, 3), (6.0, 60.0))
        for h in misfit.values(x)[0]
    )
    return Problem(frfs, q, stated, (6.0, 60.0))


def test_it_is_found_from_nothing(stated):
    hangs, psi = hanging(stated)
    problem = with_it(stated, hangs, psi)
    slides = next(e for e in LocalResonator.everywhere(stated) if e.at == hangs.at)
    (found,) = three_axis_resonators.hung(problem, [slides])
    known = found.named()
    hz = sorted(np.exp(v) for name, v in known.items() if name.startswith("frequency"))
    assert hz == pytest.approx(HUNG_HZ, rel=0.05)
    mass = next(v for name, v in known.items() if name.startswith("mass of local_resonator"))
    assert np.exp(mass) == pytest.approx(12.0, rel=0.2)


def test_a_second_one_is_found_beside_it(stated):
    """A fit with one alone leads to both, and their numbers are those that are there."""
    two, psi = two_hanging(stated)
    problem = with_it(stated, two, psi)
    (one,) = three_axis_resonators.hung(problem, [two.first])
    (found,) = second_resonators(problem, [one])
    assert found.per_value < 0.1 * one.per_value
    values = found.parameters(1.0)
    masses = sorted(values[name][0] for name in ("mass", "second_mass"))
    assert masses == pytest.approx([12.0, 30.0], rel=0.2)
    assert "Two things on link_3" in found.effect.text(values)


@pytest.mark.parametrize("way", [np.zeros(3), np.array([0.0, -2.0, 0.0]), np.array([1.0, 1, 1])])
def test_what_has_no_direction_yet_may_hang_as_well(way):
    """A fit that never moved a resonator leaves its direction at 0."""
    turned = Rotation.from_rotvec(three_axis_resonators.turned_to(way)).apply(
        [np.linalg.norm(way), 0.0, 0.0]
    )
    assert turned == pytest.approx(way)
