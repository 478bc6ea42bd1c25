"""The screen for what depends on the force level: nonlinear joints, and what no joint explains."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from planner.dataset.dataset import Dataset
from planner.dataset.level_columns import Column
from planner.diagnosis.finding import Finding
from planner.diagnosis.laws.equivalent_stiffness import Equivalent, System, equivalent, system_of
from planner.diagnosis.laws.level_data import Data, data_of, own_parameter, relinearised
from planner.diagnosis.laws.level_refits import base
from planner.diagnosis.laws.one_joint import Candidate, Laws, covariance, descend
from planner.diagnosis.laws.starting_values import starts
from planner.diagnosis.laws.torque_laws import behaviour
from planner.diagnosis.linear.drift_fit import problem_of
from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.screens import several_joints
from planner.diagnosis.screens.implausible_springs import strayed
from planner.diagnosis.screens.several_joints import INDEPENDENT
from planner.diagnosis.screens.tone import screen_tone
from planner.dynamics.simulation import Simulation
from planner.inference.parallel import side_by_side
from planner.progress import Tell, quietly

LAWS = "nonlinear_stiffness", "friction", "backlash"
PROPORTIONAL = 1.35  # χ² per value up to which FRFs of different levels are the same
ALSO = 2.5  # joints whose equivalent stiffness explains nearly as much are fitted too
JOINTS = 2
STARTS = 2  # of each law at a joint, that are followed
ROUNDS, MORE, LAST, AGAIN = 3, 6, 4, 2
HOPELESS = 10.0  # times the best χ² after ROUNDS
ALIKE = 40.0  # neighbouring values that err alike where the model is not quite right
EXPLAINED = 0.6  # of the excess of χ² of the levels' differences, that a law has to take away
HOPEFUL = 0.3  # of the same, from which on a law is followed to its end
UNEXPLAINED = 1e-3  # of the same, that no law can be expected to explain
WEAKEST = 1e-10  # damping in the last rounds
TOLERANCE = 1e-5  # of the objective, that a last round must gain
CLEAR = 8.0
# Of the same, by an equivalent stiffness for each hit: below, no single joint is it, and below the
# other several may be.
LINEARISED, ONE_JOINT = 0.4, 0.8
# Relative sd of k and a: what derivatives by springs and inertias leave that neglect how a swing
# fades, as found on concealed cases of seeds 1 to 6.
INEXACT = 0.02, 0.02


@dataclass(frozen=True)
class LevelMisfit:
    """Σ weight |error|²: of a linear joint, what noise alone would leave, and the former's excess.

    A linear simulation says that levels do not differ; of the strongest only the noise is counted,
    because a linear fit could still follow them.
    """

    linear: float
    expected: float
    excess: float

    def explained(self, candidate: Candidate) -> float:
        """Share of the excess that a law takes away."""
        return 1 - max(candidate.chi2 - self.expected, 0.0) / self.excess


@dataclass(frozen=True, eq=False)
class Weighed:
    """A law at a joint: its log evidence over a linear joint, and the share that it explains.

    `levels` is what it was to explain.
    """

    candidate: Candidate
    at: str
    log_evidence: float
    explained: float
    levels: LevelMisfit
    per_value: float
    parameters: dict[str, tuple[float, float, str]]
    temper: float


def screen(
    recorded: Dataset, nominal: Simulation, *, single: bool = False, tell: Tell = quietly
) -> tuple[Finding, ...]:
    """Nonlinear joints; `unknown` where the level matters and no joint's law explains it.

    `single`: a law of several joints is not looked for.
    """
    if len(recorded.level_n) < 2:
        return ()
    tone = screen_tone(recorded)
    if tone is not None:
        return (tone,)
    plain = base(recorded, nominal)
    system = system_of(plain)
    found = equivalent(recorded, system)
    if not len(found.count) or disproportion(found) < PROPORTIONAL:
        return ()
    share = equivalent_share(found)
    if share < ONE_JOINT and not single:
        tell("fitting one law at all joints to the hits", 0.2)
    several = several_joints.screen(recorded, nominal) if share < ONE_JOINT and not single else ()
    if several:
        return several
    if share < LINEARISED:
        return (_unknown(found, "even with a stiffness of its own for every hit"),)
    weighed = weigh(recorded, plain, system, found, tell)
    best = weighed[0]
    if best.log_evidence > CLEAR and best.explained > EXPLAINED:
        there, shares = _shares(weighed)
        best, c = there[0], there[0].candidate
        sd = np.sqrt(np.diagonal(covariance(c, best.temper))[: len(c.x)])
        candidates = tuple(w.candidate for w in there)
        problem, hit = problem_of(recorded, nominal), _hardest(recorded)
        laws = Laws(problem, plain, candidates, shares, best.temper, hit)
        return (
            _finding(there, laws),
            *strayed(plain, c.x, sd, best.at, best.per_value),
        )
    law = best.candidate.law.effect.replace("_", " ")
    return (
        _unknown(found, f"the best, {law} at {best.at}, explains {100 * best.explained:.0f} %"),
    )


def _unknown(found: Equivalent, how: str) -> Finding:
    text = (
        "The response is not proportional to the force, and neither a single joint nor one law at "
        f"several joints describes how: {how}. Look for contact with the surroundings, loose "
        "parts or clearance."
    )
    return Finding("unknown", None, _excess(found) / 2, {}, text)


def equivalent_share(found: Equivalent) -> float:
    """Share of the levels' differences that a stiffness of its own a hit explains, best joint."""
    left = float(found.chi2.sum(axis=0).min() - found.count.sum())
    return 1 - max(left, 0.0) / max(_excess(found), 1e-9)


