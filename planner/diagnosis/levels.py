"""What depends on the force of hits: joints that are not linear, and what no joint explains.

The differences between hits along one axis of a pose are the data; a linear fit of the averages
says how a torque at each joint would change them. Which joint it is, a stiffness and a loss that
go freely with its swing tell; of which kind, laws of two numbers.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from planner.dataset.dataset import Dataset
from planner.diagnosis.levels_hits import HitGroup, JointPort, hit_groups, own_ports
from planner.diagnosis.levels_laws import JointMotions
from planner.diagnosis.levels_weighing import (
    Differences,
    Values,
    Weighed,
    WeighedGroup,
    coloured,
    differences,
    evidence,
    gram_of,
    share_of,
)
from planner.fit.fitted import StructureFit
from planner.inference.log_space import shares
from planner.robot.joint_laws import SHAPES, UNKNOWN, LawTable, Step, numbers_of, stiffening

SIZES = (0.0015, 0.004, 0.01, 0.03, 0.08, 0.2, 0.5)  # of the discrepancy, in shares of |H|
LEAST = 20.0  # nats that a joint must gain: chance gave linear robots up to 14
BY_CHANCE = 0.05  # that levels differ so much, for it to be told where no joint explains it
# Of the differences' square, that laws have to take away; of the first law's nats, that a second
# has to gain: averages that a law has bent left up to 0.14 of them elsewhere.
EXPLAINS = 0.3
# Prior means and sds: of ln of k in the joint's stiffness, of ln of a in its swing, and of what the
# linear fit has of the law's average otherwise, in the joint's stiffness. Chosen wide.
MEAN, SD = np.array([-1.5, -1.2, 0.0, 0.0]), np.array([1.5, 1.2, 0.1, 0.1])
LONGEST = np.array([1.0, 1.0, 0.3, 0.3])  # of a step
FREE = 0.5  # prior sd of a free stiffness, in the joint's
NODES = np.log(np.geomspace(0.05, 2.0, 5))  # of its course over the swing
BENDS = np.geomspace(0.05, 2.5, 6)  # a in the joint's swing, where fits begin
STRONGER = (0.0, 1.0)  # of ln k there, over what the first order tells
# Of a fit: most steps, shares of them that are tried, gain of χ² that ends it; of differences.
STEPS, TRIED, RESTED, SLOPE = 20, (1.0, 0.4, 0.1), 1e-4, 0.05
MOST = 2  # joints


@dataclass(frozen=True)
class LevelLaw:
    """An effect at a joint: nats over a linear one, numbers with sds and units.

    `share` of |H| is by how much hits of different force differ by it. `table` is its entry in
    robot.toml, None for what none describes.
    """

    effect: str
    at: str
    gain_nats: float
    parameters: dict[str, tuple[float, float, str]]
    share: float
    table: LawTable | None = None


@dataclass(frozen=True)
class Levels:
    """How hits of different force differ (`seen`), by which laws, and what these `left` in the
    recordings that are searched.

    `free` are the nats of a stiffness that goes freely with its swing, by joint; `candidates`
    (effect, joint, probability) are all that were weighed for the first law, "unknown" where it is
    none that is named. `laws` have evidence, matter and explain; `unexplained` says that what they
    and smaller ones leave matters and is not chance.
    """

    seen: Differences
    left: Differences
    laws: tuple[LevelLaw, ...] = ()
    free: dict[str, float] = field(default_factory=dict)
    candidates: tuple[tuple[str, str, float], ...] = ()
    unexplained: bool = False

    @property
    def explained(self) -> float:
        """Share of the differences' square that the laws take away."""
        return 1 - (self.left.size / self.seen.size) ** 2 if self.seen.size else 0.0


def level_laws(recorded: Dataset, found: StructureFit, most: int = MOST) -> Levels:
    """Of hits and the linear fit of their averages; laws of so many joints, at most.

    Of several sensors and hit points, the ones most heard tell.
    """
    config = found.structure.prior.effect_library.simulation.robot.config
    groups, ports = hit_groups(recorded.most_heard, found), own_ports(found)
    return laws_of(groups, ports, config.diagnose.matters, most)


