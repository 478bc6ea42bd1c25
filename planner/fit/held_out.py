"""Identification that is judged at poses it has not seen, before all of them are used."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Priors
from planner.errors import InputError
from planner.fit.identified_robot import IdentifiedRobot
from planner.fit.identify import identify
from planner.frf.frf import Frf
from planner.measurement.agreement import Similarity, fit_similarity

EVERY = 4  # one pose of so many is set aside
FEWEST = 3  # poses of which one can be spared


@dataclass(frozen=True, eq=False)
class JudgedIdentification:
    """Final identification on all poses, and what `trial`, which lacked some, made of these.

    `before` and `after` it, at all poses. `held_out` holds the indices of those that the trial
    lacked; where there are none, trial and similarities are None.
    """

    final: IdentifiedRobot
    trial: IdentifiedRobot | None
    before: Similarity
    after: Similarity
    held_out: tuple[int, ...]
    held_out_before: Similarity | None
    held_out_after: Similarity | None


def set_aside(q: np.ndarray, count: int | None = None) -> tuple[int, ...]:
    """Indices of the poses q (n, dof) to hold out, spread like all of them.

    Poses are ordered farthest first, beginning with the most central, and evenly many of this
    order taken: one of EVERY unless `count` says how many, none of fewer than FEWEST. Raises
    InputError where `count` leaves no pose to fit.
    """
    n = len(q)
    if count is None:
        count = 0 if n < FEWEST else max(1, n // EVERY)
    if not 0 <= count < n:
        raise InputError(f"--held-out {count} leaves none of the {n} poses to fit; give fewer.")
    if count == 0:
        return ()
    order = farthest_first(q)
    return tuple(sorted(order[((np.arange(count) + 1) * n) // count - 1].tolist()))


def farthest_first(q: np.ndarray) -> np.ndarray:
    """(n,) indices: each pose is the farthest from all before it."""
    span = np.ptp(q, axis=0)
    x = q / np.where(span > 0, span, 1.0)
    order = [int(np.argmin(np.linalg.norm(x - x.mean(axis=0), axis=1)))]
    nearest = np.linalg.norm(x - x[order[0]], axis=1)
    while len(order) < len(x):
        nearest[order] = -1.0
        order.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(x - x[order[-1]], axis=1))
    return np.array(order)


def identify_judged(
    frfs: Sequence[Frf],
    q: np.ndarray,
    simulation: Simulation,
    priors: Priors,
    held_out: int | None = None,
    shown: Sequence[Frf] | None = None,
    **options: Any,
) -> JudgedIdentification:
    """Identify without the held-out poses, judge there, then go on with all poses.

    Arguments as `identify`, whose other options are passed on; `held_out` is how many. Judged is
    by the FRFs `shown` of the same poses, where they are others than those that are fitted.
    """
    aside, band = set_aside(q, held_out), options.get("band_hz")
    shown = frfs if shown is None else shown
    before = fit_similarity(simulation, shown, q, band)
    trial, warm, judged = None, None, (None, None)
    if aside:
        kept = [i for i in range(len(q)) if i not in aside]
        trial = identify([frfs[i] for i in kept], q[kept], simulation, priors, **options)
        warm = trial.posterior.found.remembered
        there = [shown[i] for i in aside], q[list(aside)], band
        found = trial.identified.simulation
        judged = fit_similarity(simulation, *there), fit_similarity(found, *there)
    final = identify(frfs, q, simulation, priors, warm=warm, **options)
    after = fit_similarity(final.identified.simulation, shown, q, band)
    return JudgedIdentification(final, trial, before, after, aside, *judged)