def disproportion(found: Equivalent) -> float:
    """χ² per value of the differences between force levels, 1 if the structure is linear."""
    return float(found.before.sum() / max(found.count.sum(), 1))


def _excess(found: Equivalent) -> float:
    return float(found.before.sum() - found.count.sum())


def weigh(
    recorded: Dataset, plain: Fit, system: System, found: Equivalent, tell: Tell = quietly
) -> tuple[Weighed, ...]:
    """Every law at the joints that come into question, fitted in time, most probable first."""
    data = data_of(recorded, plain)
    left = found.chi2.sum(axis=0)
    order = np.argsort(left)[:JOINTS]
    ports = [int(j) for j in order if left[j] < ALSO * left[order[0]]]
    begin: list[Candidate] = []
    for port in ports:
        own = own_parameter(plain, int(system.blocks[port]))
        begin += starts(found, system, port, plain.x, own)
    tell("fitting every law at single joints to the hits", 0.5)
    begun = _best_of_each(descend(data, plain, begin, 0), STARTS)
    rough = _best_of_each(descend(data, plain, begun, ROUNDS), 1)
    best = min(c.chi2 for c in rough)
    tell("following the best laws", 0.6)
    kept = descend(data, plain, [c for c in rough if c.chi2 < HOPELESS * best], MORE)
    first, levels = min(kept, key=lambda c: c.value), _levels(data)
    # Laws are weighed one against the other: those half-way would be wronged.
    told = [c for c in kept if c is first or levels.explained(c) > HOPEFUL]
    tell("fitting the best laws to the end", 0.8)
    ends = side_by_side(partial(_followed, data, plain, found), told)
    kept = [*ends, *(c for c in kept if all(c is not t for t in told))]
    return _weighed(data, plain, system, kept)


def _followed(data: Data, plain: Fit, found: Equivalent, candidate: Candidate) -> Candidate:
    last = candidate
    for _ in range(AGAIN):
        whole = relinearised(data, plain, found, last.port, last.x)
        again = [replace(last, normal=None, gradient=None, damping=1e-7)]
        last = descend(whole, plain, again, LAST, TOLERANCE, WEAKEST)[0]
    return last


def _best_of_each(candidates: list[Candidate], most: int) -> list[Candidate]:
    """The best of each port and law."""
    out: list[Candidate] = []
    for c in sorted(candidates, key=lambda c: c.value):
        if sum((o.port, o.law.effect) == (c.port, c.law.effect) for o in out) < most:
            out.append(c)
    return out