def laws_of(
    groups: Sequence[HitGroup], ports: Sequence[JointPort], matters: float, most: int = MOST
) -> Levels:
    """The same of groups of hits; what changes less than `matters` of |H| is no law."""
    if not groups or not ports:
        return Levels(Differences(0.0, 1.0), Differences(0.0, 1.0))
    groups = coloured(groups)
    search, left = _Search(groups, {}), [g.accelerance for g in groups]
    null, rho = search.most_probable(lambda w: evidence(w, left))
    seen = differences(search.at(rho), left)
    found, candidates = Levels(seen, seen), list[tuple[tuple[str, str, float], ...]]()
    joints = {p.at: (p, JointMotions.of(groups, j, p.stiffness)) for j, p in enumerate(ports)}
    while len(found.laws) < most and found.left.size >= matters and joints:
        columns = {at: _columns(motions) for at, (_, motions) in joints.items()}
        gains = {at: gain(search.at(rho), c, left) for at, c in columns.items()}
        at = max(gains, key=lambda at: gains[at])
        worth, lower = search.free(columns[at], left, rho)
        if worth - null < LEAST:
            break
        fits = search.fits(lower, *joints.pop(at), left, null)
        best = max(fits, key=lambda f: f.law.gain_nats)
        candidates.append(_candidates(fits, gains))
        if not found.laws:
            found = replace(found, free=gains, candidates=candidates[0])
        least = max([LEAST, *(EXPLAINS * law.gain_nats for law in found.laws)])
        if best.law.effect == UNKNOWN or best.law.gain_nats < least:
            break
        left = [v - c for v, c in zip(left, best.changes, strict=True)]
        null, rho = search.most_probable(lambda w, left=left: evidence(w, left), best.rho)
        after = differences(search.at(rho), left)
        found = replace(found, laws=(*found.laws, best.law), left=after)
    if found.explained >= EXPLAINS:
        return those_that_matter(found, candidates, matters)
    return replace(found, laws=(), unexplained=found.left.matter(matters, BY_CHANCE))


def those_that_matter(
    found: Levels, candidates: Sequence[tuple[tuple[str, str, float], ...]], matters: float
) -> Levels:
    """Without laws that are too small; `candidates` of each, kept of the first that is left."""
    told = [k for k, law in enumerate(found.laws) if law.share >= matters]
    laws = tuple(found.laws[k] for k in told)
    return replace(found, laws=laws, candidates=candidates[told[0]] if told else ())


def gain(weighed: Weighed, columns: Values, left: Values) -> float:
    """Nats that columns of prior sd 1 gain together."""
    both = zip(columns, left, strict=True)
    gram = gram_of(weighed, [np.append(c, v[None], 0) for c, v in both])
    inner = np.eye(len(gram) - 1) + gram[:-1, :-1]
    gained = gram[:-1, -1] @ np.linalg.solve(inner, gram[:-1, -1])
    return 0.5 * float(gained - np.linalg.slogdet(inner)[1])


def _columns(motions: JointMotions) -> list[np.ndarray]:
    """Of a free stiffness at a joint, by prior sds."""
    nodes = np.log(motions.size) + NODES
    return [FREE * motions.stiffness * c for c in motions.free(nodes)]


@dataclass(frozen=True, eq=False)
class _Fit:
    law: LevelLaw
    changes: list[np.ndarray]
    rho: float


def _candidates(
    fits: Sequence[_Fit], gains: dict[str, float]
) -> tuple[tuple[str, str, float], ...]:
    """Kinds at the best joint by their nats; at others, less by what these gain less."""
    kinds = {f.law.effect: f.law for f in sorted(fits, key=lambda f: f.law.gain_nats)}
    laws = [(law, joint) for joint in gains for law in kinds.values()]
    nats = np.array([law.gain_nats + gains[joint] - gains[law.at] for law, joint in laws])
    each = zip(laws, shares(nats, 0).tolist(), strict=True)
    return tuple(sorted(((law.effect, at, p) for (law, at), p in each), key=lambda c: -c[2]))


def _table(
    port: JointPort, motions: JointMotions, shape: Step, sign: float, p: np.ndarray
) -> LawTable:
    """Of numbers p (4,) of a law in the joint's units."""
    k, a = sign * motions.stiffness * np.exp(p[0]), motions.size * np.exp(p[1])
    both = np.array([k]), np.array([a]), motions.stiffness * p[None, 2:]
    spring, damper = motions.linear(shape, *both)[0] / k
    linear = float(spring), float(damper * motions.groups[0].clock.instant_s)
    return LawTable.of(port.joint, port.slides, shape, float(k), float(a), linear)


@dataclass(frozen=True, eq=False)
class _Point:
    """Numbers p (4,) of a law in the joint's units: value, changes, normal and way down."""

    p: np.ndarray
    value: float
    changes: list[np.ndarray]
    normal: np.ndarray
    down: np.ndarray


