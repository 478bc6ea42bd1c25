"""Where simulation and recordings differ, and which effect explains it."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.diagnosis.effects import library
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.beyond_tolerance import with_artefacts
from planner.diagnosis.linear.damper_like_springs import (
    as_structures,
    beside_dampers,
    damper_like,
)
from planner.diagnosis.linear.discrepancy import settled_with
from planner.diagnosis.linear.evidence import Weights, stated_springs, weigh
from planner.diagnosis.linear.fit import Fit, carried_on, fit, settle
from planner.diagnosis.linear.found import Found, behind, distinct
from planner.diagnosis.linear.mismatch import Mismatch
from planner.diagnosis.linear.other_places import named_as_mass
from planner.diagnosis.linear.problem import Problem, tolerances_of
from planner.diagnosis.linear.search import search
from planner.diagnosis.linear.slightness import thinned, without_slight
from planner.diagnosis.thresholds import SECOND_EFFECT, TIED, UNKNOWN
from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.fit.identify import TOO_SOFT
from planner.frf.frf import Frf
from planner.identification.objective import stands
from planner.measurement.measured_frfs import common_band
from planner.progress import Tell, quietly

Place = tuple[str, str | None]  # an effect and where it is


@dataclass(frozen=True, eq=False)
class Candidate:
    """An effect at a place ("none" and "unknown" at None; two effects: both) and its probability.

    `fit` is its best one, None for "unknown"; there may be several variants of an effect.
    """

    effects: tuple[Effect, ...]
    probability: float
    fit: Fit | None

    @property
    def places(self) -> tuple[Place, ...]:
        """(name, place) of each effect."""
        if self.fit is None:
            return (("unknown", None),)
        return tuple((e.name, e.at or None) for e in self.effects)


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The verdict, and all candidates, most probable first."""

    verdict: str
    candidates: tuple[Candidate, ...]
    refitted: Fit
    best: Fit  # of the likeliest candidate that is a fit, so not "unknown"
    temper: float
    seconds: float
    problem: Problem
    log_evidence: float = 0.0  # of everything that was weighed, together

    @property
    def left(self) -> float:
        """What refitting alone leaves of the recordings, relative, once misses are out."""
        return Mismatch.of(self.refitted.misfit, self.refitted.x).unexplained

    @property
    def undecided(self) -> tuple[Candidate, ...]:
        """Candidates that the data cannot tell apart."""
        return tuple(c for c in self.candidates if c.probability > TIED)


def diagnose(
    frfs: Sequence[Frf],
    q: np.ndarray,
    simulation: Simulation,
    *,
    effects: Sequence[Effect] | None = None,
    bent: bool = False,
    tell: Tell = quietly,
) -> Diagnosis:
    """Which effect explains FRFs at q (n, dof) in rad that the simulation does not.

    `effects` are looked at instead of the whole library; `bent` is as in `search`. Raises
    InputError where nothing of the FRFs lies in robot.toml's band, or where the robot would not
    stand at q.
    """
    started = time.perf_counter()
    band = common_band(frfs, simulation.robot.config.band_hz)
    problem = Problem(tuple(frfs), np.atleast_2d(q), simulation, band, as_built=True)
    if not stands(simulation.elastic.matrices(problem.q), simulation.elasticity.stiffness):
        raise InputError(TOO_SOFT)
    tell("refitting the simulation", 0.0)
    refitted = settle(problem, fit(problem, Effect("")))
    all_ = library(simulation, problem.layout.sensors) if effects is None else effects
    found = search(problem, refitted, all_, tell, bent=bent)
    return _diagnosis(problem, found, all_, started)


def again(before: Diagnosis, frfs: Sequence[Frf], q: np.ndarray) -> Diagnosis:
    """The undecided candidates of a diagnosis, fitted to more recordings from where they were.

    `frfs` at q (n, dof) in rad are the earlier ones and further ones, in the same band. A tie is
    decided by what its candidates say of the new hits, not by which of them a search finds again.
    """
    started = time.perf_counter()
    problem = replace(before.problem, frfs=tuple(frfs), q=np.atleast_2d(q))
    tied = [c.fit for c in before.undecided if c.fit is not None and c.fit.effect.at]
    fits = tuple(carried_on(problem, f, f.effect) for f in (before.refitted, *tied))
    all_ = library(problem.simulation, problem.layout.sensors)
    return _diagnosis(problem, Found(fits, ()), all_, started)


def _diagnosis(problem: Problem, found: Found, all_: Sequence[Effect], started: float) -> Diagnosis:
    found, weights = _weighed(problem, found, all_)
    candidates = tuple(
        _with_discrepancy(c, found, weights) for c in _candidates(problem, found, weights, all_)
    )
    likeliest = found.finalists[weights.likeliest]
    best = candidates[0].fit or likeliest
    seconds = time.perf_counter() - started
    return Diagnosis(
        verdict_of(candidates[0].places), candidates, found.finalists[0], best,
        weights.temper, seconds, problem, weights.log_evidence,
    )  # fmt: skip


