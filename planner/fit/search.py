"""Which effects a robot has: by evidence, added, removed and exchanged until nothing gains.

Two starts, as stated and with base and all bearings, lest what is missing be hidden by what it
bent. Then all effects at all places compete: operators are ranked by their first-order columns,
springs are always tried nonlinearly, a few steps each, the best are settled.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from planner.effects.effect import Operator, Start
from planner.effects.springs import BendingLink
from planner.fit.data import FrfData
from planner.fit.fitted import (
    FitRecord,
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
from planner.fit.structure import REACH, RobotPrior, RobotStructure, effects_free, exported
from planner.frf.frf import Frf
from planner.measurement.nuisances import Tolerances
from planner.measurement.truncated_decay import completed

SEARCHED, SCREENED, LAST = 28, 64, 44  # lines a pose: while searching, for operators, at the end
ANNEALED = ((0.5, 6), (0.2, 8), (0.07, 8))  # sizes by which a start comes near, and steps at each
LOG_STEPS, TRIED, FURTHER = 15, 6, 3  # steps
LEAST = 12.0  # nats that one more effect must gain
SAME = 3.0  # nats that one less may cost
COMPLETIONS = 2  # rounds
MOST_OPERATORS = 3  # beside springs: more would imitate what the fit lacks
IDLE, FAR = 2.0, 100.0  # nats of what goes at once; below which a few steps are not settled
STIFF_AT_FIRST, WIDENING = 3.0, 10  # prior sds of springs that may be there; steps
OPERATORS, FINALISTS, ENDS = 5, 4, 2  # how many are tried, followed, settled
# Sizes: with all lines at first; up to which nothing need be missing; from which one begins afresh.
CLOSE, EXPLAINED, UNEXPLAINED = 0.01, 0.008, 0.03
FRESH = 10.0  # nats that this must gain


@dataclass(frozen=True, eq=False)
class Search:
    """FRFs measured at q (n, dof) in rad, of a robot known before by `prior`."""

    prior: RobotPrior
    frfs: tuple[Frf, ...]
    q: np.ndarray
    band_hz: tuple[float, float]
    tolerances: Tolerances
    tell: Callable[[str], None] = lambda _: None
    extend: bool = True  # where what is stated does not explain them
    order: np.ndarray | None = None  # as in `FrfData.of`
    floor: float = 0.0  # as in `FrfMisfit`
    widen: bool = False  # whether `StructureFit.wider` is asked for

    def data(self, lines: int) -> FrfData:
        """On so many lines a pose."""
        return FrfData.of(self.prior, self.frfs, self.q, self.band_hz, lines, self.order)

    def found(self, warm: FitRecord | None = None) -> StructureFit:
        """The structure that explains them best; from what was found before, if that is given.

        Decays that the ends of records cut off are filled in as it has them, and it is found again.
        """
        best = self._found(warm)
        for _ in range(COMPLETIONS if any(np.isfinite(f.tail_s) for f in self.frfs) else 0):
            known = best.remembered
            best = self._completed(known)._found(known)
        return best

    def _completed(self, known: FitRecord) -> "Search":
        """With the decays that records cut off, as a structure has them."""
        if not any(np.isfinite(f.tail_s) for f in self.frfs):
            return self
        misfit, x = self._again(known, self.data(SEARCHED), known.size)
        simulation = exported(misfit.structure, x)[0]
        out = [completed(frf, simulation, row) for frf, row in zip(self.frfs, self.q, strict=True)]
        return replace(self, frfs=tuple(out))

    def _found(self, warm: FitRecord | None) -> StructureFit:
        data, dense = self.data(SEARCHED), self.data(SCREENED)
        stated = RobotStructure(self.prior, (), data.sensors)
        self.tell("as stated")
        plain = converged(self._begun(data, stated))
        if not self.extend:
            return self._last(plain)
        if size_of(plain) <= EXPLAINED:  # nothing need be missing
            best = plain
        elif warm is None:
            springs = tuple(e for e in self.prior.repertoire.effects if e.springs)
            best = converged(self._begun(data, replace(stated, effects=springs)))
        else:
            misfit, x = self._again(warm, data, max(warm.size, UNEXPLAINED))
            best = converged(settled(misfit, minimised(misfit, x, 4, 1.0)))
        best = self._evolved(best, dense)
        if plain.evidence > best.evidence:
            best = self._evolved(plain, dense)
        for _ in range(3 if warm is None else 1):
            if size_of(best) < UNEXPLAINED:
                break
            fresh = self._afresh(best)
            if fresh is None:
                break
            best = self._evolved(converged(fresh), dense)
        found = self._last(best)
        return replace(found, wider=self._widened(found)) if self.widen else found

    def _again(self, known: FitRecord, data: FrfData, size: float) -> tuple[FrfMisfit, np.ndarray]:
        structure = RobotStructure(self.prior, known.effects, data.sensors)
        numbers = dict(zip(known.names, known.x, strict=True))
        pairs = zip(structure.names, structure.mean, strict=True)
        x = np.array([numbers.get(name, mean) for name, mean in pairs])
        return FrfMisfit(structure, data, self.tolerances, size, self.floor), x

    def recalled(self, known: FitRecord) -> StructureFit:
        """What was found of these FRFs before, as it was."""
        misfit, x = self._again(known, self._completed(known).data(LAST), known.size)
        at = misfit(x, known.own)
        wider = None if known.wider is None else self.recalled(known.wider)
        found = StructureFit(misfit, at, misfit.evidence(at), wider)
        vars(found)["shares"] = known.shares
        return found

    def _begun(
        self, data: FrfData, structure: RobotStructure, x: np.ndarray | None = None
    ) -> StructureFit:
        """From x (the prior's mean): logarithms first, then FRFs that count more and more."""
        misfit = FrfMisfit(structure, data, self.tolerances, None, self.floor)
        at = minimised(misfit, structure.mean if x is None else x, LOG_STEPS)
        own = None
        for size, steps in ANNEALED:
            misfit = misfit.with_rho(size)
            at = minimised(misfit, at.x, steps, own=own)
            own = at.own if size < 0.1 else None
        return settled(misfit, at)

    def _evolved(self, best: StructureFit, dense: FrfData) -> StructureFit:
        """Effects added, removed and exchanged until nothing gains."""
        for _ in range(12):
            added = self._added(best, dense)
            newest = added.structure.effects[-1] if added is not best else None
            fewer = self._removed(added, newest)
            changed = fewer is not best
            best = converged(fewer) if changed else best
            swapped = self._exchanged(best)
            if swapped is best and not changed:
                break
            best = swapped
        return best

    def _added(self, best: StructureFit, dense: FrfData) -> StructureFit:
        """With the one effect that gains most, if that is enough.

        Where so many operators do not explain the FRFs, more would only imitate what does.
        """
        if sum(not e.springs for e in best.structure.effects) >= MOST_OPERATORS:
            return best
        ends = self._compete(best, self._starts(best, dense), best.evidence)
        if not ends or ends[0].evidence < best.evidence + LEAST:
            return best
        self.tell(f"+ {ends[0].structure.effects[-1].label}")
        return converged(ends[0])

    def _starts(self, best: StructureFit, dense: FrfData) -> list[Start]:
        """All effects that it has not; of operators those that the first order ranks first."""
        misfit = replace(best.misfit, data=dense)
        motions, gain = misfit.first_order(best.at.x, best.at.own)
        free = effects_free(best.structure)
        again = [  # something else may hang on the same link
            e for e in self.prior.repertoire.effects
            if e.several and e not in free
        ]  # fmt: skip
        starts = [s for e in (*free, *again) for s in e.starts(motions, gain)]
        starts.sort(key=lambda s: -s.nats)
        kept, kinds, operators = [], set(), 0
        for start in starts:
            spring, kind = bool(start.effect.springs), start.effect.kind
            if start.nats > 0 and (spring or operators < OPERATORS or kind not in kinds):
                kept.append(start)
                kinds.add(kind)
                operators += not spring
        return kept

    def _compete(
        self, base: StructureFit, starts: Iterable[Start], known: float
    ) -> list[StructureFit]:
        """Starts beside a structure: a few steps each, the best farther, the very best settled."""
        pool = []
        for start in starts:
            tried = [self._few(base, start, x, steps) for x, steps in placed(base, start)]
            pool += sorted((t for t in tried if t is not None), key=evidence_of)[-1:]
        pool.sort(key=evidence_of, reverse=True)
        pool = [stepped(p, FURTHER) for p in pool[:FINALISTS] if p.evidence > known - FAR]
        pool.sort(key=evidence_of, reverse=True)
        ends = [settled(one.misfit, one.at) for one in pool[:ENDS]]
        return sorted(ends, key=evidence_of, reverse=True)

    def _few(
        self, base: StructureFit, start: Start, x: np.ndarray, steps: int
    ) -> StructureFit | None:
        structure = base.structure.with_effect(start.effect)
        misfit = replace(base.misfit, structure=structure)
        if not misfit.possible(x):
            return None
        at = minimised(misfit, x, steps, 1.0, base.at.own)
        return StructureFit(misfit, at, misfit.evidence(at))

    def _removed(self, best: StructureFit, newest: Operator | None) -> StructureFit:
        """Without what the others make superfluous, what seems to matter least first."""
        while True:
            costs = removal_costs(best)
            least = sorted((e for e in costs if e is not newest), key=lambda e: costs[e])
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
        """An operator at another link, where that is likelier."""
        for effect in best.structure.effects:
            if effect.springs:
                continue
            base = without(best, [effect], 4)
            if base is None:
                continue
            motions, gain = base.misfit.first_order(base.at.x, base.at.own)
            psi = best.at.x[best.structure.own[best.structure.effects.index(effect)]]
            others = [
                e for e in effects_free(base.structure)
                if type(e) is type(effect) and e.at != effect.at.split("#")[0]
            ]  # fmt: skip
            starts = [e.elsewhere(psi, motions, gain) for e in others]
            ends = self._compete(base, starts, best.evidence)
            if ends and ends[0].evidence > best.evidence + SAME:
                self.tell(f"{effect.label} → {ends[0].structure.effects[-1].label}")
                return converged(ends[0])
        return best

    def _afresh(self, best: StructureFit) -> StructureFit | None:
        """What was found, and that with a link that bends, from what is stated again."""
        structure, data = best.structure, best.misfit.data
        bends = [e for e in effects_free(structure) if isinstance(e, BendingLink)]
        tried = []
        for one in (structure, *(structure.with_effect(e) for e in bends)):
            for softer in (0.0, 1.2):
                x = one.mean.copy()
                for effect, own in zip(one.effects, one.own, strict=True):
                    if effect in structure.effects:
                        x[own] = best.at.x[structure.own[structure.effects.index(effect)]]
                new = [i for i in range(one.stiffnesses) if not one.parameters[i].stated]
                x[new] -= softer * one.sd[new]
                if FrfMisfit(one, data, self.tolerances).possible(x):
                    tried.append(self._begun(data, one, x))
        fresh = max(tried, key=evidence_of, default=None)
        if fresh is None or fresh.evidence < best.evidence + FRESH:
            return None
        self.tell("afresh")
        return fresh

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
        misfit, at = found.misfit, found.at
        for effect in effects_free(found.structure):
            if not effect.springs:
                continue
            structure = misfit.structure.with_effect(effect)
            x, names = structure.carried(misfit.structure, at.x), misfit.structure.names
            new = [i for i in range(structure.stiffnesses) if structure.names[i] not in names]
            x[new] += STIFF_AT_FIRST * structure.sd[new]
            wider = replace(misfit, structure=structure)
            if wider.possible(x):
                misfit, at = wider, minimised(wider, x, FURTHER, 1.0, at.own)
        at = minimised(misfit, at.x, WIDENING, 1.0, own=at.own)
        return StructureFit(misfit, at, misfit.evidence(at))


def placed(
    base: StructureFit, start: Start, all_move: bool = False
) -> list[tuple[np.ndarray, int]]:
    """Where fits with one more effect begin, and their steps; `all_move`: of all numbers."""
    structure = base.structure.with_effect(start.effect)
    x = structure.carried(base.structure, base.at.x)
    effect = structure.effects[-1]
    if not effect.springs:
        if all_move and start.moved is not None:
            x = structure.carried(base.structure, base.at.x + start.moved)
            x = np.clip(x, structure.least, structure.mean + REACH * structure.sd)
        x[structure.own[-1]] = start.psi
        others = []
        for psi in effect.beside(start.psi):
            z = x.copy()
            z[structure.own[-1]] = psi
            others.append((z, TRIED))
        return [(x, TRIED if others else 4), *others]
    new = [i for i, p in enumerate(structure.parameters) if set(p.blocks) & set(effect.springs)]
    stiff = [i for i in new if i < structure.stiffnesses]
    x[stiff] = structure.mean[stiff] + structure.sd[stiff]
    starts = [x]
    # Stated springs that strayed far softer may stand in for the new ones: back to what is stated,
    # the new ones as soft as they were.
    away = (x - structure.mean) / structure.sd
    stated = [i for i in range(structure.stiffnesses) if structure.parameters[i].stated]
    far = [i for i in stated if away[i] < -1.5]
    if far:
        z = x.copy()
        softest = x[far].min()
        z[far] = structure.mean[far]
        low, high = structure.mean[stiff] - 3 * structure.sd[stiff], structure.mean[stiff]
        z[stiff] = np.clip(softest, low, high)
        starts.append(z)
    return [(one, TRIED) for one in starts]
