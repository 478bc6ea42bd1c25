"""Which effects a robot has: by evidence, added, removed and exchanged until nothing gains.

Two starts, as stated and with base and all bearings, lest what is missing be hidden by what it
bent. Then all effects at all places compete: operators are ranked by their first-order columns,
springs are always tried nonlinearly, a few steps each, the best are settled.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.effects.effect import Effect, Start
from planner.effects.resonator import LocalResonator
from planner.effects.springs import BendingLink
from planner.fit.data import FrfData
from planner.fit.gauss_newton import minimised
from planner.fit.misfit import At, Misfit
from planner.fit.structure import RobotPrior, Structure, effects_free
from planner.frf.frf import Frf
from planner.identification.measurement_model import Tolerances

SEARCHED, SCREENED, LAST = 28, 64, 44  # lines a pose: while searching, for operators, at the end
SIZES = (0.001, 0.002, 0.004, 0.008, 0.015, 0.03, 0.06, 0.12, 0.3)  # of the discrepancy
USUAL, SPREAD = 0.02, 1.5  # its prior: log-normal
ANNEALED = ((0.5, 6), (0.2, 8), (0.07, 8))  # sizes by which a start comes near, and steps at each
LOG_STEPS, TRIED, FURTHER, SETTLED = 15, 6, 3, 8  # steps
LEAST = 12.0  # nats that one more effect must gain
MATTERS = 0.01  # share of |H| that an effect must change: nothing wrong changes up to 0.7 %
SAME = 3.0  # nats that one less may cost
MOST_OPERATORS = 3
IDLE, FAR = 2.0, 100.0  # nats of what goes at once; below which a few steps are not settled
OPERATORS, FINALISTS, ENDS = 5, 4, 2  # how many are tried, followed, settled
UNEXPLAINED = 0.03  # size of the discrepancy from which a structure begins afresh
FRESH = 10.0  # nats that this must gain
DEBUG = 0
LIGHTER = np.log(6.0)


@dataclass(frozen=True, eq=False)
class Found:
    """A structure fitted to FRFs."""

    misfit: Misfit
    at: At
    evidence: float

    @cached_property
    def shares(self) -> tuple[float, ...]:
        """By how much of |H| at the measured poses each effect's going changes the best fit."""
        h = self.at.motion.accelerance
        found = []
        for effect in self.structure.effects:
            fewer = _without(self, [effect])
            gone = 0.0 * h if fewer is None else fewer.at.motion.accelerance
            found.append(float(np.linalg.norm(gone - h) / np.linalg.norm(h)))
        return tuple(found)

    @property
    def remembered(self) -> "Remembered":
        """What is worth keeping of it."""
        s = self.structure
        return Remembered(s.effects, s.names, self.at.x, self.at.own, _size(self), self.shares)

    @property
    def structure(self) -> Structure:
        """Of what it is made."""
        return self.misfit.structure


