"""Which effects a robot has: by evidence, added, removed and exchanged until nothing gains.

Starts: as stated, with base and all bearings, and, where much is left or numbers departed far, with
each effect from what is stated, lest what is missing be hidden by what it bent. From each all
effects at all places compete: operators are ranked by their first-order columns, springs are always
tried nonlinearly, a few steps each; the best are settled.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.effects.effect import Operator
from planner.fit.fitted import (
    FitRecord,
    StructureFit,
    converged,
    evidence_of,
    removal_costs,
    settled,
    size_of,
    without,
)
from planner.fit.gauss_newton import minimised
from planner.fit.misfit import FrfMisfit
from planner.fit.structure import effects_free, exported
from planner.fit.trials import FAR, LOG_STEPS, Trials, explained
from planner.inference.parallel import side_by_side
from planner.measurement.measured_frfs import completed

SEARCHED, SCREENED, LAST = 28, 64, 44  # lines a pose: while searching, for operators, at the end
LEAST = 12.0  # nats that one more effect must gain
SAME = 3.0  # nats that one less may cost
COMPLETIONS = 2  # rounds
MOST_OPERATORS = 3  # beside springs: more would imitate what the fit lacks
IDLE = 2.0  # nats of what goes at once
STIFF_AT_FIRST = 3.0  # prior sds of springs that may be there
AGAIN = 0.03  # least size with which what was found before goes on


@dataclass(frozen=True, eq=False)
class Search(Trials):
    """Of the structure that explains FRFs best."""

    extend: bool = True  # where what is stated does not explain them
    widen: bool = False  # whether `StructureFit.wider` is asked for

    def found(self, warm: FitRecord | None = None) -> StructureFit:
        """The structure that explains them best; from what was found before, if that is given.

        Decays that the ends of records cut off are filled in as it has them, and it goes on.
        """
        best = self._found(warm)
        for _ in range(COMPLETIONS if any(np.isfinite(f.tail_s) for f in self.frfs) else 0):
            known = best.tried.record
            best = self._completed(known)._gone_on(known)
        return best

    def _gone_on(self, known: FitRecord) -> StructureFit:
        best = self._recovered(known)
        return self._ended(self._evolved(best) if self.extend else best)

    def _completed(self, known: FitRecord) -> "Search":
        """With the decays that records cut off, as a structure has them."""
        if not any(np.isfinite(f.tail_s) for f in self.frfs):
            return self
        misfit, x = self.again(known, self.data(SEARCHED), known.size)
        simulation = exported(misfit.structure, x)[0]
        out = [completed(frf, simulation, row) for frf, row in zip(self.frfs, self.q, strict=True)]
        return replace(self, frfs=tuple(out))

    def _found(self, warm: FitRecord | None) -> StructureFit:
        known = None if warm is None or not self.extend else self._recovered(warm)
        if known is not None and explained(known):
            return self._ended(self._evolved(known))
        data = self.data(SEARCHED)
        self.tell("as stated")
        plain = converged(self.begun(data, self.prior.stated(data.sensors)))
        if not self.extend:
            return self._ended(plain)
        first, *others = self._beginnings(plain, known)
        best = self._evolved(first)
        for other in others:
            if other.evidence > best.evidence or not explained(best):
                best = max(best, self._evolved(other), key=evidence_of)
        while ends := self.from_afar(best):
            if ends[0].evidence < best.evidence + LEAST:
                break
            best = self._evolved(ends[0])
        return self._ended(best)

    def _ended(self, best: StructureFit) -> StructureFit:
        found = self._last(best)
        return replace(found, wider=self._widened(found)) if self.widen else found

    def _recovered(self, known: FitRecord) -> StructureFit:
        """What was found of other data, of these."""
        misfit, x = self.again(known, self.data(SEARCHED), max(known.size, AGAIN))
        return converged(settled(misfit, minimised(misfit, x, 4, 1.0)))

    def _beginnings(self, plain: StructureFit, known: StructureFit | None) -> list[StructureFit]:
        """Where effects are added and removed from: what is most likely to lack some first."""
        if explained(plain):  # nothing need be missing
            return [plain]
        likeliest = max(plain, known or plain, *self.from_afar(plain), key=evidence_of)
        if known is not None or explained(likeliest):
            return [likeliest]
        return [self.freed(), likeliest]

    def freed(self) -> StructureFit:
        """With every spring that there may be, and no operator."""
        data, springs = self.data(SEARCHED), [e for e in self.prior.repertoire.effects if e.springs]
        stated = self.prior.stated(data.sensors)
        return converged(self.begun(data, replace(stated, effects=(*stated.effects, *springs))))

    def recalled(self, known: FitRecord) -> StructureFit:
        """What was found of these FRFs before, as it was."""
        misfit, x = self.again(known, self._completed(known).data(LAST), known.size)
        at = misfit(x, known.own)
        wider = None if known.wider is None else self.recalled(known.wider)
        found = StructureFit(misfit, at, misfit.evidence(at), wider)
        vars(found)["shares"] = known.shares
        return found

    def _evolved(self, best: StructureFit) -> StructureFit:
        """Effects added, removed and exchanged until nothing gains."""
        held = None  # for which no other place is likelier
        for _ in range(12):
            added = self._added(best)
            newest = added.structure.effects[-1] if added is not best else None
            fewer = self._removed(added, newest)
            changed = fewer is not best
            best = converged(fewer) if changed else best
            swapped = best if best is held else self._exchanged(best)
            if swapped is best and not changed:
                break
            held = best if swapped is best else None
            best = swapped
        return best

    def _added(self, best: StructureFit) -> StructureFit:
        """With the one effect that gains most, if that is enough."""
        if crowded(best):
            return best
        # Of what explains the FRFs first order and few steps tell what more would gain.
        least, behind = (LEAST, 0.0) if explained(best) else (0.0, FAR)
        ends = self.compete(best, self.starts(best, SCREENED, least), behind=behind)
        if not ends or ends[0].evidence < best.evidence + LEAST:
            return best
        self.tell(f"+ {ends[0].structure.effects[-1].label}")
        return converged(ends[0])

    def from_afar(self, base: StructureFit) -> list[StructureFit]:
        """Each effect from what is stated, where `base` leaves some; likeliest first."""
        if explained(base) or crowded(base):
            return []
        nearest = self.nearest(base, self.starts(base, SCREENED))
        ends = side_by_side(lambda at: converged(self.begun_with(base, *at)).tried, nearest)
        found = (self._from(p, base.misfit.data) for p in ends)
        return sorted(found, key=evidence_of, reverse=True)

    def _removed(self, best: StructureFit, newest: Operator | None) -> StructureFit:
        """Without what the others make superfluous, what seems to matter least first."""
        while True:
            costs = removal_costs(best)
            mine = (e for e in costs if e is not newest and not e.stated)
            least = sorted(mine, key=lambda e: costs[e])
            idle = [e for e in least if costs[e] < IDLE]
            groups = ([idle] if len(idle) > 1 else []) + [[e] for e in least if costs[e] < FAR]
            for group in groups:
                fewer = without(best, group)
                if fewer is None or fewer.evidence < best.evidence - FAR:
                    continue
                if fewer.evidence < best.evidence:
                    fewer = settled(fewer.misfit, fewer.at)
                if fewer.evidence > best.evidence - SAME:
                    self.tell("− " + ", ".join(e.label for e in group))
                    best = fewer
                    break
            else:
                return best

    def _exchanged(self, best: StructureFit) -> StructureFit:
        """An operator at another place, where that is likelier."""
        for effect in best.structure.effects:
            ends = self.displaced(best, effect)
            if ends and ends[0].evidence > best.evidence + SAME:
                self.tell(f"{effect.label} → {ends[0].structure.effects[-1].label}")
                return ends[0]
        return best

    def displaced(self, best: StructureFit, effect: Operator) -> list[StructureFit]:
        """With an operator at other places than where it is, likeliest first."""
        held = effect.springs or effect.stated
        base = None if held else without(best, [effect], steps=0)
        if base is None:
            return []
        motions, gain = base.misfit.first_order(base.at.x, base.at.own)
        psi = best.at.x[best.structure.own[best.structure.effects.index(effect)]]
        others = [
            e for e in effects_free(base.structure)
            if type(e) is type(effect) and e.at != effect.at.split("#")[0]
        ]  # fmt: skip
        ends = self.compete(base, [e.elsewhere(effect, psi, motions, gain) for e in others])
        return [*map(converged, ends[:1]), *ends[1:]]

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
        """With every spring that there may be.

        What poses not measured may show is open as it is here: few poses tell no structure.
        """
        structure = found.structure
        for effect in effects_free(structure):
            structure = structure.with_effect(effect) if effect.springs else structure
        x = structure.carried(found.structure, found.at.x)
        known = {p.name for p in found.structure.parameters}
        new = [i for i, p in enumerate(structure.parameters[: structure.stiffnesses])
               if p.name not in known]  # fmt: skip
        x[new] += STIFF_AT_FIRST * structure.sd[new]
        misfit = replace(found.misfit, structure=structure)
        at = minimised(misfit, x, LOG_STEPS, 1.0, own=found.at.own)
        return StructureFit(misfit, at, misfit.evidence(at))


def crowded(found: StructureFit) -> bool:
    """Whether it has so many operators that more would imitate what explains the FRFs."""
    return sum(not e.springs and not e.stated for e in found.structure.effects) >= MOST_OPERATORS
