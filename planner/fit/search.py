"""Which effects a robot has: what is likeliest is looked at until nothing beside it is likelier.

Beside a set of effects are those with one more, one less, one elsewhere, and one exchanged for any
other. Operators are ranked by their first-order columns and tried with all else linear (`OneMore`);
where nothing of that leaves little, all are fitted from what is stated too, by logarithms first,
lest what is missing be hidden by what it bent. The best are settled, and what is settled is kept.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.effects.effect import Operator, Start, gain_of
from planner.fit.explanations import (
    RARE,
    ExploredStructures,
    Key,
    added,
    key,
    key_of,
    log_probability,
    most_probable,
)
from planner.fit.fitted import (
    SIZES,
    FitRecord,
    StructureFit,
    converged,
    evidence_of,
    exchanged,
    explains_all,
    removal_costs,
    settled,
    size_of,
    without,
)
from planner.fit.gauss_newton import minimised
from planner.fit.misfit import FrfMisfit
from planner.fit.posterior import RobotBelief
from planner.fit.starts import anywhere
from planner.fit.structure import RobotStructure, effects_free, exported
from planner.fit.trials import (
    FAR,
    FAR_OFF,
    FOLLOWED,
    LOG_STEPS,
    Trials,
    all_visits,
    explained,
)
from planner.fit.visit_chains import LEAST_VISITS, likeliest_multiples
from planner.inference.parallel import parallel_map
from planner.measurement.measured_frfs import completed

SEARCHED, SCREENED, LAST = 24, 48, 44  # lines a pose: while searching, for operators, at the end
SETTLED = 4  # of those that compete
MOST = 6  # effects
COMPLETIONS = 2  # rounds
STIFF_AT_FIRST = 3.0  # prior sds of springs that may be there
AGAIN = 0.03  # least size with which what was found before goes on

Pool = dict[Key, StructureFit]


@dataclass(frozen=True, eq=False)
class Search(Trials):
    """Of the effects that explain FRFs best."""

    extend: bool = True  # where what is stated does not explain them
    widen: bool = False  # whether `StructureFit.wider` is asked for
    thorough: bool = False  # whether what explains them is compared with all that is beside it

    def explored(self, begun: Sequence[StructureFit]) -> ExploredStructures:
        """From the robot as it is known to be built on, the first, and from what else was found."""
        return ExploredStructures(begun[0], self._explore(begun, warm=True))

    def found(self, warm: FitRecord | None = None) -> StructureFit:
        """The effects that explain them best; from what was found before, if that is given.

        Decays that the ends of records cut off are filled in as what was known has them, until that
        is found again, and at last as it has them.
        """
        known, begun = warm, self if warm is None else self._completed(warm)
        best = begun._found(warm)
        for _ in range(COMPLETIONS if self._cut_off else 0):
            again = best.tried.record
            if known is not None and known.labels == again.labels:
                break
            known = again
            best = self._completed(known)._gone_on(known)
        if self._cut_off:
            known = best.tried.record
            begun = self._completed(known)
            best = begun.recovered(known)
        return begun._ended(best)

    @property
    def _cut_off(self) -> bool:
        return any(np.isfinite(f.tail_s) for f in self.frfs)

    def _found(self, warm: FitRecord | None) -> StructureFit:
        first = self.plain() if warm is None else self.recovered(warm)
        if not self.extend:
            return first
        # What is stated may lack physics, for which visits' chains would stand in.
        search = self if warm is None else self._chained(first)
        return search._beside_known(first, warm)

    def _beside_known(self, first: StructureFit, warm: FitRecord | None) -> StructureFit:
        """The likeliest beside what a fit has, and beside what is stated."""
        same = np.array_equal(first.misfit.data.multiples, all_visits(self.multiples, len(self.q)))
        known = first if same else self.recovered(first.tried.record)
        best = most_probable(self._explore([known], warm is not None))
        # What stands in for what fewer poses could not tell may hide it: where the new pose changes
        # what was found, it is looked for from what is stated, too.
        if warm is not None and (key_of(best) != key_of(known) or not explained(best)):
            best = most_probable([best, *self._explore([self.plain()], True)])
        # All springs may give at once, which none of them shows alone; but what did not explain
        # fewer poses is only mended.
        if not explained(best) and (warm is None or warm.size <= SIZES[0]):
            best = most_probable(
                [best, *self._explore([self._pruned(self.freed())], warm is not None)]
            )
        return best

    def _pruned(self, found: StructureFit) -> StructureFit:
        """Without what by the first order is not worth how rare it is."""
        costs = removal_costs(found)
        fewer = without(found, [e for e in added(found) if costs[e] < RARE])
        if fewer is None:
            return found
        fewer = settled(fewer.misfit, fewer.at)
        return self._pruned(fewer) if log_probability(fewer) > log_probability(found) else found

    def _gone_on(self, known: FitRecord) -> StructureFit:
        best = self.recovered(known)
        return most_probable(self._explore([best], True)) if self.extend else best

    def _chained(self, found: StructureFit) -> "Search":
        """With what visits' chains have for themselves, as is likeliest beside a fit."""
        few = len(self.q) < LEAST_VISITS or not self.extend
        return self if few else self._with(likeliest_multiples(found))

    def _with(self, multiples: tuple[float, ...]) -> "Search":
        known, other = (all_visits(m, len(self.q)) for m in (self.multiples, multiples))
        return self if np.array_equal(known, other) else replace(self, multiples=multiples)

    def _completed(self, known: FitRecord) -> "Search":
        """With visits' chains and the decays that records cut off as a structure has them."""
        if not self._cut_off:
            return self._with(known.multiples)
        misfit, x = self.again(known, self.data(SEARCHED), known.size)
        simulation = exported(misfit.structure, x)[0]
        out = [completed(frf, simulation, row) for frf, row in zip(self.frfs, self.q, strict=True)]
        return replace(self._with(known.multiples), frfs=tuple(out))

    def _ended(self, best: StructureFit) -> StructureFit:
        best = self._believed(best)
        found = self._chained(best)._last(best)
        return replace(found, wider=self._widened(found)) if self.widen else found

    def _believed(self, best: StructureFit) -> StructureFit:
        """Without what was otherwise at one pose where something is left."""
        labels = {e.label for e in self.readings}
        read = [e for e in best.structure.effects if e.label in labels]
        if not read or explains_all(best):
            return best
        fewer = without(best, read)
        return best if fewer is None else converged(settled(fewer.misfit, fewer.at))

    def plain(self) -> StructureFit:
        """With nothing that robots need not have."""
        self.on_step("as stated")
        data = self.data(SEARCHED)
        return converged(self.begun(data, self.prior.as_built(data.sensors)))

    def recovered(self, known: FitRecord) -> StructureFit:
        """What was found of other data, of these."""
        misfit, x = self.again(known, self.data(SEARCHED), max(known.size, AGAIN))
        return converged(settled(misfit, minimised(misfit, x, 4, 1.0)))

    def freed(self, known: RobotBelief | None = None) -> StructureFit:
        """With every spring that there may be; of operators those that are `known`, from there."""
        data, every = self.data(SEARCHED), self.prior.effect_library.effects
        effects = [e for e in every if e.springs_only]
        if known is not None:
            effects += [e for e in known.structure.effects if not (e.springs_only or e.stated)]
        stated = self.prior.stated(data.sensors)
        structure = replace(stated, effects=(*stated.effects, *effects))
        x, own = structure.mean.copy(), slice(structure.inertial.stop, structure.chain.start)
        if known is not None:
            x[own] = structure.carried(known.structure, known.x)[own]
        return converged(self.begun(data, structure, x))

    def recalled(self, known: FitRecord) -> StructureFit:
        """What was found of these FRFs before, as it was."""
        misfit, x = self.again(known, self._completed(known).data(LAST), known.size)
        at = misfit(x, known.own)
        wider = None if known.wider is None else self.recalled(known.wider)
        found = StructureFit(misfit, at, misfit.evidence(at), wider)
        vars(found)["shares"] = known.shares
        return found

    def _explore(
        self, begun: Sequence[StructureFit], warm: bool = False
    ) -> tuple[StructureFit, ...]:
        """All that was settled until nothing beside the likeliest is likelier.

        What was found before (`warm`), or explains the FRFs, has less beside it that is looked at,
        unless all is wanted.
        """
        pool: Pool = {}
        extended, seen = set[Key](), set[Key]()
        _keep(pool, begun)
        while key_of(best := most_probable(pool.values())) not in seen:
            seen.add(key_of(best))
            near = not self.thorough and (warm or explained(best))
            for more in self._beside(best, near, pool, extended):
                _keep(pool, more)
                likelier = most_probable(pool.values())
                if key_of(likelier) != key_of(best):
                    self.on_step(" + ".join(e.label for e in added(likelier)) or "as stated")
                    _keep(pool, [converged(likelier)])
                    break
        return tuple(pool.values())

    def _beside(
        self, best: StructureFit, near: bool, pool: Pool, extended: set[Key]
    ) -> Iterator[list[StructureFit]]:
        """Sets beside the likeliest that were not looked at, as they are asked for.

        One effect less, one more, each elsewhere or another in its place; and from afar what none
        of these explains.
        """
        effects, costs = added(best), removal_costs(best)
        yield list(self._whole_or_parts(best))
        for effect in sorted(effects, key=lambda e: costs[e]):
            known = pool.get(_less(best, effect))
            # What was met from elsewhere and is worse than by first order from here is stuck there.
            stuck = known is not None and known.evidence < best.evidence - costs[effect]
            if (known is None or stuck) and not (near and costs[effect] > FAR):
                yield [self._fewer(best, effect, near)]
        more, first = list[StructureFit](), key_of(best) not in extended
        if first:
            extended.add(key_of(best))
            more = self._further(best)
            yield more
        for effect in effects:
            yield self._exchanged(best, effect, near, pool, extended)
        if first and all(size_of(one) > FAR_OFF for one in (best, *more)):
            yield self._from_afar(best)
        if first and not explained(best):
            yield list(self._afresh(best))

    def _fewer(self, best: StructureFit, effect: Operator, near: bool) -> StructureFit:
        """Without an effect: from where it is, and, where much is left then and not only what is
        `near` is wanted, from what is stated."""
        bent = without(best, [effect])
        if bent is not None:
            bent = settled(bent.misfit, bent.at)
            if near or size_of(bent) <= FAR_OFF:
                return bent
        structure = best.structure.without(effect)
        x, own = structure.mean.copy(), slice(structure.inertial.stop, structure.chain.start)
        x[own] = structure.carried(best.structure, best.at.x)[own]  # the other effects' numbers
        if not replace(best.misfit, structure=structure).possible(x):
            x = structure.mean
        afar = converged(self.begun(best.misfit.data, structure, x))
        return afar if bent is None else max(bent, afar, key=evidence_of)

    def _whole_or_parts(self, best: StructureFit) -> Iterator[StructureFit]:
        """With what is more than its springs in the place of effects that free some of them, and
        the other way round."""
        every, there = self.prior.effect_library.effects, {e.label for e in best.structure.effects}
        for whole in (e for e in every if e.more_than_springs):
            parts = [e for e in every if e.springs_only and set(e.springs) < set(whole.springs)]
            here = [e for e in parts if e.label in there]
            pairs = [(here, [whole])] if here and whole.label not in there else []
            if whole.label in there:
                pairs += [([whole, *here], new) for new in (*([e] for e in parts), parts)]
            for left, new in pairs:
                other = max(exchanged(best, left, new), key=evidence_of, default=None)
                if other is not None:
                    yield settled(other.misfit, other.at)

    def _afresh(self, best: StructureFit) -> Iterator[StructureFit]:
        """The same from what is stated, wherever what is more than its springs may begin: mass and
        springs together can be wrong in many ways."""
        data, s = best.misfit.data, best.structure
        for number, effect in enumerate(s.effects):
            if effect.more_than_springs:
                begun = [x for x in anywhere(best, number) if best.misfit.possible(x)]
                ends = parallel_map(lambda x: self.begun(data, s, x).tried, begun)
                if ends:
                    yield converged(self._from(max(ends, key=evidence_of), data))

    def _further(self, base: StructureFit) -> list[StructureFit]:
        """With one effect more, settled, likeliest first."""
        if len(added(base)) >= MOST:
            return []
        # Of what explains the FRFs first order and few steps tell what more would gain.
        near = explained(base) and not self.thorough
        starts = self.starts(base, SCREENED, RARE if near else 0.0)
        return self.compete(base, starts, count=SETTLED, behind=0.0 if near else FAR)

    def _exchanged(
        self, best: StructureFit, effect: Operator, near: bool, pool: Pool, extended: set[Key]
    ) -> list[StructureFit]:
        """Without an effect; with it elsewhere, or with another in its place, likeliest first.

        Where only what is `near` is wanted, or what without it may be there was looked at,
        elsewhere alone. In the place of what is too small to be named nothing is looked for.
        """
        held = effect.springs or effect.stated
        if near and held:
            return []
        fewer = pool.get(_less(best, effect)) or self._fewer(best, effect, near)
        if not self.may_be_named(fewer, best, effect):
            return [fewer]
        starts = [] if held else self._moved(fewer, best, effect)
        if not near and key_of(fewer) not in extended:
            extended.add(key_of(fewer))
            new = self.starts(fewer, SCREENED)
            starts += [s for s in new if key((*added(fewer), s.effect)) not in pool]
        return [fewer, *self.compete(fewer, starts, count=SETTLED, against=best)]

    def _from_afar(self, base: StructureFit) -> list[StructureFit]:
        """The same, all from what is stated: what is missing may be hidden by what it bent."""
        if len(added(base)) >= MOST:
            return []
        nearest = self.nearest(base, self.starts(base, SCREENED))
        ends = parallel_map(lambda at: converged(self.begun_with(base, *at)).tried, nearest)
        return [self._from(tried, base.misfit.data) for tried in ends]

    def _moved(self, fewer: StructureFit, best: StructureFit, effect: Operator) -> list[Start]:
        """An operator that the likeliest has more, at other places: what the first order ranks
        first of many."""
        motions, gain = fewer.misfit.first_order(fewer.at.x, fewer.at.own)
        psi = best.at.x[best.structure.own[best.structure.effects.index(effect)]]
        others = [
            e for e in self.free(fewer.structure)
            if type(e) is type(effect) and e.at != effect.at.split("#")[0]
        ]  # fmt: skip
        starts = (e.moved_to(effect, psi, motions, gain) for e in others)
        return sorted(starts, key=gain_of, reverse=True)[:FOLLOWED]

    def _last(self, best: StructureFit) -> StructureFit:
        """On all lines, and at last along what the data leave open."""
        misfit = FrfMisfit(
            best.structure, self.data(LAST), self.tolerances, max(size_of(best), 0.01), self.floor
        )
        at = minimised(misfit, best.at.x, 10, own=best.at.own)
        best = settled(misfit, at, rounds=2, steps=15)
        at = minimised(best.misfit, best.at.x, 25, 0.02, best.at.own, by_prior=True)
        return StructureFit(best.misfit, at, best.misfit.evidence(at))

    def _widened(self, found: StructureFit) -> StructureFit:
        """With every spring that there may be, and with which such a robot can be.

        What poses not measured may show is open as it is here: few poses tell no structure.
        """
        misfit, x = found.misfit, found.at.x
        for effect in [e for e in effects_free(found.structure) if e.springs_only]:
            wider = replace(misfit, structure=misfit.structure.with_effect(effect))
            begun = _stiff_at_first(wider.structure, misfit.structure, x)
            if wider.possible(begun):
                misfit, x = wider, begun
        at = minimised(misfit, x, LOG_STEPS, 1.0, own=found.at.own)
        return StructureFit(misfit, at, misfit.evidence(at))


def _stiff_at_first(wider: RobotStructure, structure: RobotStructure, x: np.ndarray) -> np.ndarray:
    """Numbers x of a structure in a wider one, whose new springs hardly give."""
    out, known = wider.carried(structure, x), {p.name for p in structure.parameters}
    stiffnesses = enumerate(wider.parameters[: wider.stiffnesses])
    new = [i for i, p in stiffnesses if p.name not in known]
    out[new] += STIFF_AT_FIRST * wider.sd[new]
    return out


def _less(found: StructureFit, effect: Operator) -> Key:
    return key(e for e in added(found) if e is not effect)


def _keep(pool: Pool, more: Iterable[StructureFit]) -> None:
    for one in more:
        known = pool.get(key_of(one))
        if known is None or one.evidence > known.evidence:
            pool[key_of(one)] = one
