"""What robot.toml leaves out and recordings speak for, when a campaign's simulation learns.

Structures are compared by their evidence. Each is fitted from afresh: from springs that were bent
to fit without it, a wider one ends beside its minimum.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from planner.campaign.learned import Learned, likeliest
from planner.diagnosis.thresholds import LOSS_FACTOR_FACTOR
from planner.errors import InputError
from planner.identification.extended_structure import ExtendedModel, added_softer, extended
from planner.identification.result import Identification

if TYPE_CHECKING:
    from planner.campaign.low_fidelity import Lesson

# Misfit below which nothing that is added can bring it, and from which links may bend too.
BEST, WIDER = 0.95, 1.0
# By how much softer than expected springs that are added begin, one after the other while nothing
# fits. Of twelve generated campaigns three ended beside the best minimum from the first alone.
SOFTER = 1.0, 7.0, 0.15
SAME = 0.01  # relative difference of the misfits of two starts that met: no more are tried
# Misfit from which a mass that swings is sought, and share of what exceeds the noise that it must
# explain: one that is not there has a mode too, which no hit shows, so that modes would be
# miscounted. Of generated campaigns masses that were there explained 0.4 to 0.9, others 0.01.
SWINGS, PART = 1.5, 0.33
# Prior sds from where robot.toml states it, beyond which a spring is begun there once more. Chosen
# on one generated campaign: its last joint had become 70 times too soft, with a mode at 18 Hz that
# no hit showed; the others made up for it.
STRAYED = 2.0
HELPS = 0.8  # share of the misfit: where a mass leaves less, springs are tried beside it


def with_springs(stated: Learned, lesson: "Lesson") -> Learned:
    """With springs that robot.toml does not state, where the recordings speak for them."""
    first = stated.identified
    structure = extended(stated.structure.simulation, stated.structure.priors)
    structure = replace(structure, swinging=stated.structure.swinging)
    if _at_noise(first, 2 * structure.added):
        return stated
    exact = lesson.tolerances is None
    starts = SOFTER[:1] if stated.fits or exact else SOFTER
    found = [stated, *_from(structure, starts, lesson)]
    if not exact and min(one.identified.misfit for one in found) > WIDER:
        from planner.campaign.widened_structure import widened  # of the diagnosis: half a second

        found += _from(widened(stated.structure), SOFTER[:1], lesson)
    return likeliest(found)


def _at_noise(found: Identification, more: int) -> bool:
    """Whether not even all of what is left is worth so many more parameters (Schwarz 1978)."""
    return found.values * (found.misfit - BEST) < more * np.log(found.values)


def _from(structure: ExtendedModel, starts: Sequence[float], lesson: "Lesson") -> list[Learned]:
    """Identified from springs that begin softer or stiffer, until two met or one fits."""
    found: list[Learned] = []
    for softer in starts:
        try:
            found.append(lesson.identified(structure, starts=added_softer(structure, softer)))
        except InputError:  # a search that ended where the robot would not stand
            continue
        last = [one.identified.misfit for one in found[-2:]]
        met = len(found) > 1 and abs(np.log(last[1] / last[0])) < SAME
        if met or found[-1].fits:
            break
    return found


def with_loss_factors(stated: Learned, lesson: "Lesson") -> Learned:
    """With a loss factor beside each damper, where dampers alone do not explain the recordings.

    How gears and bearings dissipate no data sheet says; springs that were added would imitate it.
    Only where nothing else is missing: from loss factors that imitate something no fit comes back.
    Not where hits count as exact, as campaigns that began so took them.
    """
    dampers = sum(e.kind == "damping" for e in stated.identified.estimates)
    if lesson.tolerances is None or _at_noise(stated.identified, dampers):
        return stated
    from planner.diagnosis.effects.structural_damping import partly_structural  # as below

    structure = stated.structure
    simulation = partly_structural(structure.simulation)
    priors = replace(structure.priors, loss_factor_factor=LOSS_FACTOR_FACTOR)
    lossy = lesson.glanced(replace(structure, simulation=simulation, priors=priors))
    return likeliest([stated, lossy]) if lossy.fits else stated


def with_strayed_springs_again(learned: Learned, lesson: "Lesson") -> Learned:
    """Begun once more with each stated spring that strayed where it is stated, the others as found.

    Where hits hardly move a joint, others can stand for it and it for a mode that is not there.
    Not where hits count as exact, as campaigns that began so took them.
    """
    if lesson.tolerances is None:
        return learned
    found, ends = learned.identified, [learned]
    for spring in found.estimates:
        away = abs(np.log(spring.value / spring.prior_median)) / spring.prior_log_sd
        stated = spring.kind == "stiffness" and max(spring.blocks) < learned.stated
        if not stated or away < STRAYED:
            continue
        begun = tuple(
            replace(e, value=e.prior_median) if e is spring else e for e in found.estimates
        )
        warm = replace(found, estimates=begun, misfit=np.inf)  # wherever that leads
        try:
            ends.append(lesson.identified(learned.structure, warm=warm))
        except InputError:  # as in `_from`
            continue
    return likeliest(ends)


def with_swinging_mass(stated: Learned, learned: Learned, lesson: "Lesson") -> Learned:
    """With a mass that swings on a link, beside what is stated and what else may be missing.

    Not where hits count as exact, as campaigns that began so took them. What swings outside the
    band is no such mass.
    """
    if learned.identified.misfit <= SWINGS or lesson.tolerances is None:
        return learned
    from planner.campaign.swinging_mass import swinging  # of the diagnosis: half a second

    structure, starts = swinging(
        stated.structure, stated.identified, lesson.frfs, lesson.q, lesson.band_hz
    )
    mass = structure.simulation.robot.config.resonator[-1]
    if not lesson.band_hz[0] < mass.frequency_hz < lesson.band_hz[1]:
        return learned
    try:
        swings = lesson.identified(structure, starts=starts)
    except InputError:
        return learned
    if SWINGS < swings.identified.misfit < HELPS * learned.identified.misfit:
        swings = with_springs(swings, lesson)
    left = swings.identified.misfit - 1
    if left > (1 - PART) * (learned.identified.misfit - 1):
        return learned
    return likeliest([learned, swings])
