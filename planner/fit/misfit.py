"""How far a structure is from measured FRFs, what belongs to single poses integrated out.

Two residuals: logarithms of ratios lead home from afar, plain ones in units of what is not
explained end there. That is noise, and a discrepancy proportional to |H| that neighbouring lines
share (`ρ`). Hits, readback and what springs and dampers scatter from visit to visit go pose by pose
(Woodbury), linearised about where they were last; the chain is common to all poses.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from planner.dynamics.gradient import Impedance, Inertias, motion_slopes, moved
from planner.dynamics.motion import Motion
from planner.effects.effect import Gain, Motions, Operator
from planner.fit.data import FrfData, among
from planner.fit.inertias import spatial
from planner.fit.linearised import Around, At, Eliminated, Numbers
from planner.fit.structure import REACH, Levers, RobotStructure
from planner.measurement.nuisances import (
    OF_SENSOR,
    NuisanceCounts,
    Tolerances,
    actual_ports,
    basis,
)
from planner.robot.elastic_model import Matrices
from planner.robot.virtual_joints import inertia_basis

FARTHEST = 4.0  # sds of what hits, readback and visits are linearised about
STAYS = 1e-3  # of what a sensor's place scatters by from visit to visit where it is seated again
NOTHING = 1e-9  # of an FRF's size, that has no logarithm


@dataclass(frozen=True, eq=False)
class FrfMisfit:
    """Of a structure on data; `rho` is the discrepancy's size, None: logarithms are compared.

    It is inferred, but never below `floor`: what matters less than that is nobody's concern.
    """

    structure: RobotStructure
    data: FrfData
    tolerances: Tolerances
    rho: float | None = 0.03
    floor: float = 0.0

    @cached_property
    def matrices(self) -> Matrices:
        """Of the structure's springs."""
        return among(self.data.matrices, self.structure.springs)

    @cached_property
    def jacobians(self) -> np.ndarray:
        """(n, L, 6, e) of the structure's bodies."""
        springs, live = list(self.structure.springs), list(self.structure.live)
        return np.ascontiguousarray(self.data.jacobians[:, live][..., springs])

    @property
    def numbers(self) -> Numbers:
        """See `RobotStructure.numbers`."""
        return self.structure.numbers

    def with_rho(self, rho: float | None) -> "FrfMisfit":
        """With a discrepancy of another size; what does not depend on it is kept."""
        return self._keeping(replace(self, rho=rho))

    def with_effect(self, effect: Operator) -> "FrfMisfit":
        """Of a structure with one effect more."""
        other = replace(self, structure=self.structure.with_effect(effect))
        same = other.structure.springs == self.structure.springs
        return self._keeping(other) if same else other

    def _keeping(self, other: "FrfMisfit") -> "FrfMisfit":
        """What hangs on the springs alone."""
        kept = ("matrices", "jacobians", "poses")
        vars(other).update({name: vars(self)[name] for name in kept if name in vars(self)})
        return other

    @cached_property
    def poses(self):
        """As effects see them."""
        return self.data.poses(self.structure)

    def placed(self, x: np.ndarray) -> "FrfMisfit":
        """With matrices where joints stood by x, exactly; itself where none was misread."""
        off = self.structure.stood_off(x, self.data.q)
        if not off.any():
            return self
        return replace(self, data=self.data.stood(off, self.structure.prior.carried))

    def levered(self, x: np.ndarray) -> "FrfMisfit":
        """With matrices where a base turns about axes at the heights of x; else itself."""
        levers = self.structure.levers(x)
        if levers == self.data.levers:
            return self
        if levers not in self._levered:
            self._levered.clear()
            self._levered[levers] = replace(self, data=self.data.levered(levers))
        return self._levered[levers]

    @cached_property
    def _levered(self) -> dict[Levers, "FrfMisfit"]:
        return {}

    # ---------------------------------------------------------------- the model

    def inertias(self, x: np.ndarray) -> np.ndarray:
        """(L, 6, 6): by what bodies differ from the nominal ones."""
        return spatial(self.structure.bodies.difference(x[self.structure.inertial]))

    def mass(self, x: np.ndarray) -> np.ndarray:
        """(n, e, e)."""
        change = np.swapaxes(self.jacobians, 2, 3) @ self.inertias(x) @ self.jacobians
        return self.matrices.mass + change.sum(axis=1)

    def impedances(self, x: np.ndarray) -> list[Impedance | None]:
        """Of each effect; None of those that have none."""
        pairs = zip(self.structure.effects, self.structure.own, strict=True)
        poses = self.levered(x).poses
        return [e.impedance(poses, x[own]) for e, own in pairs]

    def possible(self, x: np.ndarray) -> bool:
        """Whether such a robot can be, and stands."""
        s = self.structure
        if np.any(np.abs((x - s.mean) / s.sd) > REACH + 0.5):
            return False
        matter = np.isfinite(s.bodies.barrier(x[s.inertial])[0]) and s.massive(x)
        if not (matter and s.stiff(x)):
            return False
        try:
            np.linalg.cholesky(self.mass(x))
            stiffness = np.diag(s.elasticity(x).stiffness)
            np.linalg.cholesky(stiffness + self.matrices.geometric)
        except np.linalg.LinAlgError:
            return False
        return True

    def motion(
        self,
        x: np.ndarray,
        eta: np.ndarray | None,
        added: Sequence[Impedance | None] | None = None,
    ) -> Motion:
        """At x, between the ports that hits and sensors had by eta (n, l); None: as stated.

        `added` are the impedances there, if they are known.
        """
        there = self.levered(x)
        m, mass = there.matrices, there.mass(x)
        if m.by_angle is not None:  # slopes by the joints' angles go with the masses as they are
            nominal, now = (np.trace(a, axis1=1, axis2=2) for a in (m.mass, mass))
            scaled = m.by_angle.mass * (now / nominal)[:, None, None, None]
            m = replace(m, by_angle=replace(m.by_angle, mass=scaled))
        s, shape = self.data.measured.s, self.data.measured.accelerance.shape[1:3]
        ports = None
        if eta is not None:
            ports = actual_ports(eta, s, self.tolerances, shape)
        elasticity = self.structure.elasticity(x)
        added = self.impedances(x) if added is None else added
        return moved(m, elasticity, s, mass, [z for z in added if z is not None], ports)

    def slopes(
        self,
        motion: Motion,
        x: np.ndarray,
        out: np.ndarray | None = None,
        added: Sequence[Impedance | None] | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives (n, D − chain, r, c, F) by x, and (n, 2e, r, c, F) by sds of what e springs
        scatter from visit to visit, their dampers with them, and dampers by themselves.

        The former into `out`, where it is given; `added` are the impedances at x, if they are
        known.
        """
        structure, elasticity = self.structure, self.structure.elasticity(x)
        kinds, e = structure.spread.shape[:2]
        numbers = structure.bodies.slopes(x[structure.inertial])
        there, bodies = self.impedances(x) if added is None else added, len(numbers)
        basic = np.broadcast_to(inertia_basis(), (bodies, 10, 6, 6))
        every = Inertias(self.levered(x).jacobians, basic)
        raw = motion_slopes(motion, elasticity, every, [z for z in there if z is not None])
        springs = (3 if elasticity.loss_factor.any() else 2) * e
        by_block, n, shape = raw[:, : kinds * e], len(raw), raw.shape[2:]
        if out is None:
            out = np.empty((n, structure.chain.start, *shape), dtype=complex)
        structure.spring_slopes(by_block, out[:, : len(structure.parameters)])
        out[:, structure.inertial] = 0.0
        for b, (mine, one) in enumerate(zip(structure.bodies.mine, numbers, strict=True)):
            own = raw[:, springs + 10 * b : springs + 10 * (b + 1)].reshape(n, 10, -1)
            moved = (one @ own.view(float)).view(complex)
            at = structure.inertial.start + mine
            out[:, at] += moved.reshape(n, len(mine), *shape)
        at = springs + 10 * bodies
        for impedance, own in zip(there, structure.own, strict=True):
            count = own.stop - own.start if impedance else 0
            out[:, own] = raw[:, at : at + count] if count else 0.0
            at += count
        for effect, own in zip(structure.effects, structure.own, strict=True):
            if effect.levers:
                out[:, own.stop - 1] = self.lever_slope(effect, motion, x)
        t, stiffer, damped = self.tolerances, by_block[:, :e], by_block[:, e:]
        visits = np.empty((n, 2 * e, *shape), dtype=complex)
        np.multiply(stiffer + damped[:, :e], t.visit_stiffness, out=visits[:, :e])
        np.multiply(damped.reshape(n, -1, e, *shape).sum(1), t.visit_damping, out=visits[:, e:])
        return out, visits

    def spring_slopes(self, motion: Motion, x: np.ndarray) -> np.ndarray:
        """Derivatives (n, P, r, c, F) by the springs' numbers alone."""
        s = self.structure
        raw = motion_slopes(motion, s.elasticity(x))[:, : len(s.springs) * len(s.spread)]
        out = np.empty((len(raw), len(s.parameters), *raw.shape[2:]), dtype=complex)
        s.spring_slopes(raw, out)
        return out

    def lever_slope(self, effect: Operator, motion: Motion, x: np.ndarray) -> np.ndarray:
        """Derivative (n, r, c, F) by the number that an effect's levers go with.

        Where turns t shift by N t, Z is D of the base's springs and TᵀZ₁T of all else, T = 1 + zN;
        as N² = 0, H changes as if D did by −(NᵀD + DN) (first order is all there is).
        """
        springs, elasticity, s = self.structure.springs, self.structure.elasticity(x), motion.s
        hit, sensor, out = motion.x_hit, motion.scaled(motion.x_sensor), 0.0
        for slide, turn, sign in effect.levers:
            i, k = springs.index(slide), springs.index(turn)
            lossy = elasticity.stiffness[i] * (1 + 1j * elasticity.loss_factor[i])
            force = (sign * s**2 * (lossy + s * elasticity.damping[i]))[:, None, None]
            both = sensor[:, i, :, None] * hit[:, k, None] + sensor[:, k, :, None] * hit[:, i, None]
            out = out + force * both
        return np.asarray(out)

    def columns(self, x: np.ndarray, eta: np.ndarray) -> tuple[np.ndarray, np.ndarray, Motion]:
        """Accelerance (n, r, c, F), columns (n, D + l + 1, r, c, F) by x and own numbers, motion.

        `eta` (n, all numbers that a pose leaves open) is what they are linearised about; the last
        column is for the residual.
        """
        added, s = self.impedances(x), self.structure
        motion = self.motion(x, eta, added)
        h = motion.accelerance
        open_ = basis(h, motion, self.data.measured.s, self.tolerances)
        numbers, joints = self.nuisance_counts
        own = s.size + numbers.hits + joints
        visit = own + 2 * len(s.springs)
        count = visit + numbers.seated + 1
        out = np.empty((len(h), count, *h.shape[1:]), dtype=complex)
        _, visits = self.slopes(motion, x, out[:, : s.chain.start], added)
        out[:, s.chain] = open_[:, numbers.hits : numbers.known]
        out[:, s.size : s.size + numbers.hits] = open_[:, : numbers.hits]
        out[:, s.size + numbers.hits : own] = open_[:, numbers.known :]
        for effect, at in zip(s.effects, s.own, strict=True):
            off = effect.stood_off(self.data.q, np.ones(1))
            if off is not None and motion.by_angle is not None:
                out[:, at.start] = np.einsum("nj,nj...->n...", off, motion.by_angle)
        out[:, own:visit] = visits
        chain = open_[:, numbers.hits : numbers.known]
        share = self.tolerances.visit_chain * self.seated_shares(self.data.multiples)
        shares = share[:, :, None, None, None]
        np.multiply(chain[:, : numbers.seated], shares, out=out[:, visit:-1])
        return self.through_chain(x, h, out[:, :-1]), out, motion

    def through_chain(
        self, x: np.ndarray, h: np.ndarray, columns: np.ndarray | None = None
    ) -> np.ndarray:
        """What the chain makes of accelerances h (n, r, c, F), and in place of their columns."""
        structure = self.structure
        for effect, own in zip(structure.effects, structure.own, strict=True):
            given = effect.chain(self.data.measured.s, x[own])
            if given is None:
                continue
            raw, (factor, slopes) = h, given
            between = [1] * (raw.ndim - factor.ndim)
            h = times(factor.reshape(len(factor), *between, *factor.shape[1:]), raw)
            if columns is not None:
                columns[:] = times(factor[:, None], columns)
                for k, slope in enumerate(slopes):
                    columns[:, own.start + k] = times(slope, raw)
        return h

    @cached_property
    def nuisance_counts(self) -> tuple[NuisanceCounts, int]:
        """Of hits and chain, and of joints."""
        by_angle = self.matrices.by_angle
        joints = 0 if by_angle is None else by_angle.mass.shape[1]
        return NuisanceCounts.of(self.data.measured.accelerance), joints

    @property
    def seated(self) -> slice:
        """Which columns are of what each visit's chain has for itself."""
        return slice(-1 - self.nuisance_counts[0].seated, -1)

    def seated_shares(self, multiples: np.ndarray | float) -> np.ndarray:
        """(n or 1, m): of each of those columns; a sensor hardly moves that is not seated again."""
        by, seated = np.reshape(multiples, (-1, 1)), np.arange(self.nuisance_counts[0].seated)
        places = seated % OF_SENSOR >= OF_SENSOR - 3
        places[-1] = False  # the hammer's gain
        return by * np.where(places & (by == 1), STAYS, 1.0)

    def zero_nuisances(self) -> np.ndarray:
        """(n, l): own numbers, all 0."""
        numbers, joints = self.nuisance_counts
        visit = 2 * len(self.structure.springs) + numbers.seated
        return np.zeros((len(self.data.q), numbers.hits + joints + visit))

    def about(self, own: np.ndarray, x: np.ndarray) -> np.ndarray:
        """(n, hits + chain + joints), from own numbers and the chain as x has it."""
        numbers, joints = self.nuisance_counts
        chain = np.tile(x[self.structure.chain], (len(own), 1))
        kept = own[:, : numbers.hits + joints]
        return np.hstack([kept[:, : numbers.hits], chain, kept[:, numbers.hits :]])

    def __call__(self, x: np.ndarray, own: np.ndarray | None = None, keep: bool = False) -> At:
        """At x, linearised about own numbers (n, l); those of springs count from 0."""
        return self.weighed(self.around(x, own), keep)

    def around(self, x: np.ndarray, own: np.ndarray | None = None) -> Around:
        """What does not depend on the discrepancy's size."""
        numbers, joints = self.nuisance_counts
        size = numbers.hits + joints
        given = self.zero_nuisances()
        if own is not None:
            given[:, :size] = np.clip(own[:, :size], -FARTHEST, FARTHEST)
        m, d = self.data.measured, self.structure.size
        about = self.about(given, x)
        h, columns, motion = self.placed(x).columns(x, about)
        there = np.einsum("nl,nlijf->nijf", given[:, :size], columns[:, d : d + size])
        if self.rho is None:
            off = h * np.log(np.where(self._told(h), h / m.accelerance, 1.0)) - there
        else:
            off = np.where(m.used, h - m.accelerance, 0.0) - there
        columns[:, -1] = off
        return Around(x, h, columns, motion, about)

    def weighed(self, around: Around, keep: bool = False) -> At:
        """By noise and discrepancy."""
        white = self._white(around.columns, around.accelerance)
        return self._eliminated(around, white, keep)

    def _white(self, columns: np.ndarray, h: np.ndarray) -> np.ndarray:
        """(n, k, N) real, of (n, k, r, c, F)."""
        n, k = columns.shape[:2]
        if self.rho is None:
            told = self._told(h)
            weight = np.where(told, self.data.weights.logarithmic / np.where(told, h, 1.0), 0.0)
            scaled = columns * weight[:, None]
            return np.ascontiguousarray(scaled).reshape(n, k, -1).view(float)
        return self.whitened(columns)

    def _told(self, h: np.ndarray) -> np.ndarray:
        """(n, r, c, F) bool: where both have a logarithm; what no hit moves has none."""
        return self.data.measured.used & (np.abs(h) > NOTHING * self.data.weights.size)

    def whitened(self, columns: np.ndarray, poses: slice = slice(None)) -> np.ndarray:
        """The same of plain residuals, of some poses."""
        n, k, rows, sides, lines = columns.shape
        out = np.empty((n, k, 2, rows, sides, lines))
        assert self.rho is not None
        turned = np.swapaxes(self.data.weights.whitening(self.rho)[poses], -1, -2)
        for part, values in enumerate((columns.real, columns.imag)):
            given = np.moveaxis(np.ascontiguousarray(values), 1, 3)
            np.matmul(given, turned, out=np.moveaxis(out[:, :, part], 1, 3))
        return out.reshape(n, k, -1)

    def _eliminated(self, around: Around, white: np.ndarray, keep: bool) -> At:
        s, d, x = self.structure, self.structure.size, around.x
        count = white.shape[1] - d - 1
        mine = slice(d, d + count)
        gram = white @ np.swapaxes(white, 1, 2)
        factors = np.linalg.cholesky(gram[:, mine, mine] + np.eye(count))
        inverses = np.linalg.inv(factors)
        ontos = inverses @ gram[:, mine]
        flat = ontos.reshape(-1, gram.shape[2])
        whole = gram.sum(axis=0)
        normal = whole[:d, :d] - flat[:, :d].T @ flat[:, :d]
        gradient = whole[:d, -1] - flat[:, :d].T @ flat[:, -1]
        chi2 = float(whole[-1, -1] - flat[:, -1] @ flat[:, -1])
        volume = 2 * float(np.sum(np.log(np.einsum("pii->pi", factors))))
        own = -np.einsum("pji,pj->pi", inverses, ontos[:, :, -1])
        beyond, pull, curvature = s.bodies.barrier(x[s.inertial])
        chi2 += 2 * beyond
        gradient[s.inertial] += pull
        normal[s.inertial, s.inertial] += curvature
        away = x - s.mean
        value = 0.5 * (chi2 + float(away @ s.precision @ away))
        kept = Eliminated(white, inverses, ontos) if keep else None
        there = around.motion, around.about
        return At(x, value, gradient, normal, own, chi2, s.precision, volume, *there, kept)

    # ---------------------------------------------------------------- what follows from it

    def evidence(self, at: At) -> float:
        """ln of the marginal likelihood by Laplace's method, but for a constant."""
        s = self.structure
        away = at.x - s.mean
        prior = float(away @ s.precision @ away)
        spent = np.linalg.slogdet(at.normal + s.precision)[1] - np.linalg.slogdet(s.precision)[1]
        noise = 0.0 if self.rho is None else self.data.weights.volume(self.rho)
        return -0.5 * (at.chi2 + prior + at.volume + noise + float(spent))

    def beside(
        self, at: At, columns: np.ndarray, poses: slice = slice(None)
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What columns (n, k, r, c, F) at some poses do to χ² when all numbers at `at` follow them.

        Half its slopes (k,), half its curvature (k, k), and by how much the numbers (D, k) follow
        each; those are at their best before.
        """
        s, d = self.structure, self.structure.size
        kept, new = at.eliminated, self.whitened(columns, poses)
        assert kept is not None
        both = kept.white[poses] @ np.swapaxes(new, 1, 2)
        taken, k = kept.inverses[poses] @ both[:, d:-1], new.shape[1]
        flat, across = new.transpose(1, 0, 2).reshape(k, -1), taken.reshape(-1, k)
        onto = kept.onto[poses].reshape(len(across), -1)
        square = flat @ flat.T - across.T @ across
        cross = both[:, :d].sum(axis=0) - onto[:, :d].T @ across
        pull = both[:, -1].sum(axis=0) - across.T @ onto[:, -1]
        slope = at.gradient + s.precision @ (at.x - s.mean)
        follow = -at.covariance @ cross
        return pull + follow.T @ slope, square + cross.T @ follow, follow

    def gain(
        self, at: At, columns: np.ndarray, sd: np.ndarray, poses: slice = slice(None)
    ) -> list[tuple[float, np.ndarray]]:
        """See `Gain`."""
        pull, square, _ = self.beside(at, columns, poses)
        found = []
        for first in range(0, len(pull), len(sd)):
            own = slice(first, first + len(sd))
            inner = square[own, own] * np.outer(sd, sd) + np.eye(len(sd))
            z = -np.linalg.solve(inner, pull[own] * sd)
            nats = 0.5 * float(z @ inner @ z) - 0.5 * float(np.linalg.slogdet(inner)[1])
            found.append((nats, z * sd))
        return found

    def first_order(self, x: np.ndarray, own: np.ndarray) -> tuple[Motions, Gain]:
        """How hits and sensors move the springs at x, and what columns gain beside all else."""
        at = self.kept(x, own)
        return self.motions(at), partial(self.gain, at)

    def kept(self, x: np.ndarray, own: np.ndarray) -> At:
        """At x with all that is needed to put columns beside it; own numbers are told once more."""
        return self(x, self(x, own).own, keep=True)

    def motions(self, at: At) -> Motions:
        """How hits and sensors move the springs, as effects' first-order columns need it."""
        motion, x = at.motion, at.x
        sensor = self.through_chain(x, motion.scaled(motion.x_sensor).swapaxes(1, 2)).swapaxes(1, 2)
        m, h = self.data.measured, self.through_chain(x, motion.accelerance)
        by = motion.by_angle
        if by is not None:
            by = np.stack([self.through_chain(x, one) for one in by.swapaxes(0, 1)], 1)
        recorded = np.where(m.used, m.accelerance, h)
        return Motions(self.placed(x).poses, motion.x_hit, sensor, h, recorded, by)


def times(factor: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Factors (…, 3, 3, F) of each sensor times accelerances (…, 3s, c, F)."""
    apart = h.reshape(*h.shape[:-3], h.shape[-3] // 3, 3, *h.shape[-2:])
    return np.einsum("...ijf,...sjcf->...sicf", factor, apart).reshape(h.shape)