def _weighed(data: Data, plain: Fit, system: System, kept: list[Candidate]) -> tuple[Weighed, ...]:
    count = 2 * int(np.count_nonzero(data.weight))
    misfit = max(1.0, min(2 * c.chi2 for c in kept) / count)
    temper = misfit * (1 + ALIKE * (1 - 1 / misfit))
    levels = _levels(data)
    out = []
    for c in kept:
        evidence = (levels.linear - c.chi2) / temper - _volume(plain, c, temper)
        explained = levels.explained(c)
        at, per_value = system.ports[c.port], 2 * c.chi2 / count
        parameters = _parameters(plain, c, temper)
        out.append(Weighed(c, at, evidence, explained, levels, per_value, parameters, temper))
    return tuple(sorted(out, key=lambda w: -w.log_evidence))


def _levels(data: Data) -> LevelMisfit:
    weaker = (data.best != np.arange(len(data.h)))[:, None, None]
    change = np.where(weaker, np.abs(data.h - data.h[data.best]) ** 2, 0.0)
    differing = float(np.sum(data.weight * change))
    strongest = float(np.count_nonzero(data.weight * ~weaker))
    values = float(np.count_nonzero(data.weight * weaker))
    excess = max(differing - values, 1e-9)
    return LevelMisfit(differing + strongest, strongest + values, excess)


def _volume(plain: Fit, candidate: Candidate, temper: float) -> float:
    """What ν costs: ln of how much narrower the data make it than the prior, and its distance."""
    mean, sd = candidate.prior
    spread = np.sqrt(np.diagonal(covariance(candidate, temper))[-2:])
    away = (candidate.nu - mean) / sd
    return float(away @ away) / 2 + float(np.sum(np.log(sd / np.minimum(spread, sd))))


def _parameters(
    plain: Fit, candidate: Candidate, temper: float
) -> dict[str, tuple[float, float, str]]:
    c = candidate
    spread = covariance(c, temper)[-2:, -2:]
    share = c.nu[0] if c.law.signed else 1.0
    to_k = np.array([c.k / share if c.law.signed else c.k, 0.0])
    to_a = np.array([0.0, c.a])
    second, value = (to_a, c.a)
    if c.law.effect == "friction":
        second, value = c.a * to_k + c.k * to_a, c.k * c.a
    out = {}
    numbers = zip(c.law.names, (c.k, value), (to_k, second), INEXACT, strict=True)
    for (name, unit), v, slope, rough in numbers:
        sd = float(np.hypot(np.sqrt(slope @ spread @ slope), rough * v))
        out[name] = (float(v), sd, unit)
    return out


def _shares(weighed: Sequence[Weighed]) -> tuple[list[Weighed], tuple[float, ...]]:
    """The laws at the joint of the best, and the shares that all that is not explained gives."""
    at, levels = weighed[0].at, weighed[0].levels
    there = sorted((w for w in weighed if w.at == at), key=lambda w: w.candidate.chi2)
    chi2 = np.array([w.candidate.chi2 for w in there])
    # Below what noise is expected to leave, the best law is as good as any: others count from it.
    beyond = chi2 - min(levels.expected, chi2[0])
    left = np.maximum(beyond, max(UNEXPLAINED * levels.excess, INDEPENDENT / 2))
    shares = (left / left[0]) ** (-INDEPENDENT / 2)
    return there, tuple((shares / shares.sum()).tolist())


def _hardest(recorded: Dataset) -> Column:
    return max((c for group in recorded.columns for c in group), key=lambda c: c.peak_n)


def _finding(there: Sequence[Weighed], laws: Laws) -> Finding:
    best = there[0]
    others = zip(there[1:], laws.probability[1:], strict=True)
    rivals = {w.candidate.law.effect: share for w, share in others}
    (first, (k, k_sd, unit)), (second, (a, a_sd, other)) = best.parameters.items()
    name = best.candidate.law.effect
    text = (
        f"{best.at.replace('_', ' ').capitalize()} {behaviour(name, k)} "
        f"({first.replace('_', ' ')} {k:.3g} ± {k_sd:.1g} {unit}, {second.replace('_', ' ')} "
        f"{a:.3g} ± {a_sd:.1g} {other}); it explains {100 * best.explained:.0f} % of how FRFs "
        "change with the force."
    )
    return Finding(
        name, best.at, best.log_evidence, best.parameters, text, best.per_value, best.explained,
        tuple(rivals.items()), laws,
    )  # fmt: skip
