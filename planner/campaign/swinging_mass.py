"""A mass that swings on its own, as a hose pack does: sought where springs cannot explain the FRFs.

It has a mode of its own, which moves and splits those of the robot: no stiffness imitates it.
"""

from collections.abc import Sequence
from dataclasses import replace

import msgspec
import numpy as np

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.effects.local_resonator import LocalResonator
from planner.diagnosis.linear.fit import Fit, approached, glance, settle
from planner.diagnosis.linear.problem import CLOSE, GLANCE, Problem
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.identification.extended_structure import Structure
from planner.identification.held_out import farthest_first
from planner.identification.result import Identification
from planner.robot.config import Resonator

# Steps by logarithms, on so many poses, in which every start at every link is followed where that
# is asked for: fewer poses have fewer wrong minima.
LOG_STEPS, FEW = 10, 2
FOLLOWED = 2  # links that are followed after a glance at all


def swinging(
    structure: Structure,
    identified: Identification,
    frfs: Sequence[Frf],
    q: np.ndarray,
    band_hz: tuple[float, float],
    everywhere: bool,
) -> tuple[Structure, np.ndarray]:
    """The structure with a mass on a spring at the link where it explains most.

    And starts (1, P) of its springs, in their units.

    Args:
        structure: What was identified, and what is known of it before.
        identified: From the same FRFs.
        frfs: Measured at q.
        q: (n, dof) in rad.
        band_hz: Where they are compared.
        everywhere: Whether all starts at all links are followed: seconds.
    """
    problem = Problem(tuple(frfs), q, structure.simulation, band_hz, structure.priors)
    effects = LocalResonator.everywhere(structure.simulation)
    if everywhere:
        few = problem.at(farthest_first(q)[:FEW].tolist())
        best = settle(problem, _best([_from_everywhere(few, e) for e in effects]), CLOSE)
    else:
        none = approached(problem.misfit(Effect(""), CLOSE), [identified.mean], steps=0)
        rough = sorted([glance(problem, e, none) for e in effects], key=_value)
        best = _best([settle(problem, f, CLOSE) for f in rough[:FOLLOWED]])
    return _with(structure, best), np.exp(best.x[None, : best.misfit.split[0]])


def _best(fits: Sequence[Fit]) -> Fit:
    return min(fits, key=_value)


def _value(fit: Fit) -> float:
    return fit.misfit(fit.x).value


def _from_everywhere(problem: Problem, effect: LocalResonator) -> Fit:
    """Followed from each of its starts: most of them end beside the right one."""
    rough = problem.misfit(effect, GLANCE)
    springs = rough.mean[: rough.split[1]]
    starts = [np.concatenate([springs, psi]) for psi in effect.starts()]
    near = [approached(rough, [x], LOG_STEPS) for x in starts]
    return _best([settle(problem, f, CLOSE) for f in near])


def _with(structure: Structure, found: Fit) -> Structure:
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