@dataclass(frozen=True, eq=False)
class Remembered:
    """A structure's effects, its numbers by name, the discrepancy's size, and what each pose had.

    From it a fit goes on, or is recalled without any step.
    """

    effects: tuple[Effect, ...]
    names: tuple[str, ...]
    x: np.ndarray
    own: np.ndarray
    size: float
    shares: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Search:
    """FRFs measured at q (n, dof) in rad, of a robot known before by `prior`."""

    prior: RobotPrior
    frfs: tuple[Frf, ...]
    q: np.ndarray
    band_hz: tuple[float, float]
    tolerances: Tolerances
    tell: Callable[[str], None] = lambda _: None

    def data(self, lines: int) -> FrfData:
        """On so many lines a pose."""
        return FrfData.of(self.prior, self.frfs, self.q, self.band_hz, lines)

    def found(self, warm: Remembered | None = None) -> Found:
        """The structure that explains them best; from what was found before, if that is given."""
        data, dense = self.data(SEARCHED), self.data(SCREENED)
        if warm is None:
            springs = tuple(e for e in self.prior.repertoire.effects if e.springs)
            best = self._begun(data, Structure(self.prior, springs, data.sensors))
        else:
            size = max(warm.size, UNEXPLAINED)
            misfit, x = self._again(warm, data, size)
            best = settled(misfit, minimised(misfit, x, 4, 1.0))
        best = self._evolved(converged(best), dense)
        for _ in range(3 if warm is None else 1):
            if _size(best) < UNEXPLAINED:
                break
            fresh = self._afresh(best)
            if fresh is None:
                break
            best = self._evolved(converged(fresh), dense)
        return self._last(_that_matters(best))

    def _again(self, known: Remembered, data: FrfData, size: float) -> tuple[Misfit, np.ndarray]:
        structure = Structure(self.prior, known.effects, data.sensors)
        numbers = dict(zip(known.names, known.x, strict=True))
        pairs = zip(structure.names, structure.mean, strict=True)
        x = np.array([numbers.get(name, mean) for name, mean in pairs])
        return Misfit(structure, data, self.tolerances, size), x

    def recalled(self, known: Remembered) -> Found:
        """What was found of these FRFs before, as it was."""
        misfit, x = self._again(known, self.data(LAST), known.size)
        at = misfit(x, known.own)
        found = Found(misfit, at, misfit.evidence(at))
        vars(found)["shares"] = known.shares
        return found

    def _begun(self, data: FrfData, structure: Structure, x: np.ndarray | None = None) -> Found:
        """From x (the prior's mean): logarithms first, then FRFs that count more and more."""
        misfit = Misfit(structure, data, self.tolerances, None)
        at = minimised(misfit, structure.mean if x is None else x, LOG_STEPS)
        own = None
        for size, steps in ANNEALED:
            misfit = misfit.with_rho(size)
            at = minimised(misfit, at.x, steps, own=own)
            own = at.own if size < 0.1 else None
        return settled(misfit, at)

    def _evolved(self, best: Found, dense: FrfData) -> Found:
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

    def _added(self, best: Found, dense: FrfData) -> Found:
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

    def _starts(self, best: Found, dense: FrfData) -> list[Start]:
        """All effects that it has not; of operators those that the first order ranks first."""
        misfit = replace(best.misfit, data=dense)
        at = misfit(best.at.x, best.at.own)
        at = misfit(best.at.x, at.own, keep=True)
        motions = misfit.motions(at)

        def gain(columns: np.ndarray, sd: np.ndarray) -> tuple[float, np.ndarray]:
            return misfit.gain(at, columns, sd)

        free = effects_free(best.structure)
        again = [  # something else may hang on the same link
            e for e in self.prior.repertoire.effects
            if isinstance(e, LocalResonator) and e not in free
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

    def _compete(self, base: Found, starts: Iterable[Start], known: float) -> list[Found]:
        """Starts beside a structure: a few steps each, the best farther, the very best settled."""
        pool = []
        for start in starts:
            tried = [self._few(base, start, x, steps) for x, steps in _placed(base, start)]
            pool += sorted((t for t in tried if t is not None), key=_evidence)[-1:]
        pool.sort(key=_evidence, reverse=True)
        if DEBUG:
            print(
                "      ",
                [
                    (
                        p.structure.effects[-1].label.replace("local_", ""),
                        round(p.evidence - known),
                        _size(p),
                    )
                    for p in pool[:9]
                ],
            )
        pool = [_stepped(p, FURTHER) for p in pool[:FINALISTS] if p.evidence > known - FAR]
        pool.sort(key=_evidence, reverse=True)
        ends = [settled(one.misfit, one.at) for one in pool[:ENDS]]
        if DEBUG:
            print(
                "      settled",
                [
                    (p.structure.effects[-1].label, round(p.evidence - known), _size(p))
                    for p in ends
                ],
            )
        return sorted(ends, key=_evidence, reverse=True)

    def _few(self, base: Found, start: Start, x: np.ndarray, steps: int) -> Found | None:
        structure = base.structure.with_effect(start.effect)
        misfit = replace(base.misfit, structure=structure)
        if not misfit.possible(x):
            return None
        at = minimised(misfit, x, steps, 1.0, base.at.own)
        return Found(misfit, at, misfit.evidence(at))

    def _removed(self, best: Found, newest: Effect | None) -> Found:
        """Without what the others make superfluous, what seems to matter least first."""
        while True:
            costs = removal_costs(best)
            least = sorted((e for e in costs if e is not newest), key=lambda e: costs[e])
            idle = [e for e in least if costs[e] < IDLE]
            groups = ([idle] if len(idle) > 1 else []) + [[e] for e in least if costs[e] < FAR]
            for group in groups:
                fewer = _without(best, group)
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

    def _exchanged(self, best: Found) -> Found:
        """An operator at another link, where that is likelier."""
        for effect in best.structure.effects:
            if effect.springs:
                continue
            base = _without(best, [effect], 4)
            if base is None:
                continue
            at = base.misfit(base.at.x, base.at.own, keep=True)
            motions = base.misfit.motions(at)

            def gain(
                columns: np.ndarray, sd: np.ndarray, base: Found = base, at: At = at
            ) -> tuple[float, np.ndarray]:
                return base.misfit.gain(at, columns, sd)

            psi = best.at.x[best.structure.own[best.structure.effects.index(effect)]]
            others = [
                e for e in effects_free(base.structure)
                if type(e) is type(effect) and e.at != effect.at.split("#")[0]
            ]  # fmt: skip
            starts = [_elsewhere(e, psi, motions, gain) for e in others]
            ends = self._compete(replace(base, at=at), starts, best.evidence)
            if ends and ends[0].evidence > best.evidence + SAME:
                self.tell(f"{effect.label} → {ends[0].structure.effects[-1].label}")
                return converged(ends[0])
        return best

    def _afresh(self, best: Found) -> Found | None:
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
                if Misfit(one, data, self.tolerances).possible(x):
                    tried.append(self._begun(data, one, x))
        fresh = max(tried, key=_evidence, default=None)
        if fresh is None or fresh.evidence < best.evidence + FRESH:
            return None
        self.tell("afresh")
        return fresh

    def _last(self, best: Found) -> Found:
        """On all lines, and at last along what the data leave open."""
        misfit = Misfit(best.structure, self.data(LAST), self.tolerances, max(_size(best), 0.01))
        at = minimised(misfit, best.at.x, 10, own=best.at.own)
        best = settled(misfit, at, rounds=2, steps=15)
        at = minimised(best.misfit, best.at.x, 25, 0.02, best.at.own, by_prior=True)
        return Found(best.misfit, at, best.misfit.evidence(at))


def _that_matters(best: Found) -> Found:
    """Without effects that change the FRFs by less than one would see."""
    while True:
        pairs = zip(best.structure.effects, best.shares, strict=True)
        small = [effect for effect, share in pairs if share < MATTERS]
        fewer = _without(best, small) if small else None
        if fewer is None:
            return best
        best = settled(fewer.misfit, fewer.at)


def settled(misfit: Misfit, at: At, rounds: int = 1, steps: int = SETTLED) -> Found:
    """With a discrepancy of the likeliest size, inferred again after each round of steps."""
    misfit, at = _sized(misfit, at)
    for _ in range(rounds):
        misfit, at = _sized(misfit, minimised(misfit, at.x, steps, own=at.own))
    return Found(misfit, at, misfit.evidence(at) + _of_size(misfit))


def converged(found: Found) -> Found:
    """Fitted on until the evidence stays: half-fitted, any candidate looks useful."""
    for _ in range(5):
        more = settled(found.misfit, found.at, steps=10)
        if more.evidence <= found.evidence + 2:
            return more if more.evidence > found.evidence else found
        found = more
    return found


def _sized(misfit: Misfit, at: At) -> tuple[Misfit, At]:
    """With the likeliest size of the discrepancy, uphill from the present one; what is there."""
    around, known = misfit.around(at.x, at.own), {}

    def worth(k: int) -> float:
        if k not in known:
            one = misfit.with_rho(SIZES[k])
            there = one.weighed(around)
            known[k] = one.evidence(there) + _of_size(one), one, there
        return known[k][0]

    k = int(np.argmin(np.abs(np.log(np.array(SIZES) / _rho(misfit)))))
    while True:
        near = [j for j in (k - 1, k, k + 1) if 0 <= j < len(SIZES)]
        best = max(near, key=worth)
        if best == k:
            return known[k][1], known[k][2]
        k = best


def _of_size(misfit: Misfit) -> float:
    return -0.5 * float((np.log(_rho(misfit) / USUAL) / SPREAD) ** 2)


def _rho(misfit: Misfit) -> float:
    assert misfit.rho is not None
    return misfit.rho


def _size(found: Found) -> float:
    return _rho(found.misfit)


def _evidence(found: Found) -> float:
    return found.evidence


def _stepped(found: Found, steps: int) -> Found:
    at = minimised(found.misfit, found.at.x, steps, 1.0, found.at.own)
    return Found(found.misfit, at, found.misfit.evidence(at) + _of_size(found.misfit))


def removal_costs(found: Found) -> dict[Effect, float]:
    """Nats that each effect's going would cost, all else at its best again, to first order.

    Springs vanish in compliance: their logarithms go by one.
    """
    s = found.structure
    covariance = np.linalg.inv(found.at.normal + s.precision)
    costs = {}
    for effect, own in zip(s.effects, s.own, strict=True):
        change = effect.vanishing(found.at.x[own])
        at = list(range(own.start, own.start + len(change)))
        mine = set(effect.springs)
        springs = [i for i in range(s.stiffnesses) if mine.issuperset(s.parameters[i].blocks)]
        change, at = np.append(change, np.ones(len(springs))), at + springs
        costs[effect] = 0.5 * float(change @ np.linalg.solve(covariance[np.ix_(at, at)], change))
    return costs


def _without(best: Found, effects: Sequence[Effect], steps: int = 5) -> Found | None:
    structure = best.structure
    for effect in effects:
        structure = structure.without(effect)
    misfit = replace(best.misfit, structure=structure)
    x = structure.carried(best.structure, best.at.x)
    if not misfit.possible(x):
        return None
    at = minimised(misfit, x, steps, 1.0, best.at.own)
    return Found(misfit, at, misfit.evidence(at) + _of_size(misfit))


def _placed(base: Found, start: Start) -> list[tuple[np.ndarray, int]]:
    """Where fits with one more effect begin, and their steps."""
    structure = base.structure.with_effect(start.effect)
    x = structure.carried(base.structure, base.at.x)
    effect = structure.effects[-1]
    if not effect.springs:
        x[structure.own[-1]] = start.psi
        if not isinstance(effect, LocalResonator):
            return [(x, 4)]
        light = x.copy()
        light[structure.own[-1].start] -= LIGHTER  # a light one changes little: it can only help
        return [(x, TRIED), (light, TRIED)]
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


def _elsewhere(effect: Effect, psi: np.ndarray, motions: object, gain: object) -> Start:
    """Where one like another begins at its own place; a resonator keeps its frequency."""
    if not isinstance(effect, LocalResonator):
        return effect.starts(motions, gain)[0]
    found = effect.at_frequency(float(np.exp(psi[1])), motions, gain)
    start = found.psi.copy()
    start[2] = psi[2]
    return replace(found, psi=start)


def labels(found: Found) -> Sequence[str]:
    """Of its effects."""
    return [e.label for e in found.structure.effects]
