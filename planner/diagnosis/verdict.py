"""One verdict over everything that was settled; nothing rewrites it.

Physics that robot.toml leaves out counts by size: how much of |H| at poses set aside changes when
it is dropped and the rest refitted. What refitting takes the place of (a stated spring, a mass, the
chain) counts by evidence beyond its stated tolerance.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import expit
from scipy.stats import norm

from planner.diagnosis.levels import Levels
from planner.effects.effect import Operator
from planner.fit.explanations import (
    RARE,
    ExploredStructures,
    Key,
    added,
    built,
    gone,
    key_of,
    matched,
    most_probable,
    probabilities,
)
from planner.fit.fitted import StructureFit, evidence_of, settled, size_of, without
from planner.fit.posterior import FOLLOWED, RobotPosterior

LEAST = RARE + float(np.log(9.0))  # nats from which an effect is there: 9 times as likely
SURE = 0.9  # probability from which an effect's size counts as beyond what matters
EXPLAINS = 2.0  # times what matters: a discrepancy up to which nothing else is wanted
# Effects without a name of their own imitate what a named one's shape lacks: they count from so
# many times what matters on, and so much of all that is gained.
GENERAL, OF_ALL = 3.0, 0.05
LIKELY = 0.01  # probability of another set, from which the size of what it has is asked for
BENT = 2.0  # times what levels still differ by, from which a linear effect beside a law is told
LINES = 40  # of the band, on which sizes are told
Place = tuple[str, str | None]
UNKNOWN, NONE = ("unknown", None), ("none", None)


@dataclass(frozen=True, eq=False)
class NamedEffect:
    """An effect of the explanation: `gain_nats` that it gains, share of |H| that it changes, and
    the probability that it is there."""

    operator: Operator
    gain_nats: float
    change: float
    probability: float
    counts: bool

    @property
    def place(self) -> Place:
        """Its name, and where it is."""
        return self.operator.name


@dataclass(frozen=True)
class Candidate:
    """Effects that are there together, and how probable that is."""

    places: tuple[Place, ...]
    probability: float


@dataclass(frozen=True, eq=False)
class Verdict:
    """`candidates` sum to 1, most probable first; of `effects` those that count are findings."""

    verdict: str
    effects: tuple[NamedEffect, ...]
    candidates: tuple[Candidate, ...]
    sets: tuple[tuple[Place, ...], ...]
    best: StructureFit

    @property
    def findings(self) -> tuple[NamedEffect, ...]:
        """What is there and matters; nothing where it does not explain the recordings."""
        told = self.verdict == "explained"
        return tuple(e for e in self.effects if e.counts and (told or e.operator.artefact))


def judged(
    explored: ExploredStructures,
    matters: float,
    q: np.ndarray,
    from_signals: Sequence[Place] = (),
    levels: Levels | None = None,
    aside: float = 0.0,
) -> Verdict:
    """Of what was explored, of effects `from_signals` in the signals, and of laws of force
    `levels`.

    Sizes are told at q (n, dof) in rad, poses that were not measured. Averages over levels are bent
    by what is left of a joint's law: beside one only what changes FRFs by more is told, and no more
    need be explained than what makes a simulation worth following. What is
    named and misses FRFs of poses set `aside` by a share that matters explains nothing.
    """
    weights, best = probabilities(explored.settled), most_probable(explored.settled)
    sizes = _Sizes(explored, weights, matters, q)
    effects, others = (
        _beside_laws(found, levels) for found in (sizes.of_best(), sizes.of_others())
    )
    laws = levels.laws if levels else ()
    named = [e for e in effects if e.counts]
    nameless = any(e.operator.general for e in named)
    wrong = nameless or (aside > matters and named)
    bound = FOLLOWED if laws else EXPLAINS * matters
    left = size_of(best) > bound or (wrong and not laws)
    unknown = left or bool(levels and levels.unexplained) or UNKNOWN in from_signals
    there = named or from_signals or laws
    verdict = "unexplained" if unknown else "explained" if there else "consistent"
    candidates = _candidates(weights, [*effects, *others], unknown, tuple(from_signals))
    if levels and laws and not unknown:
        candidates = _with_laws(candidates, levels)
    return Verdict(verdict, tuple(effects), candidates, _sets(named, weights), best)


def _beside_laws(effects: Sequence[NamedEffect], levels: Levels | None) -> list[NamedEffect]:
    """Of effects beside joints' laws what is no work of what these leave."""
    if levels is None or not levels.laws:
        return list(effects)
    bent, bends = BENT * levels.left.size, {law.at for law in levels.laws}

    def apart(e: NamedEffect) -> bool:
        return e.operator.artefact or (e.change > bent and e.place[1] not in bends)

    return [replace(e, counts=e.counts and apart(e)) for e in effects]


