"""A fit with one effect more whose other numbers follow it linearly: a step costs next to nothing.

The effect's own response is exact, all else is eliminated by the columns of the fit without it
(variable projection: Golub and Pereyra 1973), so that only its own few numbers are looked for.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.dynamics.motion import Motion
from planner.effects.effect import Operator
from planner.fit.fitted import StructureFit, Tried
from planner.fit.gauss_newton import minimised
from planner.fit.linearised import At, Numbers, Point
from planner.fit.misfit import FrfMisfit, times

HELD = 1e9  # precisions of what is looked for itself and so does not follow


@dataclass(frozen=True, eq=False)
class OwnPoint(Point):
    """Value in nats more than without the effect; by how much the fit's numbers (D,) follow."""

    followed: np.ndarray


@dataclass(frozen=True, eq=False)
class OneMore:
    """`found`, whose point is `FrfMisfit.kept`, with an effect more: a misfit of its own numbers
    (k,), which `minimised` takes."""

    found: StructureFit
    effect: Operator

    @cached_property
    def wider(self) -> FrfMisfit:
        """With the effect."""
        return self.found.misfit.with_effect(self.effect)

    @cached_property
    def chosen(self) -> list[int]:
        """What is looked for: the effect's numbers, its springs', and those it expects elsewhere
        than they were expected."""
        s, was = self.wider.structure, self.found.structure
        known = {n: (m, sd) for n, m, sd in zip(was.names, was.mean, was.sd, strict=True)}
        springs = [
            i for i in range(len(s.parameters)) if known.get(s.names[i]) != (s.mean[i], s.sd[i])
        ]
        return [*springs, *range(s.own[-1].start, s.own[-1].stop)]

    @property
    def springs(self) -> int:
        """How many of those are springs'."""
        return sum(i < len(self.wider.structure.parameters) for i in self.chosen)

    @cached_property
    def numbers(self) -> Numbers:
        """What is known of them."""
        s, i = self.wider.structure.numbers, self.chosen
        compliant = tuple(k for k, number in enumerate(i) if number in s.compliant)
        precision = np.diag(1 / self.wider.structure.sd[i] ** 2)
        return Numbers(s.mean[i], precision, s.least[i], s.most[i], s.longest[i], compliant)

    @cached_property
    def held(self) -> list[int]:
        """Those of them that the fit without the effect has, too, by its numbers."""
        numbers = {name: k for k, name in enumerate(self.found.structure.names)}
        names = (self.wider.structure.names[i] for i in self.chosen)
        return [numbers[name] for name in names if name in numbers]

    @cached_property
    def at(self) -> At:
        """Where the fit is; what is looked for does not follow."""
        precision = self.found.at.precision.copy()
        precision[self.held, self.held] *= HELD
        return replace(self.found.at, precision=precision)

    @cached_property
    def _worth_held(self) -> tuple[float, float]:
        """What the prior of what is held has in the fit's value, and in its evidence."""
        s, k = self.found.structure, self.held
        away = (self.at.x - s.mean)[k] / s.sd[k]
        open_ = self.found.at.covariance[np.ix_(k, k)]
        volume = np.linalg.slogdet(open_)[1] - 2 * np.sum(np.log(s.sd[k]))
        return 0.5 * float(away @ away), 0.5 * float(volume)

    @cached_property
    def _plain(self) -> np.ndarray:
        return self.found.misfit.through_chain(self.at.x, self.at.motion.accelerance)

    def begun(self, psi: Iterable[np.ndarray]) -> list[np.ndarray]:
        """From each ψ of the effect: new springs hardly give, others are as they were."""
        s = self.wider.structure
        x = s.carried(self.found.structure, self.at.x)
        names = set(self.found.structure.names)
        new = [i for i in self.chosen if i < s.stiffnesses and s.names[i] not in names]
        x[new] += s.sd[new]
        out = []
        for own in psi:
            x[s.own[-1]] = own
            out.append(x[self.chosen].copy())
        return [one for one in out if self.possible(one)]

    def whole(self, own: np.ndarray) -> np.ndarray:
        """x of the structure with the effect, all else as it was."""
        out = self.wider.structure.carried(self.found.structure, self.at.x)
        out[self.chosen] = own
        return out

    def possible(self, x: np.ndarray) -> bool:
        """Whether such a robot can be."""
        return self.wider.possible(self.whole(x))

    def __call__(self, x: np.ndarray, own: np.ndarray | None = None) -> OwnPoint:
        """At numbers x; `own` numbers of poses are those of the fit."""
        k, s = len(x), self.numbers
        there = self.wider.placed(self.whole(x))
        motion = there.motion(self.whole(x), self.at.about)
        columns = self._columns(there, motion, x)
        shown = self.wider.through_chain(self.whole(x), motion.accelerance)
        columns[:, k] = shown - self._plain
        pull, square, follow = self.found.misfit.beside(self.at, columns)
        away = x - s.mean
        value = float(pull[k] + 0.5 * square[k, k] + 0.5 * away @ s.precision @ away)
        value -= self._worth_held[0]
        gradient = pull[:k] + square[:k, k]
        return OwnPoint(x, value, gradient, square[:k, :k], self.at.own, follow[:, k])

    def _columns(self, there: FrfMisfit, motion: Motion, x: np.ndarray) -> np.ndarray:
        """(n, k + 1, r, c, F): by each number, and room for one more."""
        base, s = self.found.misfit, motion.s
        h = motion.accelerance
        springs = self.springs
        out = np.zeros((len(h), len(x) + 1, *h.shape[1:]), dtype=complex)
        psi, own = x[springs:], out[:, springs:-1]
        if springs:
            every = there.spring_slopes(motion, self.whole(x))[:, self.chosen[:springs]]
            out[:, :springs] = base.through_chain(self.at.x, every)
        added = self.effect.impedance(there.poses, psi)
        if added is not None:
            sensor = motion.scaled(motion.x_sensor).swapaxes(1, 2)
            sensor = base.through_chain(self.at.x, sensor).swapaxes(1, 2)
            moved = np.ascontiguousarray(-(s**2)[:, None, None] * motion.x_hit)
            added.gradient(moved, sensor, own)
        off = self.effect.stood_off(base.data.q, np.ones(1))
        if off is not None and motion.by_angle is not None:
            by = np.einsum("nj,nj...->n...", off, motion.by_angle)
            own[:, 0] = base.through_chain(self.at.x, by)
        factor = self.effect.chain(s, psi)
        if factor is not None:
            shown = base.through_chain(self.at.x, h)
            for k, slope in enumerate(factor[1]):
                own[:, k] = times(slope, shown)
        return out

    def tried(self, begun: np.ndarray, steps: int) -> Tried:
        """The fit with the effect after so many steps, all else as the first order has it."""
        at, own = minimised(self, begun, steps, 1.0), self.numbers
        s, x = self.wider.structure, self.whole(at.x)
        moved = self.at.x + at.followed
        if self.found.misfit.possible(moved):
            moved = s.carried(self.found.structure, moved)
            moved[self.chosen] = at.x
            moved = np.clip(moved, s.least, s.most)
            x = moved if self.wider.possible(moved) else x
        volume = np.linalg.slogdet(at.normal + own.precision)[1]
        nats = -at.value - 0.5 * float(volume - np.linalg.slogdet(own.precision)[1])
        known = self.found.tried.record
        record = replace(known, effects=s.effects, names=s.names, x=x)
        return Tried(record, self.found.evidence + nats - self._worth_held[1])
