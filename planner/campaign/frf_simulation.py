"""The simulation by which a campaign predicts FRFs: the identified one, and what it may lack.

What identifies the simulation between hits takes hits and measuring chain for exact, in little
time. Here both are part of what is fitted, and the structure is widened where the FRFs speak for
it: the base shifts and turns, links bend, something hangs on a link.
"""

from collections.abc import Sequence
from dataclasses import replace

import msgspec
import numpy as np

from planner.campaign.chain_misfit import CHAIN
from planner.campaign.frf_posterior import FrfPosterior, fitted, fitted_afresh
from planner.campaign.low_fidelity import Learned
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.effects.extra_compliance import across, triple
from planner.diagnosis.effects.local_resonator import LocalResonator
from planner.diagnosis.effects.places import movable
from planner.diagnosis.linear.fit import Fit, glance
from planner.diagnosis.linear.problem import Problem
from planner.dynamics.gradient import laplace
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.identification.extended_structure import (
    DAMPING_S,
    FLOOR,
    STIFFNESS,
    Structure,
    extended,
)
from planner.identification.measured_frfs import common_band
from planner.identification.parameters import place_name
from planner.identification.truncated_decay import cut_off
from planner.robot.config import Compliance

Spring = tuple[Compliance, dict[str, tuple[float, float]]]  # and its priors' bounds, by name

# χ² per value above which something that swings on a link is looked for: that takes long.
SWINGS = 1.0
SHORT = 0.1  # of the longest link: what is shorter does not bend
BEND = 0.3  # of the joint's stiffness: the scale of a link's, whose prior is STIFFNESS times this
FOLLOWED, TRIED_STEPS = 3, 10  # places of a resonator that are tried, and in how many steps


def learned_simulation(
    learned: Learned,
    stated: Structure,
    frfs: Sequence[Frf],
    q: np.ndarray,
    band_hz: tuple[float, float],
) -> FrfPosterior | None:
    """From what was identified of FRFs at q (n, dof) in rad, to what explains them best.

    Beside it all structures begin anew from what is `stated`: what was identified may have found a
    place where wrong parts make up for each other. By the evidence of each, χ² counting as the
    closest one's says. None where none of them can be: the robot would not stand.
    """
    first, structure = learned.identified, learned.structure
    whole = completed(frfs, first.simulation, q)
    band = common_band(frfs, band_hz)
    problem = Problem(whole, q, structure.simulation, band, structure.priors)
    identified = fitted(problem, Effect(""), first.mean)
    wider = [widened(stated)]
    if structure.swinging:
        wider.append(widened(structure))
    found = [identified]
    for wide in wider:
        problem = Problem(whole, q, wide.simulation, band, wide.priors)
        found.append(fitted_afresh(problem, Effect("")))
    if min(f.misfit for f in found) > SWINGS and np.isfinite(identified.misfit):
        found += _resonant(identified)
    found = [f for f in found if np.isfinite(f.misfit)]
    if not found:
        return None
    temper = min(f.temper for f in found)
    return max(found, key=lambda f: f.log_evidence(temper))


def completed(frfs: Sequence[Frf], simulation: Simulation, q: np.ndarray) -> tuple[Frf, ...]:
    """FRFs with the decays that the ends of their records cut off, as a simulation has them."""
    out = []
    for frf, row in zip(frfs, q, strict=True):
        if not np.isfinite(frf.tail_s):
            out.append(frf)
            continue
        above = frf.frequency_hz > 0
        s = laplace(frf.frequency_hz[above], frf.exponential_rate_1_s)
        lost = cut_off(simulation.poles(row[None]), s, np.array([frf.tail_s]))[0]
        values = frf.accelerance.copy()
        values[..., above] += lost
        out.append(replace(frf, accelerance=values, tail_s=float("inf")))
    return tuple(out)


def widened(structure: Structure) -> Structure:
    """Beside tilts of joints and floor the base's turn and shifts, and links that bend."""
    if not structure.added:
        structure = extended(structure.simulation, structure.priors)
    robot = structure.simulation.robot
    stated = robot.config.compliance[: len(robot.config.compliance) - structure.added]
    turning = [block for block in stated if not block.slide]
    stiffest = max((b.stiffness for b in turning), default=max(robot.turning_stiffness()))
    ways = _links(structure.simulation)
    longest = max((float(np.linalg.norm(way)) for _, _, way in ways), default=0.0) or robot.reach_m
    listed = {place_name(block) for block in robot.config.compliance}
    springs = [_spring(FLOOR, np.eye(3)[2], stiffest)]
    springs += [_spring(FLOOR, a, stiffest / (2 * longest) ** 2, slide=True) for a in np.eye(3)]
    for link, joint, way in ways:
        length = np.linalg.norm(way)
        if length > SHORT * longest:
            own = [b.stiffness for b in stated if b.joint == joint and not robot.slides_along(b)]
            own = own or [stiffest]
            axes = (*across(way / length), way / length)
            springs += [_spring(link, axis, BEND * max(own)) for axis in axes]
    springs = [(b, limits) for b, limits in springs if place_name(b) not in listed]
    movables = movable(structure.simulation, [b for b, _ in springs])
    springs = [(b, limits) for b, limits in springs if b in movables]
    bounds = dict(structure.priors.bounds)
    for _, limits in springs:
        bounds |= limits
    added = tuple(block for block, _ in springs)
    config = msgspec.structs.replace(robot.config, compliance=(*robot.config.compliance, *added))
    simulation = Simulation(replace(robot, config=config))
    return Structure(
        simulation, replace(structure.priors, bounds=bounds), structure.added + len(added)
    )


def _links(simulation: Simulation) -> list[tuple[str, str, np.ndarray]]:
    """Links that carry a joint: name, the joint that moves it, and the way (3,) to the next."""
    robot, found = simulation.robot, []
    for joint in robot.joint_names:
        link = robot.link_of(joint)
        carried = robot.carries(link)
        if carried is not None and link not in robot.joint_names:
            way = np.array(robot.model.jointPlacements[carried[1]].translation)
            found.append((link, joint, way))
    return found


def _spring(joint: str, axis: np.ndarray, scale: float, slide: bool = False) -> Spring:
    low, high = (scale * factor for factor in STIFFNESS)
    least, most = low * DAMPING_S[0], high * DAMPING_S[1]
    medians = float(np.sqrt(low * high)), float(np.sqrt(least * most))
    block = Compliance(joint, triple(axis), *medians, slide=slide)
    place = place_name(block)
    return block, {f"stiffness of {place}": (low, high), f"damping of {place}": (least, most)}


def _resonant(base: FrfPosterior) -> list[FrfPosterior]:
    """With something that swings on a link: the likeliest places, followed to the end."""
    problem, misfit, x = base.problem, base.objective.misfit, base.z[:-CHAIN]
    warm = Fit(Effect(""), misfit, x, misfit.by_pose(x))
    rough = [glance(problem, e, warm) for e in LocalResonator.everywhere(problem.simulation)]
    rough.sort(key=lambda f: f.per_value)
    tried = [fitted(problem, f.effect, f.x, TRIED_STEPS) for f in rough[:FOLLOWED]]
    best = min(tried, key=lambda f: f.at.value)
    return [fitted(problem, best.effect, best.z)]
