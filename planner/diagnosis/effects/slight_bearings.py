"""Bearings that give a little across their joints' axes, as those of every robot do.

No robot.toml states them and nothing is wrong with them, yet they move a robot's FRFs by a percent,
those of an arm that lies across its axes by ten. Left out, inertias and springs are bent to follow
them. So every candidate of a diagnosis has them, in a range in which no bearing is worth a word.
"""

from dataclasses import replace

import msgspec

from planner.diagnosis.effects.places import damping_time, joint_of, movable, stiffest, with_blocks
from planner.diagnosis.effects.transverse_compliance import TransverseCompliance
from planner.diagnosis.thresholds import FURTHER_DAMPING_FACTOR, SLIGHTLY_ACROSS
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Priors, place_name
from planner.errors import InputError
from planner.robot.config import Compliance

BEARING = "bearing of "


def is_slight(block: Compliance) -> bool:
    """Whether an elastic degree of freedom is one of `with_bearings`."""
    return block.tie.startswith(BEARING)


def with_bearings(simulation: Simulation, priors: Priors) -> tuple[Simulation, Priors]:
    """The simulation with tilts at each joint that has none, and priors with theirs.

    Their stiffness is log-uniform in SLIGHTLY_ACROSS times that of the joint; they damp as the
    median of the robot's springs does, which is not fitted.
    """
    blocks = tuple(_blocks(simulation))
    built = with_blocks(simulation, blocks)
    try:
        _ = built.elastic
    except InputError:  # a body without inertia, moved by what is there already
        blocks = movable(simulation, blocks)
        built = with_blocks(simulation, blocks)
    spread = (SLIGHTLY_ACROSS[1] / SLIGHTLY_ACROSS[0]) ** 0.5
    bounds = {f"stiffness of {b.tie}": (b.stiffness / spread, b.stiffness * spread) for b in blocks}
    firm = priors.firm | bounds.keys()  # beyond, it is an effect
    further = FURTHER_DAMPING_FACTOR * spread
    for b in blocks:
        bounds[f"damping of {b.tie}"] = b.damping / further, b.damping * further
    return built, replace(priors, bounds={**priors.bounds, **bounds}, firm=firm)


def _blocks(simulation: Simulation) -> list[Compliance]:
    """Of each tilt, at the prior's median."""
    time, made = damping_time(simulation), []
    for effect in TransverseCompliance.everywhere(simulation):
        own = stiffest(simulation, joint_of(simulation, effect.at))
        stiffness = float(own * (SLIGHTLY_ACROSS[0] * SLIGHTLY_ACROSS[1]) ** 0.5)
        for block in effect.blocks(time):
            values = {"stiffness": stiffness, "damping": time * stiffness}
            tie = BEARING + place_name(block)
            made.append(msgspec.structs.replace(block, **values, tie=tie))
    return made
