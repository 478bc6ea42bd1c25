"""Which effects explain the recordings: all compete at all places, one more at a time.

Where little is left, few steps from the fit so far tell them apart; where much is, each is fitted
from afar by logarithms first. What is settled is kept: the posterior is over all of it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.effects.effect import Operator, Start
from planner.fit.data import FrfData
from planner.fit.fitted import (
    StructureFit,
    converged,
    evidence_of,
    removal_costs,
    settled,
    size_of,
    stepped,
    without,
)
from planner.fit.gauss_newton import minimised
from planner.fit.misfit import FrfMisfit
from planner.fit.search import Search, placed
from planner.fit.structure import RobotStructure, effects_free

FITTED, SCREENED, ROUGH, AFAR = 24, 48, 14, 12  # lines a pose
RARE = 5.0  # nats: one effect at one place, of some 70, is so much rarer than none
LEAST = RARE + float(np.log(9.0))  # nats that one more effect must gain: it is 9 times as likely
CLOSE = 0.03  # of |H|, from which effects are fitted from afar too
FOLLOWED, SETTLED, FARTHEST = 6, 4, 5  # how many are followed, settled, come from afar
LOG_STEPS, FEW, FURTHER = 6, 6, 4
KEPT = 6  # operators by first order beside the best of each kind
FAR = 100.0  # nats below what was there, from which nothing is followed
HOPELESS = 4.0  # nats, below which a further step is not worth it while many are tried
PULLED = 1.5  # prior sds, from which another prior may pay
ROUNDS, FROM_AFAR = 4, 2

Key = frozenset[tuple[str, str]]


def key_of(found: StructureFit) -> Key:
    """What it consists of."""
    return frozenset(e.name for e in added(found))


def added(found: StructureFit) -> tuple[Operator, ...]:
    """Effects beside those that every robot has."""
    there = {e.label for e in built(found)}
    return tuple(e for e in found.structure.effects if e.label not in there)


def built(found: StructureFit) -> tuple[Operator, ...]:
    """Those that every robot has."""
    there = {e.label for e in found.structure.prior.repertoire.as_built()}
    return tuple(e for e in found.structure.effects if e.label in there)


@dataclass(frozen=True, eq=False)
class Explored:
    """The robot as stated, the likeliest explanation, and everything that was settled."""

    plain: StructureFit
    best: StructureFit
    settled: tuple[StructureFit, ...]


@dataclass(frozen=True, eq=False)
class Explorer:
    """Explains FRFs by the effects of a search's repertoire."""

    search: Search

    def explored(self) -> Explored:
        """From the robot as stated on."""
        search = self.search
        data, dense = search.data(FITTED), search.data(SCREENED)
        built = search.prior.repertoire.as_built()
        stated = RobotStructure(search.prior, built, data.sensors)
        plain = best = converged(search._begun(data, stated))
        pool: dict[Key, StructureFit] = {key_of(plain): plain}
        for number in range(ROUNDS):
            ends = self._further(best, dense, afar=number < FROM_AFAR)
            _keep(pool, ends)
            if not ends or ends[0].evidence < best.evidence + LEAST:
                break
            search.tell(f"+ {ends[0].structure.effects[-1].label}")
            before, best = best, self._pruned(converged(ends[0]))
            _keep(pool, [best])
            if _change(before, best) < search.floor:
                break  # what is smaller yet does not matter
        best = self._exchanged(best, dense, pool)
        return Explored(plain, best, tuple(pool.values()))

    def _exchanged(
        self, best: StructureFit, dense: FrfData, pool: dict[Key, StructureFit]
    ) -> StructureFit:
        """Each of several effects against all others in its place."""
        for effect in added(best) if len(added(best)) > 1 else ():
            if effect not in best.structure.effects:
                continue
            fewer = without(best, [effect])
            if fewer is None:
                continue
            fewer = settled(fewer.misfit, fewer.at)
            ends = self._further(fewer, dense)
            _keep(pool, [fewer, *ends])
            if ends and ends[0].evidence > best.evidence + LEAST / 4:
                self.search.tell(f"{effect.label} → {ends[0].structure.effects[-1].label}")
                best = self._pruned(converged(ends[0]))
                _keep(pool, [best])
        return best

    def _pruned(self, best: StructureFit) -> StructureFit:
        """Without what the others make superfluous."""
        costs = removal_costs(best)
        for effect in sorted(added(best), key=lambda e: costs[e]):
            if costs[effect] > 100 or len(added(best)) < 2:
                break
            fewer = without(best, [effect])
            if fewer is None:
                continue
            fewer = settled(fewer.misfit, fewer.at)
            if fewer.evidence > best.evidence - LEAST / 2:
                self.search.tell(f"− {effect.label}")
                best = fewer
        return best

    def _further(
        self, base: StructureFit, dense: FrfData, afar: bool = False
    ) -> list[StructureFit]:
        """With one effect more, settled, likeliest first."""
        starts, rough = self._starts(base, dense), self._on(base, self.search.data(ROUGH))
        pool = [f for s in starts if (f := self._few(rough, s)) is not None]
        if afar and size_of(base) >= CLOSE:
            pool += self._from_afar(rough, starts)
        near = [p for p in pool if p.evidence > rough.evidence - FAR]
        followed = [self._on(p, base.misfit.data) for p in _best_of_each(near)[:FOLLOWED]]
        followed = _best_of_each([stepped(p, FURTHER) for p in followed])
        ends = [settled(p.misfit, p.at) for p in followed[:SETTLED]]
        return sorted(ends, key=evidence_of, reverse=True)

    def _on(self, found: StructureFit, data: FrfData) -> StructureFit:
        """The same on other lines."""
        misfit = FrfMisfit(
            found.structure, data, self.search.tolerances, found.misfit.rho, self.search.floor
        )
        at = misfit(found.at.x, found.at.own)
        return StructureFit(misfit, at, misfit.evidence(at))

    def _starts(self, base: StructureFit, dense: FrfData) -> list[Start]:
        misfit = replace(base.misfit, data=dense)
        motions, gain = misfit.first_order(base.at.x, base.at.own)
        free, every = effects_free(base.structure), base.structure.prior.repertoire.effects
        again = (e for e in every if e.several and e not in free)
        far = size_of(base) >= CLOSE
        tried = (e for e in (*free, *again) if far or _pulled(base, e))
        starts = (e.starts(motions, gain) for e in tried)
        return _leaders([one for several in starts for one in several])

    def _few(self, base: StructureFit, start: Start) -> StructureFit | None:
        structure = base.structure.with_effect(start.effect)
        misfit = replace(base.misfit, structure=structure)
        # Where the first order leads to no robot that can be, it begins without the effect.
        none = structure.carried(base.structure, base.at.x)
        begun = [x for x, _ in placed(base, start, all_move=True) if misfit.possible(x)]
        ends = []
        for x in begun or [x for x in (none,) if misfit.possible(x)]:
            at = minimised(misfit, x, FEW, HOPELESS, base.at.own)
            ends.append(StructureFit(misfit, at, misfit.evidence(at)))
        return max(ends, key=evidence_of, default=None)

    def _from_afar(self, base: StructureFit, starts: Sequence[Start]) -> list[StructureFit]:
        """Each effect from what is stated, by logarithms on few lines; the best go on."""
        search, rough, found = self.search, self.search.data(AFAR), []
        for start in starts:
            structure = base.structure.with_effect(start.effect)
            misfit = FrfMisfit(structure, rough, search.tolerances, None, search.floor)
            for x in _afar(structure, start):
                if not misfit.possible(x):
                    continue
                at = minimised(misfit, x, LOG_STEPS)
                found.append((at.value, structure, at.x))
        found.sort(key=lambda one: one[0])
        data = base.misfit.data
        return [search._begun(data, s, x) for _, s, x in found[:FARTHEST]]


