"""What is fitted: a robot's springs and inertias, the effects that a structure has, the chain.

All are numbers x with normal priors: ln k of each spring, ln c/k, the bodies' (`inertias`), ψ of
each effect, and the measuring chain's in sds.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import msgspec
import numpy as np

from planner.dynamics.simulation import Elasticity, Simulation
from planner.effects.effect import Operator, SpringPrior
from planner.effects.parameters import Parameter, Parametrisation, parametrise
from planner.effects.structural_damping import MOST as MOST_LOSSY
from planner.effects.table import EffectLibrary
from planner.fit.inertias import BodyNumbers, body_numbers, pseudo_inertia
from planner.fit.linearised import Numbers
from planner.measurement.nuisances import OF_HAMMER, OF_SENSOR
from planner.robot.config import BASE, LOSS_FACTOR_BELOW, Harmonic, Resonator
from planner.robot.elastic_model import ElasticModel
from planner.robot.virtual_joints import OUTER

STIFF = 1e13  # N·m/rad of springs that carry no weight as they do not give
MOST_LOSS = 0.999 * LOSS_FACTOR_BELOW  # that robot.toml takes
REACH = 7.5  # prior sds beyond which nothing is looked for
Levers = tuple[tuple[int, int, float], ...]
LONGEST = 0.5, 1.0, 1.5  # of a step: in logarithms of springs, in sds of bodies and effects, chain


@dataclass(frozen=True, eq=False)
class RobotPrior:
    """What is known of a robot before: of all springs that it may have, and of its bodies.

    `bearings`: whether each is taken to give slightly, and loss factors to be there.
    """

    effect_library: EffectLibrary
    bearings: bool = False

    @cached_property
    def built(self) -> tuple[Operator, ...]:
        """Effects that every robot has."""
        return self.effect_library.as_built() if self.bearings else self.effect_library.there

    @cached_property
    def wide(self) -> Parametrisation:
        """Of the robot with every spring."""
        r = self.effect_library
        return parametrise(r.simulation, r.priors)

    @cached_property
    def carried(self) -> ElasticModel:
        """The robot with every spring, its weight carried by those that robot.toml states."""
        r = self.effect_library
        stiffness = r.simulation.elastic.stiffness.copy()
        stiffness[r.stated : len(r.simulation.robot.config.compliance)] = STIFF
        return r.simulation.elastic.carried_by(stiffness)

    @cached_property
    def stiff(self) -> Parametrisation:
        """Of the robot as stated: its bodies are whole."""
        r = self.effect_library
        return parametrise(r.stiff, r.stiff_priors)

    def stated(self, sensors: int = 1) -> "RobotStructure":
        """The robot as robot.toml states it."""
        return RobotStructure(self, self.effect_library.there, sensors)

    def as_built(self, sensors: int = 1) -> "RobotStructure":
        """With what every robot has, which robot.toml need not state."""
        return RobotStructure(self, self.built, sensors)

    def bodies(self, springs: frozenset[int]) -> tuple[tuple[int, ...], BodyNumbers]:
        """Bodies that move by some of the springs: numbers among all, and theirs."""
        r = self.effect_library
        wide, stiff = r.simulation.elastic, r.stiff.elastic
        joints = {r.simulation.robot.config.compliance[i].joint for i in springs}
        live, nominal, sds, names = [], [], [], []
        per = self.wide.inertia.shape[1]
        for b, name in enumerate(wide.bodies):
            half = b + 1 < len(wide.bodies) and wide.bodies[b + 1].endswith(OUTER)
            if name.endswith(OUTER) and name.removesuffix(OUTER) not in joints:
                continue
            if name == BASE and BASE not in joints:
                continue
            cut = half and wide.bodies[b + 1].removesuffix(OUTER) in joints
            if half and not cut:
                at = stiff.bodies.index(name)
                nominal.append(stiff.inertia[at])
                sds.append(self.stiff.inertia[at])
            else:
                nominal.append(wide.inertia[b])
                sds.append(self.wide.inertia[b])
            live.append(b)
            names += list(self.wide.nuisances[b * per : (b + 1) * per])
        bodies = [wide.bodies[b] for b in live]
        made = body_numbers(r.simulation.robot, bodies, np.array(nominal), np.array(sds), names)
        return tuple(live), made


@dataclass(frozen=True, eq=False)
class RobotStructure:
    """A robot with some effects; `sensors` hear it."""

    prior: RobotPrior
    effects: tuple[Operator, ...] = ()
    sensors: int = 1

    @cached_property
    def springs(self) -> tuple[int, ...]:
        """Numbers of its springs among all: those that robot.toml states, and the effects'."""
        own = range(self.prior.effect_library.stated)
        return tuple(sorted({*own, *(i for e in self.effects for i in e.springs)}))

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Of its springs: all stiffnesses, then the others."""
        mine = set(self.springs)
        return tuple(p for p in self.prior.wide.parameters if mine.issuperset(p.blocks))

    @cached_property
    def stiffnesses(self) -> int:
        """How many of them are stiffnesses."""
        return sum(p.kind == "stiffness" for p in self.parameters)

    @cached_property
    def _bodies(self) -> tuple[tuple[int, ...], BodyNumbers]:
        return self.prior.bodies(frozenset(self.springs))

    @property
    def live(self) -> tuple[int, ...]:
        """Numbers of its bodies among those of the robot with every spring."""
        return self._bodies[0]

    @property
    def bodies(self) -> BodyNumbers:
        """Its bodies' numbers."""
        return self._bodies[1]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of all numbers."""
        return (
            *(p.name for p in self.parameters),
            *self.bodies.names,
            *(f"{n.name} of {e.label}" for e in self.effects for n in e.numbers),
            *(f"chain {k}" for k in range(self.chain.stop - self.chain.start)),
        )

    @cached_property
    def inertial(self) -> slice:
        """Where the bodies' numbers are."""
        return slice(len(self.parameters), len(self.parameters) + self.bodies.size)

    @cached_property
    def own(self) -> tuple[slice, ...]:
        """Where each effect's numbers are."""
        found, at = [], self.inertial.stop
        for effect in self.effects:
            found.append(slice(at, at + len(effect.numbers)))
            at += len(effect.numbers)
        return tuple(found)

    @cached_property
    def chain(self) -> slice:
        """Where the chain's numbers are."""
        at = self.own[-1].stop if self.own else self.inertial.stop
        return slice(at, at + OF_SENSOR * self.sensors + OF_HAMMER)

    @property
    def size(self) -> int:
        """How many numbers."""
        return self.chain.stop

    @cached_property
    def spread(self) -> np.ndarray:
        """(kinds · e, P) of 0 and 1: the springs' logarithms (ln k, ln c/k, ln η) by x."""
        kinds = 1 + max((KINDS.index(p.kind) for p in self.parameters), default=1)
        out, e = np.zeros((max(kinds, 2), len(self.springs), len(self.parameters))), self.springs
        for number, p in enumerate(self.parameters):
            out[KINDS.index(p.kind), [e.index(b) for b in p.blocks], number] = 1.0
        return out

    @cached_property
    def _known(self) -> dict[int, SpringPrior]:
        """What effects say of stiffnesses, by the numbers of their parameters."""
        told = {spring: p for e in self.effects for spring, p in e.spring_priors.items()}
        springs = enumerate(self.parameters[: self.stiffnesses])
        return {i: told[p.blocks[0]] for i, p in springs if p.blocks[0] in told}

    @cached_property
    def least(self) -> np.ndarray:
        """Where a fit ends: so many sds below what is expected, or where an effect says."""
        low = self.mean - REACH * self.sd
        for i, known in self._known.items():
            low[i] = max(low[i], self.mean[i] - known.shift + known.least)
        for effect, own in zip(self.effects, self.own, strict=True):
            low[own] = np.maximum(low[own], effect.box[0])
        return low

    @cached_property
    def most(self) -> np.ndarray:
        """Where it ends above; what dissipates more than any spring does would flatten peaks."""
        high = self.mean + REACH * self.sd
        for i, p in enumerate(self.parameters):
            if p.kind == "loss_factor":
                high[i] = min(high[i], max(np.log(MOST_LOSSY), self.mean[i]))
        for effect, own in zip(self.effects, self.own, strict=True):
            high[own] = np.minimum(high[own], effect.box[1])
        return high

    @cached_property
    def mean(self) -> np.ndarray:
        """Prior mean of x."""
        springs = [np.log(p.median) for p in self.parameters]
        log_k = {p.blocks: np.log(p.median) for p in self.parameters if p.kind == "stiffness"}
        for i, p in enumerate(self.parameters):
            if p.kind == "damping":
                springs[i] -= log_k[p.blocks]
        for i, known in self._known.items():
            springs[i] += known.shift
        psi = [e.mean for e in self.effects]
        rest = np.zeros(self.chain.stop - self.chain.start)
        return np.concatenate([springs, np.zeros(self.bodies.size), *psi, rest])

    @cached_property
    def sd(self) -> np.ndarray:
        """Prior sd of x."""
        ones = np.ones(self.bodies.size), np.ones(self.chain.stop - self.chain.start)
        springs = [p.log_sd for p in self.parameters]
        for i, known in self._known.items():
            springs[i] = known.log_sd
        return np.concatenate([springs, ones[0], *(e.sd for e in self.effects), ones[1]])

    @cached_property
    def precision(self) -> np.ndarray:
        """Of x before any data: stated stiffnesses may have a deviation in common."""
        covariance = np.diag(self.sd**2)
        shared = np.array([p.shared for p in self.parameters])
        own = slice(0, len(shared))
        covariance[own, own] += np.outer(shared, shared) - np.diag(shared**2)
        return np.linalg.inv(covariance) if shared.any() else np.diag(1 / self.sd**2)

    @cached_property
    def longest(self) -> np.ndarray:
        """Of a step."""
        springs, others, chain = LONGEST
        parts = [np.full(len(self.parameters), springs), np.full(self.bodies.size, others)]
        parts += [others * e.sd for e in self.effects]
        return np.concatenate([*parts, np.full(self.chain.stop - self.chain.start, chain)])

    @cached_property
    def numbers(self) -> Numbers:
        """What is known of x; springs that robot.toml does not state go in compliance."""
        new = tuple(i for i in range(self.stiffnesses) if not self.parameters[i].stated)
        return Numbers(self.mean, self.precision, self.least, self.most, self.longest, new)

    def elasticity(self, x: np.ndarray) -> Elasticity:
        """Its springs at x; a damper that is not stated stays away."""
        log_k, log_t, *log_eta = self.spread @ x[: len(self.parameters)]
        given = np.any(self.spread, axis=2)
        k = np.exp(log_k)
        damping = np.where(given[1], k * np.exp(log_t), 0.0)
        loss = np.where(given[2], np.exp(log_eta[0]), 0.0) if log_eta else np.zeros(len(k))
        return Elasticity(k, damping, loss)

    def spring_slopes(self, by_block: np.ndarray, out: np.ndarray) -> None:
        """Into (n, P, …) from derivatives (n, kinds · e, …) by ln k, ln c, ln η of each spring."""
        turned = self.spread.copy()
        turned[1] += self.spread[0]  # c = k · (c/k)
        n, blocks, *shape = by_block.shape
        flat = np.ascontiguousarray(by_block).reshape(n, blocks, -1).view(float)
        told = turned.reshape(blocks, -1).T @ flat
        out[:] = told.view(complex).reshape(n, -1, *shape)

    def added_inertia(self, x: np.ndarray) -> np.ndarray:
        """(L, 10): what effects add to the bodies."""
        out = np.zeros_like(self.bodies.nominal)
        for effect, own in zip(self.effects, self.own, strict=True):
            added = effect.inertia(x[own])
            if added is not None:
                out[self.bodies.bodies.index(added[0])] += added[1]
        return out

    def stood_off(self, x: np.ndarray, q: np.ndarray) -> np.ndarray:
        """(n, dof) in rad or m: by how much joints stood beside their readback q (n, dof)."""
        out = np.zeros(q.shape)
        for effect, own in zip(self.effects, self.own, strict=True):
            off = effect.stood_off(q, x[own])
            out += 0.0 if off is None else off
        return out

    def levers(self, x: np.ndarray) -> Levers:
        """Springs that shift others as they turn: numbers of slide and turn, m/rad."""
        pairs = zip(self.effects, self.own, strict=True)
        ends = ((e, float(x[own.stop - 1])) for e, own in pairs)
        return tuple((i, k, sign * z) for e, z in ends for i, k, sign in e.levers if z)

    def massive(self, x: np.ndarray) -> bool:
        """Whether bodies to which effects add something are still such as matter can form."""
        added = self.added_inertia(x)
        changed = added.any(axis=1)
        if not changed.any():
            return True
        there = self.bodies.nominal + self.bodies.difference(x[self.inertial]) + added
        return bool(np.linalg.eigvalsh(pseudo_inertia(there[changed])).min() > 0)

    def stiff(self, x: np.ndarray) -> bool:
        """Whether springs that vary keep some stiffness wherever they are."""
        left = dict(zip(self.springs, self.elasticity(x).stiffness, strict=True))
        for effect, own in zip(self.effects, self.own, strict=True):
            for spring, most in effect.taken(x[own]).items():
                left[spring] -= most
        return min(left.values()) > 0

    def carried(self, other: "RobotStructure", x: np.ndarray) -> np.ndarray:
        """Numbers x of another structure in this one; what that lacks is as expected."""
        known = dict(zip(other.names, x, strict=True))
        out = np.array([known.get(n, m) for n, m in zip(self.names, self.mean, strict=True)])
        bodies, psi = self.bodies, x[other.inertial]
        out[self.inertial] = bodies.regrouped(out[self.inertial], other.bodies, psi)
        return out

    def with_effect(self, effect: Operator) -> "RobotStructure":
        """One more; of a label that is there already the place counts up."""
        taken = sum(e.label.split("#")[0] == effect.label for e in self.effects)
        named = replace(effect, at=f"{effect.at}#{taken + 1}") if taken else effect
        return replace(self, effects=(*self.effects, named))

    def without(self, effect: Operator) -> "RobotStructure":
        """All but one."""
        return replace(self, effects=tuple(e for e in self.effects if e != effect))


