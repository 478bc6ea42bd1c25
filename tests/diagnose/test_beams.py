"""A link that bends as a beam does, not at one place."""

import numpy as np
import pytest

from planner.diagnosis.effects.link_flexibility import LinkFlexibility
from planner.diagnosis.linear.beams import as_beams
from planner.diagnosis.linear.fit import carried_on, fit, settle
from planner.diagnosis.linear.problem import Problem
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import place_name
from planner.robot.robot import Robot
from planner.truth.deviation import BentLink
from tests.support.concealed import hidden
from tests.support.known_robots import IRB6640, KR210

BENDING = 4e6  # N·m/rad: EI/L


def bending_of(simulation: Simulation, at: str) -> LinkFlexibility:
    """Bending about two axes, at one place."""
    there = (e for e in LinkFlexibility.everywhere(simulation) if e.at == at)
    return next(e for e in there if len(e.gives) == 2)


def test_its_end_gives_as_that_of_a_uniform_beam(tmp_path):
    stated = Simulation(Robot.load(KR210.write(tmp_path)))
    beam = bending_of(stated, "link_2").as_beam()
    wide = beam.structure(stated)
    robot, length = wide.robot, beam.length_m
    own = [n for n, b in enumerate(robot.config.compliance) if b.joint == beam.joint]
    assert len(own) == 4
    stiffness = np.array([BENDING, BENDING, *[12 * BENDING / length**2] * 2])
    end = robot.link_of("joint_3")
    m = wide.elastic.matrices(KR210.poses(1, 3), [end], [end])
    ports = np.concatenate([m.hit[0], m.hit_turn[0]])[:, own]
    gives = ports / stiffness @ ports.T  # (6, 6): shifts in m, then turns in rad, by N and N·m
    across = np.array([0.0, 1.0, 1.0])  # of three directions all but that along the link
    shifts, turns = np.linalg.eigvalsh(gives[:3, :3]), np.linalg.eigvalsh(gives[3:, 3:])
    both = np.linalg.svd(gives[:3, 3:], compute_uv=False)[::-1]
    assert shifts == pytest.approx(across * length**2 / (3 * BENDING), rel=1e-3, abs=1e-12)
    assert turns == pytest.approx(across / BENDING, rel=1e-3, abs=1e-12)
    assert both == pytest.approx(across * length / (2 * BENDING), rel=1e-3, abs=1e-12)


def test_one_of_seven_pieces_is_fitted_more_closely_than_by_a_hinge(tmp_path):
    bent = BentLink("link_2", (3e6, 4e6), 8e6, 2e-4, elements=7)
    frfs, q, simulation = hidden(IRB6640, tmp_path, 31, beams=(bent,), poses=4)
    problem = Problem(tuple(frfs), q, simulation, simulation.robot.config.band_hz)
    hinge = settle(problem, fit(problem, bending_of(simulation, "link_2")))
    (rough,) = as_beams(problem, [hinge])
    assert isinstance(rough.effect, LinkFlexibility)
    beam = carried_on(problem, rough, rough.effect)
    assert beam.value < hinge.value - 50.0  # nats, less what the slides' priors cost
    found = beam.named()
    slides = [b for b in rough.effect.blocks(1.0) if b.slide]
    for slide, bending in zip(slides, bent.bending, strict=True):
        stiffness = np.exp(found[f"stiffness of {place_name(slide)}"])
        uniform = 12 * bending / rough.effect.length_m**2
        assert uniform / 3 < stiffness < 3 * uniform
