"""A mass that swings on its own, as a hose pack does: sought where springs cannot explain the FRFs.

It has a mode of its own, which moves and splits those of the robot: no stiffness imitates it.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import msgspec
import numpy as np

from planner.diagnosis.effects.local_resonator import LocalResonator
from planner.diagnosis.linear.fit import Fit, approached, settle
from planner.diagnosis.linear.problem import GLANCE, Grade, Problem
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.identification.extended_structure import ExtendedModel
from planner.identification.held_out import farthest_first
from planner.identification.parameters import parametrise
from planner.identification.result import Identification
from planner.inference.parallel import side_by_side
from planner.robot.config import Resonator

# All starts at all links are followed for a few steps by logarithms, the most promising of each
# link farther: on so many poses, for fewer have fewer wrong minima. Starts whose values differ by
# less have met.
FIRST_STEPS, PROMISING, LOG_STEPS, FEW, MET = 4, 4, 10, 3, 1e-4
# Steps by which all of these come near, and how many of them are followed to the end.
NEAR_STEPS, FOLLOWED = 8, 6
COMPARED = Grade(40, 0.003)  # as an identification looks, which compares what is found


def swinging(
    structure: ExtendedModel,
    identified: Identification,
    frfs: Sequence[Frf],
    q: np.ndarray,
    band_hz: tuple[float, float],
) -> tuple[ExtendedModel, np.ndarray]:
    """The structure with a mass on a spring at the link where it explains most.

    And starts (1, P) of its springs, in their units.

    Args:
        structure: What was identified, and what is known of it before.
        identified: From the same FRFs.
        frfs: Measured at q.
        q: (n, dof) in rad.
        band_hz: Where they are compared.
    """
    problem = Problem(tuple(frfs), q, structure.simulation, band_hz, structure.priors)
    few = problem.at(farthest_first(q)[:FEW].tolist())
    springs = identified.mean[: len(identified.estimates)]
    effects = LocalResonator.everywhere(structure.simulation)
    stated = parametrise(structure.simulation, structure.priors).mean
    best = _best(few, side_by_side(partial(_promising, few, (springs, stated)), effects))
    # Its frequency shows before its place does.
    near = _best(few, side_by_side(partial(_at_frequency, few, best), effects))
    best = settle(problem, min(best, near, key=_value), COMPARED)
    return _with(structure, best), np.exp(best.x[None, : best.misfit.split[0]])


def _value(fit: Fit) -> float:
    return fit.value


def _best(problem: Problem, near: Sequence[Sequence[Fit]]) -> Fit:
    """Of the nearest fits of all links the one that ends best."""
    nearest = sorted((f for fits in near for f in fits), key=_value)[:FOLLOWED]
    ends = side_by_side(partial(settle, problem, grade=COMPARED), nearest)
    return min(ends, key=_value)


def _near(problem: Problem, rough: Fit) -> Fit:
    return settle(problem, rough, COMPARED, NEAR_STEPS)


def _promising(
    problem: Problem, springs: Sequence[np.ndarray], effect: LocalResonator
) -> list[Fit]:
    """Where its starts beside springs θ (P,) lead: the best that differ after a few steps."""
    rough = problem.misfit(effect, GLANCE)
    tried = []
    for some in springs:
        others = np.append(some, rough.mean[len(some) : rough.split[1]])
        starts = [np.append(others, psi) for psi in effect.starts()]
        tried += [approached(rough, [x], FIRST_STEPS) for x in starts]
    kept: list[Fit] = []
    last = 0.0
    for value, fit in sorted(((_value(f), f) for f in tried), key=lambda pair: pair[0]):
        if value > last * (1 + MET):
            kept.append(fit)
        last = value
    ends = (approached(rough, [f.x], LOG_STEPS) for f in kept[:PROMISING])
    return [_near(problem, f) for f in ends]


def _at_frequency(problem: Problem, found: Fit, effect: LocalResonator) -> list[Fit]:
    """On another link, in three directions, with the frequency (its logarithm) that was found."""
    rough, hertz = problem.misfit(effect, GLANCE), found.x[found.misfit.split[1] + 1]
    others, fits = found.x[: found.misfit.split[1]], []
    for psi in effect.starts()[:3]:
        x = np.append(others, psi)
        x[len(others) + 1] = hertz
        fits.append(_near(problem, approached(rough, [x], LOG_STEPS)))
    return fits


def _with(structure: ExtendedModel, found: Fit) -> ExtendedModel:
    effect = found.effect
    assert isinstance(effect, LocalResonator)
    psi = found.x[found.misfit.split[1] :]
    values = {
        quantity.name: (quantity.value(float(at)), 0.0, quantity.unit)
        for quantity, at in zip(effect.quantities, psi, strict=True)
    }
    [block] = effect.elements(structure.simulation, values)["resonator"]
    robot = structure.simulation.robot
    resonators = (*robot.config.resonator, msgspec.convert(block, Resonator))
    wider = msgspec.structs.replace(robot.config, resonator=resonators)
    simulation = Simulation(replace(robot, config=wider))
    return replace(structure, simulation=simulation, swinging=effect.text(values))