def _pulled(base: StructureFit, effect: Operator) -> bool:
    """Whether anything is gained where springs that are there need not be as they are expected."""
    s, known = base.structure, effect.spring_priors
    there = [i for i in range(s.stiffnesses) if known.keys() & set(s.parameters[i].blocks)]
    away = np.abs((base.at.x - s.mean) / s.sd)[there]
    return not there or bool(np.any(away > PULLED))


def _afar(structure: RobotStructure, start: Start) -> Iterable[np.ndarray]:
    """Where a fit from afar begins: as stated, new springs as expected and softer."""
    effect, x = structure.effects[-1], structure.mean.copy()
    if not effect.springs:
        x[structure.own[-1]] = start.psi
        return (x,)
    new = [i for i in range(structure.stiffnesses) if not structure.parameters[i].stated]
    mine = [i for i in new if set(structure.parameters[i].blocks) & set(effect.springs)]
    softer = x.copy()
    softer[mine] -= 1.2 * structure.sd[mine]
    return x, softer


def _change(before: StructureFit, after: StructureFit) -> float:
    """By how much of |H| at the measured poses both differ."""
    one, other = (np.abs(f.at.motion.accelerance) for f in (before, after))
    return float(np.linalg.norm(other - one) / np.linalg.norm(other))


def _leaders(starts: Sequence[Start]) -> list[Start]:
    """Springs, which the first order says little of, the first operators, the best of each kind."""
    kept: list[Start] = []
    kinds: set[str] = set()
    operators = 0
    for start in sorted(starts, key=lambda s: -s.nats):
        effect: Operator = start.effect
        new = effect.kind not in kinds
        told = np.isinf(start.nats) or effect.artefact
        if told or (start.nats > 0 and (operators < KEPT or new)):
            kept.append(start)
            kinds.add(effect.kind)
            operators += not np.isinf(start.nats)
    return kept


def _best_of_each(pool: Iterable[StructureFit]) -> list[StructureFit]:
    best: dict[Key, StructureFit] = {}
    _keep(best, pool)
    return sorted(best.values(), key=evidence_of, reverse=True)


def _keep(pool: dict[Key, StructureFit], more: Iterable[StructureFit]) -> None:
    for one in more:
        known = pool.get(key_of(one))
        if known is None or one.evidence > known.evidence:
            pool[key_of(one)] = one
