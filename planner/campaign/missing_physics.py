"""What robot.toml leaves out and recordings speak for, when a campaign's simulation learns."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from planner.errors import InputError
from planner.identification.extended_structure import added_softer, extended

if TYPE_CHECKING:
    from planner.campaign.low_fidelity import Learned, Lesson

BEST = 0.95  # misfit below which no springs that are added can bring it
# By how much softer than expected springs that are added begin, one after the other while nothing
# fits. Of twelve generated campaigns three ended beside the best minimum from the first alone.
SOFTER = 1.0, 7.0, 0.15
SAME = 0.01  # relative difference of the misfits of two starts that met: no more are tried
# Of a suspect misfit, how much makes one look for a mass that swings; of that, how much makes one
# look at length; and by what a mass must divide the misfit, which it must bring below what makes
# one look: one that is not there has a mode too, which no hit shows, so that modes would be
# miscounted. Of generated campaigns masses that were there divided it by 3 and more, to 2.4 or
# less; one that took the place of a link that bends left 6.8.
SWINGS, FAR_OFF, PAYS = 1.25, 5.0, 2.0
HELPS = 0.8  # share of the misfit: where a mass leaves less, springs are tried beside it


def with_springs(stated: "Learned", lesson: "Lesson") -> "Learned":
    """With springs that robot.toml does not state, where the recordings speak for them.

    That is where χ² falls by more than ln n for each of their parameters (Schwarz 1978).
    """
    structure = extended(stated.structure.simulation, stated.structure.priors)
    structure = replace(structure, swinging=stated.structure.swinging)
    first = stated.identified
    penalty = 2 * structure.added * np.log(first.values)
    if first.values * (first.misfit - BEST) < penalty:
        return stated
    found = [stated]
    warm, starts = (first, SOFTER[:1]) if stated.fits else (None, SOFTER)
    for softer in starts if lesson.tolerances is not None else SOFTER[:1]:
        try:
            found.append(lesson.identified(structure, warm, added_softer(structure, softer)))
        except InputError:  # a search that ended where the robot would not stand
            continue
        last = [one.identified.misfit for one in found[-2:]]
        met = len(found) > 2 and abs(np.log(last[1] / last[0])) < SAME
        if met or found[-1].fits:
            break
    wider = min(found, key=lambda one: one.identified.misfit)
    gain = first.values * (first.misfit - wider.identified.misfit)
    return wider if gain > penalty else stated


def with_swinging_mass(stated: "Learned", learned: "Learned", lesson: "Lesson") -> "Learned":
    """With a mass that swings on a link, beside what is stated and what else may be missing.

    That is looked for where nothing else comes near; not where hits count as exact, as campaigns
    that began so took them. What swings outside the band is no such mass.
    """
    if learned.identified.misfit <= SWINGS * learned.suspect or lesson.tolerances is None:
        return learned
    from planner.campaign.swinging_mass import swinging  # of the diagnosis: half a second

    found, enough = [learned], SWINGS * learned.suspect
    beside = stated if stated.identified.misfit < PAYS * learned.identified.misfit else learned
    for everywhere in (False, True):
        best = min(one.identified.misfit for one in found)
        if best <= (FAR_OFF if everywhere else 1.0) * enough:
            break
        structure, starts = swinging(
            beside.structure, beside.identified, lesson.frfs, lesson.q, lesson.band_hz, everywhere
        )
        mass = structure.simulation.robot.config.resonator[-1]
        if not lesson.band_hz[0] < mass.frequency_hz < lesson.band_hz[1]:
            continue
        try:
            found.append(lesson.identified(structure, starts=starts))
        except InputError:
            continue
        if enough < found[-1].identified.misfit < HELPS * learned.identified.misfit:
            found.append(with_springs(found[-1], lesson))
    best = min(found, key=lambda one: one.identified.misfit)
    needed = min(enough, learned.identified.misfit / PAYS)
    return best if best.identified.misfit < needed else learned