def _weighed(problem: Problem, found: Found, all_: Sequence[Effect]) -> tuple[Found, Weights]:
    """Weights of all finalists, and of the likeliest with one effect fewer after the other.

    And with an artefact more, where it needs a measuring chain beyond its tolerance.
    """

    def weights(fits: Sequence[Fit]) -> Weights:
        return weigh(fits, _priors([f.effect for f in fits], all_))

    found = replace(found, finalists=as_structures(found.finalists))
    first = weights(found.finalists)
    number = int(np.argmax(first.probabilities[:-1]))
    likeliest = found.finalists[number]
    if wrong := with_artefacts(problem, likeliest, first.worth[number], all_):
        found = distinct(replace(found, finalists=(*found.finalists, *wrong)))
        first = weights(found.finalists)
        likeliest = found.finalists[int(np.argmax(first.probabilities[:-1]))]
    more = thinned(problem, likeliest, found.finalists)
    if not more:
        return found, first
    found = distinct(replace(found, finalists=(*found.finalists, *more)))
    return found, weights(found.finalists)


def _with_discrepancy(candidate: Candidate, found: Found, weights: Weights) -> Candidate:
    """The candidate with its fit where the discrepancy's likeliest size lets it be."""
    fit = candidate.fit
    number = next((i for i, f in enumerate(found.finalists) if f is fit), None)
    if fit is None or number is None or candidate.probability < TIED:
        return candidate
    springs, size = stated_springs(found.finalists[0]), weights.worth[number].size
    return replace(candidate, fit=settled_with(fit, springs, size))


def beside_another(found: Diagnosis) -> Diagnosis:
    """The diagnosis beside an artefact: each effect is a second one then, and less likely."""

    def weight(c: Candidate) -> float:
        return c.probability * (1.0 if c.places == (("none", None),) else SECOND_EFFECT)

    total = sum(map(weight, found.candidates))
    again = [replace(c, probability=weight(c) / total) for c in found.candidates]
    candidates = tuple(sorted(again, key=lambda c: -c.probability))
    best = candidates[0].fit or found.best
    return replace(
        found, verdict=verdict_of(candidates[0].places), candidates=candidates, best=best
    )


def verdict_of(places: tuple[Place, ...]) -> str:
    """What it means that effects at these places are the likeliest of all."""
    first = places[0][0] if places else UNKNOWN
    return {"none": "consistent", UNKNOWN: "unexplained"}.get(first, "explained")


def _priors(chosen: Sequence[Effect], all_: Sequence[Effect]) -> list[float]:
    """Of each; variants of an effect at a place share one."""
    places = [(e.name, e.at) for e in all_]
    out = []
    for effect in chosen:
        variants = [max(places.count((p.name, p.at)), 1) for p in effect.parts()]
        out.append(effect.prior / float(np.prod(variants)))
    return out


def of_its_own(found: Fit, temper: float) -> tuple[Effect, ...]:
    """The effects of a fit as they are named: without what is part of another of them.

    That is the mean stiffness of a joint whose stiffness changes with its angle.
    """
    simulation, parts = found.misfit.setting.simulation, _beyond_tolerance(found, temper)
    uneven = {p.at for p in parts if p.name == "angle_dependent_stiffness"}
    return tuple(
        p
        for p in parts
        if p.name != "joint_stiffness" or p.at not in uneven or len(p.springs(simulation)) > 1
    )


def _beyond_tolerance(found: Fit, temper: float) -> tuple[Effect, ...]:
    """The effects of a fit without artefacts as small as every measuring chain has them."""
    parts, t = found.effect.parts(), tolerances_of(found.misfit.setting.simulation)
    kept = tuple(p for p in parts if not (p.artefact and p.usual(found.parameters(temper, p), t)))
    return kept or (Effect(""),)


def _candidates(
    problem: Problem, found: Found, weights: Weights, all_: Sequence[Effect]
) -> tuple[Candidate, ...]:
    fits = list(found.finalists)
    matters = found.finalists[0].misfit.setting.simulation.robot.config.diagnose.matters
    named = [_beyond_tolerance(f, weights.temper) for f in fits]
    prior = _priors([f.effect for f in fits], all_)
    evidence = np.array([w.log_evidence for w in weights.worth])
    shares = beside_dampers(fits, weights.probabilities[:-1], evidence, weights.temper)
    own = prior, weights.bent, evidence
    shares = list(without_slight(fits, named, shares, *own, matters))
    shares = named_as_mass(fits, shares)
    unknown = float(weights.probabilities[-1])
    for i, one in enumerate(fits):
        if shares[i] > TIED / len(fits) and damper_like(one, weights.temper):
            unknown, shares[i] = unknown + shares[i], 0.0
    leader = int(np.argmax(shares))
    lead = prior[leader]
    before = _priors([effect for effect, _, _ in found.left], all_)
    # It was left while nothing fitted, when little told apart; by now more would.
    behind_best = behind(problem, fits[leader], [fit for _, _, fit in found.left], weights.temper)
    for (_, then, left), now, weight in zip(found.left, behind_best, before, strict=True):
        fits.append(left)
        since = max(then, now)
        shares.append(shares[leader] * float(np.exp(-since)) * weight / lead)
    total = sum(shares) + unknown
    parts = [of_its_own(f, weights.temper) for f in fits]
    groups: dict[tuple, list[int]] = {}
    for i, own in enumerate(parts):
        groups.setdefault(tuple(sorted((p.name, p.at) for p in own)), []).append(i)
    out = [Candidate((), unknown / total, None)]
    for members in groups.values():
        leader = max(members, key=lambda i: shares[i])
        share = sum(shares[i] for i in members) / total
        out.append(Candidate(parts[leader], float(share), fits[leader]))
    return tuple(sorted(out, key=lambda c: -c.probability))