KINDS = ("stiffness", "damping", "loss_factor")


def effects_free(structure: RobotStructure) -> tuple[Operator, ...]:
    """Those of the repertoire that it has not."""
    there = {e.label for e in structure.effects}
    return tuple(e for e in structure.prior.effect_library.effects if e.label not in there)


def exported(structure: RobotStructure, x: np.ndarray) -> tuple[Simulation, Sequence[str]]:
    """The simulation that a structure is at x, and the names of its springs' parameters."""
    library = structure.prior.effect_library
    robot = library.simulation.robot
    elasticity = structure.elasticity(x)
    blocks = [robot.config.compliance[i] for i in structure.springs]
    losses: dict[int, float] = {}
    tables: dict[str, list[dict[str, object]]] = {"resonator": [], "harmonic": []}
    for effect, own in zip(structure.effects, structure.own, strict=True):
        values = {
            n.name: (n.value(float(v)), 0.0) for n, v in zip(effect.numbers, x[own], strict=True)
        }
        for key, rows in effect.tables(values).items():
            tables[key] += rows
        losses |= effect.losses(x[own])
    # Loss factors are those of stiffnesses as stated: of the springs as found they are less.
    factors = elasticity.loss_factor.copy()
    for k, spring in enumerate(structure.springs):
        if spring in losses:
            factors[k] = losses[spring] * blocks[k].stiffness / elasticity.stiffness[k]
    pairs = zip(structure.effects, structure.own, strict=True)
    heights = {turn: float(x[own.stop - 1]) for e, own in pairs for _, turn, _ in e.levers}
    blocks = [
        msgspec.structs.replace(
            b, loss_factor=float(min(eta, MOST_LOSS)), height_m=heights.get(i, b.height_m)
        )
        for i, b, eta in zip(structure.springs, blocks, factors, strict=True)
    ]
    resonators, harmonics = (
        tuple(msgspec.convert(row, kind) for row in tables[name])
        for name, kind in (("resonator", Resonator), ("harmonic", Harmonic))
    )
    config = msgspec.structs.replace(
        robot.config,
        compliance=tuple(blocks),
        resonator=(*robot.config.resonator, *resonators),
        harmonic=(*robot.config.harmonic, *harmonics),
    )
    simulation = Simulation(replace(robot, config=config))
    own = simulation.elastic
    small = own.size - len(blocks)
    whole = Elasticity(
        np.append(elasticity.stiffness, own.stiffness[-small:] if small else []),
        np.append(elasticity.damping, own.damping[-small:] if small else []),
        own.loss_factor,
    )
    change = np.zeros_like(own.inertia)
    difference = structure.bodies.difference(x[structure.inertial]) + structure.added_inertia(x)
    for name, values in zip(structure.bodies.bodies, difference, strict=True):
        change[own.bodies.index(name)] += values
    return simulation.changed(whole, change), tuple(p.name for p in structure.parameters)
