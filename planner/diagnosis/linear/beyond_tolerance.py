"""Explanations that need a measuring chain beyond its tolerance, with an artefact beside them.

What a chain may err by is open in every fit. Where one needs a number of it far from 0, something
is wrong with the chain: the artefact that says what competes then.
"""

from collections.abc import Sequence

import numpy as np

from planner.diagnosis.effects.combined import together
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.discrepancy import Worth
from planner.diagnosis.linear.fit import LAST_STEPS, Fit, carried_on
from planner.diagnosis.linear.problem import Problem
from planner.measurement.nuisances import OpenNumbers

BEYOND = 3.0  # sds of a tolerance: of 14 numbers one is there by chance once in 26 diagnoses


def with_artefacts(
    problem: Problem, whole: Fit, worth: Worth, effects: Sequence[Effect]
) -> list[Fit]:
    """Fits of each artefact among `effects` beside a `whole`; none where its chain is as any."""
    numbers = OpenNumbers.of(whole.misfit.measured.accelerance)
    chain = numbers.shared(worth.missed.mean(axis=0))
    if whole.misfit.tolerances is None or np.abs(chain).max() < BEYOND:
        return []
    artefacts = [e for e in effects if e.artefact and e.quantities]
    if whole.effect.at:
        artefacts = [pair for e in artefacts if (pair := together(whole.effect, e)) is not None]
    return [carried_on(problem, whole, e, LAST_STEPS) for e in artefacts]