@dataclass(frozen=True, eq=False)
class _Search:
    groups: Sequence[HitGroup]
    known: dict[float, Weighed]

    def at(self, rho: float) -> Weighed:
        """All groups at one size of the discrepancy."""
        if rho not in self.known:
            self.known[rho] = [WeighedGroup(g, rho) for g in self.groups]
        return self.known[rho]

    def most_probable(
        self, worth: Callable[[Weighed], float], rho: float = 0.01
    ) -> tuple[float, float]:
        """The largest value, uphill from one of SIZES, and its size."""
        known: dict[int, float] = {}

        def of(i: int) -> float:
            known[i] = known[i] if i in known else worth(self.at(SIZES[i]))
            return known[i]

        k = SIZES.index(rho)
        while True:
            best = max((j for j in (k - 1, k, k + 1) if 0 <= j < len(SIZES)), key=of)
            if best == k:
                return of(k), SIZES[k]
            k = best

    def free(self, columns: Values, left: Values, rho: float) -> tuple[float, float]:
        """Evidence of a free stiffness, and the discrepancy beside it."""
        return self.most_probable(lambda w: evidence(w, left) + gain(w, columns, left), rho)

    def fits(
        self, rho: float, port: JointPort, motions: JointMotions, left: Values, null: float
    ) -> list[_Fit]:
        """Every law at a joint; with a smaller discrepancy once more, as long as that is likelier.

        `null` is the evidence of a linear one.
        """
        found = [self._fit(rho, port, motions, law, left, null) for law in SHAPES]
        # By what the best leaves the others are judged, from where they would begin beside that.
        least = min(f.rho for f in found)
        for i, (law, fit) in enumerate(zip(SHAPES, found, strict=True)):
            if fit.rho > least:
                again = self._fit(least, port, motions, law, left, null)
                found[i] = max(fit, again, key=lambda f: f.law.gain_nats)
        return found

    def _fit(
        self, rho: float, port: JointPort, motions: JointMotions, law: tuple[str, Step],
        left: Values, null: float,
    ) -> _Fit:  # fmt: skip
        """One law at a joint, from a discrepancy."""
        effect, shape = law
        sign, points = self._begun(rho, motions, shape, left)
        now = rho
        while True:
            best = self._descended(self.at(now), motions, shape, sign, points, left)
            after = [v - c for v, c in zip(left, best.changes, strict=True)]
            nats, lower = self.most_probable(lambda w, after=after: evidence(w, after), now)
            if lower >= now:
                break
            now, points = lower, best.p[None]
        cost = np.linalg.slogdet(best.normal)[1] + np.sum(((best.p - MEAN) / SD) ** 2)
        nats -= null + 0.5 * float(cost + 2 * np.log(SD).sum())
        numbers = best.p[:2] + np.log([motions.stiffness, motions.size])
        covariance = np.linalg.inv(best.normal)[:2, :2]
        told = numbers_of(effect, port.slides, sign, numbers, covariance)
        table = None if effect == UNKNOWN else _table(port, motions, shape, sign, best.p)
        share = share_of(self.groups, best.changes)
        return _Fit(LevelLaw(effect, port.at, nats, told, share, table), best.changes, lower)

    def _begun(
        self, rho: float, motions: JointMotions, shape: Step, left: Values
    ) -> tuple[float, np.ndarray]:
        """Sign of k, and points (V, 4): the k that gains most to first order at each angle."""
        both = zip(motions.first_order(shape, motions.size * BENDS), left, strict=True)
        columns = [np.append(motions.stiffness * c, v[None], 0) for c, v in both]
        gram = gram_of(self.at(rho), columns)
        size = np.diag(gram)[:-1] + FREE**-2
        k = gram[:-1, -1] / size
        k = k if shape is stiffening else np.maximum(k, 1e-4)
        sign = np.sign(k[int(np.argmax(k**2 * size))])
        k = np.log(np.where(k * sign > 0, np.abs(k), 1e-4))
        points = [[one + more, bend, 0.0, 0.0] for one, bend in zip(k, np.log(BENDS), strict=True)
                  for more in STRONGER]  # fmt: skip
        return float(sign), np.array(points)

    def _descended(
        self, weighed: Weighed, motions: JointMotions, shape: Step, sign: float,
        points: np.ndarray, left: Values,
    ) -> _Point:  # fmt: skip
        """From the best of some points (V, 4) to the best nearby (Gauss, Newton)."""

        def best_of(many: np.ndarray) -> _Point:
            both = np.concatenate([many, many + np.array([0, SLOPE, 0, 0])])
            k, a = motions.stiffness * np.exp(both[:, 0]), motions.size * np.exp(both[:, 1])
            found = motions.bent(shape, sign * k, a, motions.stiffness * both[:, 2:])
            pairs = zip(many, found, found[len(many) :], strict=False)
            each = (_point(weighed, p, x, y, motions.stiffness, left) for p, x, y in pairs)
            return max(each, key=lambda one: one.value)

        best = best_of(points)
        for _ in range(STEPS):
            step = np.linalg.solve(best.normal, best.down)
            step /= max(1.0, float(np.max(np.abs(step) / LONGEST)))
            new = best_of(best.p + np.outer(TRIED, step))
            gained, best = new.value - best.value, max(new, best, key=lambda one: one.value)
            if gained < RESTED * abs(best.value):
                break
        return best


def _point(
    weighed: Weighed, p: np.ndarray, now: Values, then: Values, stiffness: float, left: Values
) -> _Point:
    """Of changes at p, and at an angle a little larger."""
    each = [
        np.concatenate([[v - c[0], c[0], (b[0] - c[0]) / SLOPE], stiffness * c[1:]])
        for v, c, b in zip(left, now, then, strict=True)
    ]
    gram, away = gram_of(weighed, each), (p - MEAN) / SD
    value = -0.5 * float(gram[0, 0] + away @ away)
    normal, down = gram[1:, 1:] + np.diag(SD**-2.0), gram[1:, 0] - away / SD
    return _Point(p, value, [c[0] for c in now], normal, down)
