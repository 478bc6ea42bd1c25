"""The screen for drift: does time explain what the pose does not?

A pose that was visited twice tells by itself; otherwise the simulation, refitted together with the
course, takes what belongs to the pose.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from planner.dataset.dataset import Dataset
from planner.diagnosis.effects.changed_load import ChangedLoad
from planner.diagnosis.effects.drift import BEND, Drift, change_of
from planner.diagnosis.effects.effect import Effect, Quantity
from planner.diagnosis.finding import Finding
from planner.diagnosis.laws.level_refits import base
from planner.diagnosis.laws.open_misses import OpenMisses, Pair, lines_of
from planner.diagnosis.linear.drift_fit import DriftFits, DriftProblem, problem_of
from planner.diagnosis.linear.fit import Fit, carried_on, fit, glance, promise, settle
from planner.diagnosis.linear.problem import tolerances_of
from planner.diagnosis.thresholds import (
    ALIKE,
    AT_NOISE,
    CLEAR,
    DRIFT_BY_TIME,
    DRIFT_COURSE,
    DRIFT_CRUDE,
    DRIFT_EVIDENCE,
    DRIFT_GAINS,
    DRIFT_KNOWN,
    DRIFT_LEAST,
    DRIFT_LOG_SD,
    DRIFT_MOVED,
    DRIFT_ORDER,
    DRIFT_STILL,
    DRIFT_SWEPT,
)
from planner.dynamics.simulation import Simulation
from planner.inference.evidence import temper
from planner.inference.parallel import side_by_side

GRADUAL = Drift.of_all()
STEP_VISITS = 6  # from which on a step can be told: there are 25 ways to part visits in two
LIGHTEST = 0.05  # of a middling link's mass, that a link counts as having: a flange may have none
ORDERS, ORDERS_DRAWN = 24, 300  # orders of the visits that time's is held against


def fits(recorded: Dataset, nominal: Simulation) -> tuple[Fit, ...]:
    """The refitted simulation without drift, and with it: gradual, at once, of single joints."""
    problem = problem_of(recorded, nominal, as_built=True)
    plain = fit(problem, Effect(""))
    courses = side_by_side(partial(_followed, problem, plain), (_gradual, _at_once))
    single = side_by_side(partial(_of_joints, problem, plain), courses)
    return plain, *courses, *(found for kind in single for found in kind)


Kind = Callable[[DriftProblem, Fit], Fit]


def _followed(problem: DriftProblem, plain: Fit, kind: Kind) -> Fit:
    return kind(problem, plain)


def _gradual(problem: DriftProblem, plain: Fit) -> Fit:
    return fit(problem, GRADUAL, [plain])


def _at_once(problem: DriftProblem, plain: Fit) -> Fit:
    free = fit(problem, _each_visit(problem), [plain])
    return fit(problem, Drift.at_once(_since(free, problem.order)), [free])


def _each_visit(problem: DriftProblem) -> Drift:
    """Each visit after the first with a change of its own."""
    count = len(problem.order) - 1
    each = tuple(Quantity(f"visit_{i + 2}", "1", 0.0, DRIFT_LOG_SD) for i in range(count))
    return Drift("campaign", each, "free")


def _of_joints(problem: DriftProblem, plain: Fit, course: Fit) -> tuple[Fit, ...]:
    """With drift of those joints that move surely; none where even so little is followed."""
    assert isinstance(course.effect, Drift)
    each = course.effect.of_each(problem.simulation)
    if not each.joints:  # none has a spring about its own axis
        return ()
    every = fit(problem, each, [plain])
    assert isinstance(every.effect, Drift)
    if every.per_value > DRIFT_CRUDE:
        return ()
    values = every.parameters(temper(every.per_value, ALIKE))
    told = {j: values[change_of(j)] for j in every.effect.joints}
    moved = [j for j, change in told.items() if _sure(change) and change[1] < DRIFT_KNOWN]
    return (fit(problem, every.effect.of_joints(moved), [every]),) if moved else ()


def _sure(change: tuple[float, float, str]) -> bool:
    value, sd, _ = change
    return abs(value) > DRIFT_MOVED * sd


def _since(free: Fit, order: np.ndarray) -> float:
    """Where the visits' own ψ fall apart into two groups, in this order (n,) of them.

    A single visit that differs from all others may differ by its pose.
    """
    psi = np.append(0.0, free.x[free.misfit.split[1] :])[np.argsort(order)]
    ways = range(2, len(psi) - 1)
    spread = [psi[:i].var() * i + psi[i:].var() * (len(psi) - i) for i in ways]
    return float(np.sort(order)[ways[int(np.argmin(spread))]])


def screen(recorded: Dataset, nominal: Simulation) -> tuple[Finding, ...]:
    """`drift`, where the recordings change with time and not with the pose alone.

    It takes most of the misfit, or all that there is beyond noise: then physics that goes with the
    pose may do so as well, and has to be weighed against it.
    """
    recorded = recorded.most_heard
    if len(recorded.visits) < 4 or _unchanged(recorded, nominal):
        return ()
    plain, *found = fits(recorded, nominal)
    if returned(recorded) is None and len(recorded.visits) < STEP_VISITS:
        found = [f for f in found if isinstance(f.effect, Drift) and f.effect.kind != "step"]
    problem = problem_of(recorded, nominal, as_built=True)
    poses = [visit.pose for visit in recorded.visits]
    best = _or_load(problem, plain, settle(problem, _likeliest(found)), poses)
    # A fit that drift led out of a wrong minimum gains by that alone: it does without drift too.
    back = carried_on(problem, best, Effect(""))
    plain = min((plain, back), key=lambda f: f.per_value)
    finding = evaluate(plain, best)
    change = finding.parameters["change"]
    there = _sure(change) and finding.log_evidence > CLEAR
    slight = finding.log_evidence < DRIFT_EVIDENCE or abs(change[0]) < DRIFT_LEAST
    if finding.gain < DRIFT_GAINS and (slight or best.per_value > AT_NOISE):
        return ()
    if not there or (returned(recorded) is None and not _by_time(problem, plain, best)):
        return ()
    return (replace(finding, drift_fits=DriftFits(problem, plain, best)),)


def _or_load(problem: DriftProblem, plain: Fit, best: Fit, poses: Sequence[str]) -> Fit:
    """A step of springs, or the load of the last link that changed then, if that tells more.

    Springs that are all softer move modes as a heavier tool does. Where nothing fits closely, which
    of both it is can't be told.
    """
    if not isinstance(best.effect, Drift) or best.effect.kind != "step":
        return best
    after = problem.order >= best.effect.since
    first = int(np.argmin(np.where(after, problem.order, np.inf)))
    load = ChangedLoad.of_last_link(problem.simulation, after, poses[first])
    if load is None:
        return best
    loaded = settle(problem, fit(problem, load, [plain, best]))
    if loaded.per_value > DRIFT_CRUDE:
        return best
    t = temper(min(best.per_value, loaded.per_value), ALIKE)
    return loaded if loaded.log_evidence(t) > best.log_evidence(t) + CLEAR else best


def _by_time(problem: DriftProblem, plain: Fit, best: Fit) -> bool:
    """Whether the order in time explains clearly more than other orders of the visits would.

    Where no pose was returned to, visits differ in pose as they do in time, and a course through
    a few of them takes a part of anything that goes with the pose.
    """
    assert isinstance(best.effect, Drift | ChangedLoad)
    orders = [problem.order, *_other_orders(problem.order)]
    # Where much is left, the way to a fit with drift is longer than a few steps, and so is that to
    # a load: then roughly, on fewer lines and with inertias as they are.
    near = best.per_value <= DRIFT_CRUDE and isinstance(best.effect, Drift)
    look = promise if near else glance
    courses: list[Drift] = [GRADUAL] * len(orders)
    if isinstance(best.effect, ChangedLoad) or best.effect.kind == "step":
        orders, courses = _steps(glance(problem, _each_visit(problem), plain), orders)
    fits = [look(problem, Effect(""), plain)]
    for order, course in zip(orders, courses, strict=True):
        each = _as(best.effect, course, order, problem.simulation)
        fits.append(look(replace(problem, order=order), each, plain))
    t = temper(min(f.per_value for f in fits), ALIKE)
    nothing, so, *otherwise = (f.log_evidence(t) for f in fits)
    return so - nothing > max(DRIFT_BY_TIME, DRIFT_ORDER * (max(otherwise) - nothing))


def _as(
    best: Drift | ChangedLoad, course: Drift, order: np.ndarray, simulation: Simulation
) -> Effect:
    """What the best fit has, in another order (n,) of the visits."""
    if isinstance(best, ChangedLoad):
        return best.at_visits(order >= course.since)
    return course.of_each(simulation) if best.joints else course


def _steps(free: Fit, orders: Sequence[np.ndarray]) -> tuple[list[np.ndarray], list[Drift]]:
    """Each order with a step where it is likeliest, without those that part visits as the first."""
    since = [_since(free, order) for order in orders]
    after = [order >= cut for order, cut in zip(orders, since, strict=True)]
    other = [bool(np.any(a != after[0]) and np.any(a == after[0])) for a in after]
    kept = [0, *np.flatnonzero(other).tolist()]
    return [orders[i] for i in kept], [Drift.at_once(since[i]) for i in kept]


def _other_orders(order: np.ndarray) -> list[np.ndarray]:
    """Permutations of an order (n,) that have least to do with it, forwards or backwards."""
    rng = np.random.default_rng(0)
    drawn = [rng.permutation(order) for _ in range(ORDERS_DRAWN)]
    return sorted(drawn, key=lambda one: abs(np.corrcoef(one, order)[0, 1]))[:ORDERS]


def along_a_joint(recorded: Dataset) -> bool:
    """Whether an angle rises or falls with time: then drift is told from nothing of that joint."""
    q = np.array([visit.q for visit in recorded.visits])
    order = np.array([visit.order for visit in recorded.visits])
    moves = np.ptp(q, axis=0) > 0
    return bool(np.any([abs(np.corrcoef(one, order)[0, 1]) > DRIFT_SWEPT for one in q.T[moves]]))


def _likeliest(found: Sequence[Fit]) -> Fit:
    """Of all joints together unless single ones, which are more numbers, tell clearly more."""
    single = [f for f in found if isinstance(f.effect, Drift) and f.effect.joints]
    together = min((f for f in found if f not in single), key=lambda f: f.per_value)
    if not single:
        return together
    t = temper(min(f.per_value for f in found), ALIKE)
    best = max(single, key=lambda f: f.log_evidence(t))
    return best if best.log_evidence(t) > together.log_evidence(t) + CLEAR else together


def evaluate(plain: Fit, best: Fit) -> Finding:
    """The gain of a fit with drift over the one without, and its parameters."""
    t = temper(best.per_value, ALIKE)
    values = best.parameters(t)
    if isinstance(best.effect, ChangedLoad):
        told = {"change": _share(best, values["mass"]), **values}
    else:
        told = {name: _change(value) for name, value in values.items() if name != BEND.name}
        told = {"change": max(told.values(), key=lambda value: abs(value[0])), **told}
    evidence = best.log_evidence(t) - plain.log_evidence(t)
    misfit = best.per_value
    gain = plain.per_value / misfit
    return Finding("drift", "campaign", evidence, told, best.effect.text(told), misfit, gain=gain)


def _change(log_change: tuple[float, float, str]) -> tuple[float, float, str]:
    """The relative change and its sd, from those of its logarithm."""
    value, sd, unit = log_change
    change = float(np.expm1(value))
    return change, float(np.hypot((1 + change) * sd, DRIFT_COURSE * change)), unit


def _share(found: Fit, mass: tuple[float, float, str]) -> tuple[float, float, str]:
    """A mass in kg as a share of that of the link that carries it."""
    assert isinstance(found.effect, ChangedLoad)
    elastic = found.misfit.setting.simulation.elastic
    own = float(elastic.inertia[elastic.bodies.index(found.effect.joint)][0])
    own = max(own, LIGHTEST * float(np.mean([body[0] for body in elastic.inertia])))
    return mass[0] / own, mass[1] / own, "1"


def _unchanged(recorded: Dataset, nominal: Simulation) -> bool:
    """Whether a pose that was returned to answers as before, but for the misses of hits."""
    if not any(_visits_again(recorded)):
        return False
    misses = OpenMisses.told(base(recorded, nominal), recorded, tolerances_of(nominal))
    apart = returned(recorded, misses)
    return apart is not None and apart < DRIFT_STILL


def returned(recorded: Dataset, misses: OpenMisses | None = None) -> float | None:
    """χ² per value between first and last visit of a pose; largest of the poses, None without.

    What `misses` of hits leave open is integrated out; without them hits are taken to be exact.
    """
    found = []
    for first, last in _visits_again(recorded):
        total, count = 0.0, 0
        missed = misses.of_hits(first, recorded.columns[first]) if misses else None
        for a in recorded.columns[first]:
            for b in recorded.columns[last]:
                if (a.axis, a.level) == (b.axis, b.level):
                    pair = Pair.of(a, b, lines_of(a))
                    pair = pair if missed is None else pair.opened(missed)
                    total += float(pair.product(pair.change, pair.change))
                    count += int(np.count_nonzero(pair.weight))
        if count:
            found.append(total / count)
    return max(found) if found else None


def _visits_again(recorded: Dataset) -> Iterator[tuple[int, int]]:
    """First and last visit of each pose that was returned to."""
    numbers: dict[str, list[int]] = {}
    for number, visit in enumerate(recorded.visits):
        numbers.setdefault(visit.pose, []).append(number)
    return ((each[0], each[-1]) for each in numbers.values() if len(each) > 1)
