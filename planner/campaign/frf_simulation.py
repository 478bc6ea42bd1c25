"""The simulation by which a campaign predicts FRFs: the identified one, and what it may lack.

What identifies the simulation between hits does so in little time, its structure as stated but for
few springs. Here all poses' FRFs are fitted to the end, the measuring chain beside the simulation,
and the structure is widened where they speak for it: the base shifts and turns, links bend,
something hangs on a link.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.campaign.chain_misfit import CHAIN
from planner.campaign.frf_posterior import FrfPosterior, fitted, fitted_afresh
from planner.campaign.learned import Learned
from planner.campaign.widened_structure import widened
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.effects.local_resonator import LocalResonator
from planner.diagnosis.linear.fit import Fit, glance
from planner.diagnosis.linear.problem import Problem
from planner.dynamics.gradient import laplace
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.identification.extended_structure import ExtendedModel
from planner.identification.measured_frfs import common_band
from planner.identification.truncated_decay import cut_off

# χ² per value above which something that swings on a link is looked for: that takes long.
SWINGS = 1.0
FOLLOWED, TRIED_STEPS = 3, 10  # places of a resonator that are tried, and in how many steps


def learned_simulation(
    learned: Learned,
    stated: ExtendedModel,
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


def _resonant(base: FrfPosterior) -> list[FrfPosterior]:
    """With something that swings on a link: the likeliest places, followed to the end."""
    problem, misfit, x = base.problem, base.objective.misfit, base.z[:-CHAIN]
    warm = Fit(Effect(""), misfit, x, misfit.by_pose(x))
    rough = [glance(problem, e, warm) for e in LocalResonator.everywhere(problem.simulation)]
    rough.sort(key=lambda f: f.per_value)
    tried = [fitted(problem, f.effect, f.x, TRIED_STEPS) for f in rough[:FOLLOWED]]
    best = min(tried, key=lambda f: f.at.value)
    return [fitted(problem, best.effect, best.z)]
