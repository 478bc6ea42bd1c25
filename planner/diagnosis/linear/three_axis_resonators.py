"""Something that swings in all three directions: from what a fit says of one, or from nothing."""

from collections.abc import Sequence
from functools import partial
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from planner.diagnosis.effects.combined import Both, together
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.effects.hanging_resonator import WAYS, HangingResonator
from planner.diagnosis.effects.local_resonator import LocalResonator
from planner.diagnosis.linear.evidence import best_of
from planner.diagnosis.linear.fit import Fit, approached, points, settle
from planner.diagnosis.linear.objective import Misfit
from planner.diagnosis.linear.problem import CLOSE, COARSE, Problem
from planner.fit.held_out import farthest_first
from planner.inference.parallel import side_by_side

FIRST, STEPS = 10, 24  # of all starts, and of the best
# From nothing, at a few poses: steps of all starts, how many are followed by how many steps more;
# at how many links frequencies jump, how often, and how many fits are followed with all lines.
FEW, BEGUN, KEPT, FOLLOWED = 5, 3, 8, 12
PLACES, JUMPS, CLOSER = 2, 2, 2
RATIOS = tuple(product((0.5, 1.1, 2.2), repeat=2))  # of the other frequencies to the known one


def three_axis_resonators(problem: Problem, finalists: Sequence[Fit]) -> tuple[Fit, ...]:
    """Rough fits with a resonator on three springs: of the best that has one, and has it alone."""
    swing = [f for f in finalists if any(isinstance(p, LocalResonator) for p in f.effect.parts())]
    alone = [f for f in swing if len(f.effect.parts()) == 1]
    best = {id(f): f for f in (*best_of(swing, 1), *best_of(alone, 1))}
    way = [one for found in best.values() for one in _ways(found)]
    return tuple(side_by_side(partial(_loosened, problem), way))


def hung(problem: Problem, effects: Sequence[Effect]) -> tuple[Fit, ...]:
    """Fits with a resonator on three springs at the likeliest links, from many starts at each.

    A heavy one moves all modes at once: no fit with one direction leads to it.
    """
    sliding = [e for e in effects if isinstance(e, LocalResonator)]
    few = problem.at(farthest_first(problem.q)[:FEW].tolist())
    rough = side_by_side(partial(_hung, few), [HangingResonator.of(e) for e in sliding])
    return tuple(side_by_side(partial(jumped, problem, ways=WAYS), _best(rough, PLACES)))


def _hung(few: Problem, effect: HangingResonator) -> Fit:
    """The best of a link's starts, roughly."""
    rough = few.misfit(effect, COARSE)
    usual = rough.mean[: rough.split[1]]
    return begun(rough, [np.concatenate([usual, psi]) for psi in effect.starts()])


def begun(rough: Misfit, starts: Sequence[np.ndarray]) -> Fit:
    """The best of many starts, roughly."""
    tried = [approached(rough, [x], BEGUN) for x in starts]
    return _best([approached(rough, [f.x], FOLLOWED) for f in _best(tried, KEPT)], 1)[0]


def jumped(problem: Problem, rough: Fit, ways: Sequence[str], jumps: int = JUMPS) -> Fit:
    """Where a frequency that is the wrong one jumps to another, then with all that is free.

    `ways` names those that may, up to so many times.
    """
    effect, misfit = rough.effect, rough.misfit
    assert isinstance(effect, HangingResonator)
    of = f" of {effect.name} at {effect.at}"
    there = [misfit.names.index(name + of) for name in ways]
    kept = [rough]
    for _ in range(jumps):
        x, before = kept[0].x, kept[0]
        starts = [_with(x, i, f) for i in there for f in effect.log_frequencies]
        kept = _best([*kept, *(approached(misfit, [one], FOLLOWED) for one in starts)], CLOSER)
        if kept[0] is before:
            break
    return _best([settle(problem, f, CLOSE, STEPS) for f in kept], 1)[0]


def _with(x: np.ndarray, i: int, value: float) -> np.ndarray:
    out = x.copy()
    out[i] = value
    return out


def _best(fits: Sequence[Fit], most: int) -> list[Fit]:
    return sorted(fits, key=lambda f: f.value)[:most]


def _ways(found: Fit) -> list[tuple[Fit, LocalResonator, Effect]]:
    """Each of its resonators, and the effects with it on three springs."""
    made = []
    for part in found.effect.parts():
        if isinstance(part, LocalResonator) and not isinstance(part, HangingResonator):
            rest = [p for p in found.effect.parts() if p is not part]
            free = HangingResonator.of(part)
            effect = together(Both.of(*rest), free) if rest else free
            if effect is not None:
                made.append((found, part, effect))
    return made


def turned_to(way: np.ndarray) -> np.ndarray:
    """Rotation vector (rad) that turns x to a way (3,); 0 for one that no fit has given yet."""
    if not way.any():
        return np.zeros(3)
    return Rotation.align_vectors(way[None], [[1.0, 0.0, 0.0]])[0].as_rotvec()


def _loosened(problem: Problem, one: tuple[Fit, LocalResonator, Effect]) -> Fit:
    found, part, effect = one
    misfit, known = problem.misfit(effect, CLOSE), found.named()
    of = f"of {part.name} at {part.at}"
    way = np.array([known[f"direction_{a} {of}"] for a in "xyz"])
    turn = turned_to(way)
    starts = []
    for ratios in RATIOS:
        x = points(misfit, found)[0]
        for a, value in zip("xyz", turn, strict=True):
            x[misfit.names.index(f"turn_{a} {of}")] = value
        for name, ratio in zip(("frequency_2", "frequency_3"), ratios, strict=True):
            x[misfit.names.index(f"{name} {of}")] = known[f"frequency {of}"] + np.log(ratio)
        starts.append(x)
    rough = [approached(misfit, [x], FIRST) for x in starts if misfit.possible(x)]
    best = min(rough, key=lambda f: f.per_value, default=None)
    return approached(misfit, starts[:1] if best is None else [best.x], STEPS)