@dataclass(frozen=True, eq=False)
class _Sizes:
    """Each effect's size where the rest is refitted without it, at q (n, dof) in rad."""

    explored: ExploredStructures
    weights: dict[Key, float]
    matters: float
    q: np.ndarray

    @cached_property
    def best(self) -> StructureFit:
        """The likeliest fit."""
        return most_probable(self.explored.settled)

    def weigh(
        self, fit: StructureFit, effect: Operator, own: Operator
    ) -> tuple[NamedEffect, StructureFit | None]:
        """An effect of a fit, told as `own` of the best; and the fit without it."""
        gained = self.best.evidence - self.explored.plain.evidence
        nats, change, lines = gained, 1.0, np.linspace(*_band(self.best), LINES)
        fewer = _without(self.explored, fit, effect)
        if fewer is not None:
            h, other = (_physics(RobotPosterior.of(f), self.q, lines) for f in (fit, fewer))
            nats = fit.evidence - fewer.evidence
            change = float(np.linalg.norm(np.abs(h) - np.abs(other)) / np.linalg.norm(h))
        probability = sum(w for key, w in self.weights.items() if effect.name in key)
        if effect in built(fit):
            probability = float(expit(nats - RARE))
        counts = _counts(effect, nats, change, self.matters, gained)
        return NamedEffect(own, float(nats), change, float(probability), counts), fewer

    def of_best(self) -> list[NamedEffect]:
        """Of the likeliest set, smallest first given up.

        What is too small to count is gone when the others are weighed: two hoses that stand for one
        would each hide how much the other matters. Where another takes its place, that is gone.
        """
        fit, left = self.best, list(added(self.best))
        found = [self.weigh(fit, e, e)[0] for e in _beyond(fit)]
        while left:
            # What was settled by itself has effects of its own: those of the best are told.
            weighed = [(*self.weigh(fit, e, own), e) for e, own in matched(fit, self.best, left)]
            slight = [
                (effect, fewer)
                for effect, fewer, e in sorted(weighed, key=lambda one: one[0].change)
                if not effect.counts and fewer and gone(fewer, fit) == [e]
            ]
            if not slight:
                found += [effect for effect, _, _ in weighed]
                break
            effect, fit = slight[0]
            found.append(effect)
            left = [own for own in left if own is not effect.operator]
        return sorted(found, key=lambda e: -e.change)

    def of_others(self) -> list[NamedEffect]:
        """What other likely sets have and the likeliest has not."""
        known, found = {e.name for e in added(self.best)}, []
        likely = [f for f in self.explored.settled if self.weights[key_of(f)] > LIKELY]
        for fit in sorted(likely, key=lambda f: -self.weights[key_of(f)]):
            new = [e for e in added(fit) if e.name not in known]
            found += [self.weigh(fit, e, e)[0] for e in new]
            known |= {e.name for e in new}
        return found


