"""Fits of structures to FRFs: one from its beginning on, many beside one another.

Many are tried a few steps each on few lines, and the best go on: on two cores, where there are two.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.effects.effect import Operator, Start, gain_of
from planner.fit.data import FrfData
from planner.fit.departures import departed
from planner.fit.explanations import RARE, added
from planner.fit.fitted import (
    SIZES,
    FitRecord,
    StructureFit,
    Tried,
    evidence_of,
    settled,
    size_of,
    stepped,
)
from planner.fit.gauss_newton import minimised
from planner.fit.misfit import FrfMisfit
from planner.fit.one_more import OneMore
from planner.fit.starts import from_stated, in_place_of, leaders, pulled
from planner.fit.structure import RobotPrior, RobotStructure, effects_free
from planner.frf.frf import Frf
from planner.inference.parallel import parallel_map
from planner.measurement.nuisances import Tolerances

ROUGH, AFAR = (
    14,
    12,
)  # lines a pose: of many a few steps each, and by logarithms from what is stated
ANNEALED = ((0.5, 6), (0.2, 8), (0.07, 8))  # sizes by which a start comes near, and steps at each
LOG_STEPS, NEARER, FEW, OF_ONE, FURTHER = 60, 24, 6, 12, 4  # steps: until near, of many from afar,
# of springs in place of others, of one effect's own numbers, of the best
HOPELESS = 4.0  # nats, below which a further step is not worth it while many are tried
FAR = 100.0  # nats below which nothing is followed
WON_BACK = 0.5  # share of what an effect is worth, below which another does not take its place
TOO_SMALL = 0.5  # of what matters: an effect that changes FRFs by less will hardly be named
FAR_OFF = 0.03  # of |H|, not explained: few steps may not lead home
FOLLOWED, SETTLED, FARTHEST = 6, 3, 3  # how many are followed, settled, come from afar


def all_visits(multiples: Sequence[float], count: int) -> np.ndarray:
    """(count,): those of the visits that follow are 1."""
    return np.append(multiples, np.ones(count - len(multiples)))


def as_found(
    prior: RobotPrior, known: FitRecord, sensors: int = 1
) -> tuple[RobotStructure, np.ndarray]:
    """The structure that was found before, and its numbers; those it lacks as expected."""
    structure = RobotStructure(prior, known.effects, sensors)
    numbers = dict(zip(known.names, known.x, strict=True))
    pairs = zip(structure.names, structure.mean, strict=True)
    return structure, np.array([numbers.get(name, mean) for name, mean in pairs])


@dataclass(frozen=True, eq=False)
class Trials:
    """FRFs measured at q (n, dof) in rad, of a robot known before by `prior`, to fit them."""

    prior: RobotPrior
    frfs: tuple[Frf, ...]
    q: np.ndarray
    band_hz: tuple[float, float]
    tolerances: Tolerances
    on_step: Callable[[str], None] = lambda _: None
    order: np.ndarray | None = None  # as in `FrfData.of`
    floor: float = 0.0  # as in `FrfMisfit`
    readings: tuple[Operator, ...] = ()  # of these poses, that may be wrong
    multiples: tuple[float, ...] = ()  # as in `FrfData`; of poses that follow 1

    def __getstate__(self) -> Mapping[str, object]:
        """For another process, which tells nothing."""
        return vars(self) | {"on_step": _quietly}

    @cached_property
    def _data(self) -> dict[int, FrfData]:
        return {}

    def data(self, lines: int) -> FrfData:
        """On so many lines a pose."""
        if lines not in self._data:
            data = FrfData.of(self.prior, self.frfs, self.q, self.band_hz, lines, self.order)
            self._data[lines] = replace(data, multiples=all_visits(self.multiples, len(self.q)))
        return self._data[lines]

    def again(self, known: FitRecord, data: FrfData, size: float) -> tuple[FrfMisfit, np.ndarray]:
        """The misfit of what was found before on `data`, and its numbers; those it lacks as
        expected."""
        structure, x = as_found(self.prior, known, data.sensors)
        return FrfMisfit(structure, data, self.tolerances, size, self.floor), x

    def free(self, structure: RobotStructure) -> tuple[Operator, ...]:
        """Effects that a structure has not."""
        there = {e.label for e in structure.effects}
        own = (e for e in self.readings if e.label not in there)
        return (*effects_free(structure), *own)

    def begun(
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

    def starts(self, base: StructureFit, lines: int, least: float = 0.0) -> list[Start]:
        """All effects that it has not; of operators those that the first order ranks first, and
        that gain more than `least` nats by it."""
        misfit = replace(base.misfit, data=self.data(lines))
        motions, gain = misfit.first_order(base.at.x, base.at.own)
        free, every = effects_free(base.structure), self.prior.effect_library.effects
        again = (e for e in every if e.several and e not in free)  # more may hang on a link
        far = not explained(base)
        # What is more than its springs comes first, or in the place of springs (`exchanged`).
        first = not added(base)
        tried = [
            e
            for e in (*free, *again)
            if (far or pulled(base, e)) and (first or not e.more_than_springs)
        ]
        kept = leaders([s for e in tried for s in e.starts(motions, gain)], least)
        # Of all joints at all poses the first order tells which it is.
        mine = (e for e in self.free(base.structure) if e not in free)
        read = sorted((s for e in mine for s in e.starts(motions, gain)), key=gain_of)[-1:]
        return kept + [s for s in read if s.gain_nats > max(least, RARE)]

    def compete(
        self,
        base: StructureFit,
        starts: Sequence[Start],
        *,
        count: int = SETTLED,
        behind: float = FAR,
        against: StructureFit | None = None,
    ) -> list[StructureFit]:
        """Starts beside it: a few steps each, the best farther, `count` settled.

        None is followed that by then is so many nats `behind` the base, or has won back less than
        a share of what that is `against` what it shall replace; what could not be named is left
        out.
        """
        data = base.misfit.data
        lines = self.data(ROUGH) if size_of(base) > FAR_OFF else data
        rough = self._on(base, lines)
        pool = parallel_map(lambda s: self._few(rough, s), starts)
        least = rough.evidence - behind
        if against is not None:
            best = self._on(against, lines).evidence
            least = rough.evidence + WON_BACK * (best - rough.evidence)
        near = _best_of_each(p for p in pool if p and p.evidence > least)
        near = _best_of_each(parallel_map(lambda p: self._stepped(p, data), near[:FOLLOWED]))
        named = [f for f in (self._from(p, data) for p in near) if self._may_be_told(base, f)]
        won = named[0].evidence - base.evidence if named else 0.0
        named = [f for f in named if f.evidence - base.evidence >= min(WON_BACK * won, won)][:count]
        ends = parallel_map(lambda f: settled(f.misfit, f.at).tried, named)
        found = (self._from(p, data) for p in ends)
        return sorted(
            (f for f in found if self._may_be_told(base, f)), key=evidence_of, reverse=True
        )

    def _may_be_told(self, fewer: StructureFit, found: StructureFit) -> bool:
        return self.may_be_named(fewer, found, found.structure.effects[-1])

    def may_be_named(self, fewer: StructureFit, found: StructureFit, effect: Operator) -> bool:
        """Whether an effect that is there beside `fewer` changes FRFs enough, or counts anyway."""
        h, other = found.at.motion.accelerance, fewer.at.motion.accelerance
        changed = float(np.linalg.norm(other - h) / np.linalg.norm(h))
        return effect.absorbed or changed >= TOO_SMALL * self.floor

    def _stepped(self, tried: Tried, data: FrfData) -> Tried:
        misfit, x = self.again(tried.record, data, tried.record.size)
        return stepped(misfit, x, FURTHER, tried.record.own).tried

    def _from(self, tried: Tried, data: FrfData) -> StructureFit:
        misfit, x = self.again(tried.record, data, tried.record.size)
        return StructureFit(misfit, misfit(x, tried.record.own), tried.evidence)

    def _on(self, found: StructureFit, data: FrfData) -> StructureFit:
        """The same on other lines, where it would be at its best."""
        misfit = FrfMisfit(
            found.structure, data, self.tolerances, found.misfit.rho, self.floor
        )  # fmt: skip
        at = misfit.kept(found.at.x, found.at.own)
        there = StructureFit(misfit, at, misfit.evidence(at))
        return replace(there, evidence=there.evidence + there.promised)

    def _few(self, base: StructureFit, start: Start) -> Tried | None:
        more = OneMore(base, start.effect)
        begun = more.begun((start.psi, *start.effect.beside(start.psi)))
        ends = [more.tried(own, OF_ONE) for own in begun]
        there = in_place_of(base, more.wider.structure)
        # Far from home what springs make of all else is not linear.
        there += map(more.whole, begun if more.springs and size_of(base) > FAR_OFF else ())
        for x in filter(more.wider.possible, there):
            at = minimised(more.wider, x, FEW, HOPELESS, base.at.own)
            ends.append(StructureFit(more.wider, at, more.wider.evidence(at)).tried)
        return max(ends, key=evidence_of, default=None)

    def begun_with(self, base: StructureFit, start: Start, x: np.ndarray) -> StructureFit:
        """As `begun`, with one effect more than `base` has."""
        return self.begun(base.misfit.data, base.structure.with_effect(start.effect), x)

    def nearest(
        self, base: StructureFit, starts: Sequence[Start]
    ) -> list[tuple[Start, np.ndarray]]:
        """Those that logarithms on few lines bring nearest to the recordings, and where.

        Few steps of all; those that are followed go on until they are near.
        """
        rough = self.data(AFAR)

        def misfit(start: Start) -> FrfMisfit:
            structure = base.structure.with_effect(start.effect)
            return FrfMisfit(structure, rough, self.tolerances, None, self.floor)

        def near(start: Start) -> list[tuple[float, np.ndarray]]:
            there = misfit(start)
            begun = (x for x in from_stated(there.structure, start) if there.possible(x))
            ends = (minimised(there, x, NEARER) for x in begun)
            return [(at.value, at.x) for at in ends]

        def nearer(begun: tuple[Start, np.ndarray]) -> tuple[float, np.ndarray]:
            at = minimised(misfit(begun[0]), begun[1], LOG_STEPS)
            return at.value, at.x

        pairs = zip(starts, parallel_map(near, starts), strict=True)
        ends = sorted(((v, s, x) for s, each in pairs for v, x in each), key=lambda end: end[0])
        followed = [(s, x) for _, s, x in ends[:FOLLOWED]]
        both = zip(followed, parallel_map(nearer, followed), strict=True)
        ends = sorted(((v, s, x) for (s, _), (v, x) in both), key=lambda end: end[0])
        return [(s, x) for _, s, x in ends[:FARTHEST]]


def _quietly(text: str) -> None:
    """What another process tells."""


def explained(found: StructureFit) -> bool:
    """Whether nothing need be missing: as little is left as may be, near what is stated.

    What ended where it may go no farther stands in for something else.
    """
    least, s, x = max(SIZES[0], found.misfit.floor), found.structure, found.at.x
    ended = bool(np.any((x <= s.least) | (x >= s.most)))
    return size_of(found) <= least and not ended and not departed(s, x)


def _best_of_each(pool: Iterable[Tried]) -> list[Tried]:
    best: dict[frozenset[str], Tried] = {}
    for one in sorted(pool, key=evidence_of):
        best[one.record.labels] = one
    return sorted(best.values(), key=evidence_of, reverse=True)