def _counts(effect: Operator, nats: float, change: float, matters: float, gained: float) -> bool:
    """Whether it is there and matters; its size is as well known as its amplitude is."""
    least = matters * (GENERAL if effect.general else 1.0)
    sure = norm.cdf((change - least) / (change / np.sqrt(2 * max(nats, 1.0)) + 1e-12))
    there = nats > max(LEAST, OF_ALL * gained if effect.general else 0.0)
    return bool(there and (effect.absorbed or sure >= SURE))


def _beyond(best: StructureFit) -> list[Operator]:
    """What every robot has, where it is so much that it is worth a word."""
    structure, x = best.structure, best.at.x
    e, omega = structure.elasticity(x), 2 * np.pi * float(np.sqrt(np.prod(_band(best))))
    viscous = dict(zip(structure.springs, omega * e.damping / e.stiffness, strict=True))
    own = zip(structure.effects, structure.own, strict=True)
    return [f for f, at in own if f in built(best) and f.beyond(x[at], viscous)]


def _without(
    explored: ExploredStructures, best: StructureFit, effect: Operator
) -> StructureFit | None:
    """The best that there is without an effect: refitted from here, or as the search came by."""
    rest = Counter(key_of(best)) - Counter([effect.name])
    met = [f for f in explored.settled if Counter(key_of(f)) == rest and gone(f, best) == [effect]]
    fewer = None if any(f.settled for f in met) else without(best, [effect])
    if fewer is not None:
        met.append(settled(fewer.misfit, fewer.at, rounds=2))
    return max(met, key=evidence_of, default=None)


def _band(best: StructureFit) -> tuple[float, float]:
    lines = best.misfit.data.measured.frequency_hz
    return float(lines.min()), float(lines.max())


def _physics(posterior: RobotPosterior, q: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """FRFs (n, 3, 3, F) of the robot itself, in m/s²/N."""
    misfit = replace(posterior.found.misfit, data=posterior.at(q, lines))
    return misfit.motion(posterior.x, None).accelerance


def _candidates(
    weights: dict[Key, float],
    effects: Sequence[NamedEffect],
    unknown: bool,
    from_signals: tuple[Place, ...],
) -> tuple[Candidate, ...]:
    """Sets by what of them counts; what no name explains is "unknown"."""
    counts = {e.place for e in effects if e.counts}
    idle = {e.place for e in effects} - counts
    from_signals = (
        *from_signals,
        *sorted(p for p in counts if not any(p in key for key in weights)),
    )
    shares: dict[tuple[Place, ...], float] = {}
    for key, weight in weights.items():
        rest = (*from_signals, *sorted(p for p in key if p not in idle))
        places = (UNKNOWN,) if unknown else rest or (NONE,)
        shares[places] = shares.get(places, 0.0) + weight
    shares.setdefault((UNKNOWN,), 0.0)
    ranked = sorted(shares.items(), key=lambda item: -item[1])
    return tuple(Candidate(places, share) for places, share in ranked)


def _with_laws(candidates: Sequence[Candidate], levels: Levels) -> tuple[Candidate, ...]:
    """The likeliest set of linear effects, with each law that was weighed at a joint."""
    first = tuple(p for p in candidates[0].places if p != NONE)
    further = tuple((law.effect, law.at) for law in levels.laws[1:])
    found = [
        Candidate((*first, (effect, at), *further), share)
        for effect, at, share in levels.candidates
    ]
    return *sorted(found, key=lambda c: -c.probability), Candidate((UNKNOWN,), 0.0)


def _sets(named: Sequence[NamedEffect], weights: dict[Key, float]) -> tuple[tuple[Place, ...], ...]:
    """For each finding what may stand in its place, where that is not much less likely."""
    out = []
    best = max(weights, key=lambda key: weights[key])
    for effect in named:
        rest = Counter(best) - Counter([effect.operator.name])
        others = [
            next(iter(Counter(key) - rest))
            for key, weight in weights.items()
            if weight > 0.05 and key != best and rest <= Counter(key) and len(key) == len(best)
        ]
        if others and effect.place in best:
            out.append((effect.place, *others))
    return tuple(out)
