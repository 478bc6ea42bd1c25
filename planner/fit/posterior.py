"""What is believed of a robot after a fit: its simulation, its FRFs anywhere, and how unsure."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.dynamics.simulation import Simulation
from planner.effects.effect import Operator
from planner.effects.one_visit import OfOneVisit
from planner.fit.data import FrfData
from planner.fit.fitted import StructureFit
from planner.fit.misfit import FrfMisfit
from planner.fit.structure import RobotPrior, RobotStructure, exported
from planner.fit.weights import SHARE
from planner.inference.covariance import covariance_root, inverse
from planner.measurement.measured_frfs import Measured
from planner.measurement.nuisances import Tolerances
from planner.recording.points import TOOL, Layout
from planner.words import significant

# What no structure explains, in shares of |H|, up to which the simulation is followed: of a fit
# that lacks nothing it is 0.001 to 0.015. Chosen.
FOLLOWED = 0.06
LOOKED_AT = 60  # lines of the band, where sds of FRFs are told
MATTERS = 0.01  # share of |H| that a named effect changes: nothing wrong changes up to 0.7 %


@dataclass(frozen=True, eq=False)
class RobotBelief:
    """A structure at x with the covariance of x; `tolerances` of hits, chain and readback."""

    structure: RobotStructure
    x: np.ndarray
    covariance: np.ndarray
    tolerances: Tolerances

    @classmethod
    def stated(cls, prior: RobotPrior, tolerances: Tolerances) -> "RobotBelief":
        """Before anything is measured."""
        structure = prior.stated()
        return cls(structure, structure.mean, inverse(structure.precision), tolerances)

    @cached_property
    def sd(self) -> np.ndarray:
        """(D,) of x."""
        return np.sqrt(np.diagonal(self.covariance))

    @property
    def physical(self) -> slice:
        """Where the numbers of springs, bodies and effects are: all but the chain's."""
        return slice(0, self.structure.chain.start)

    @cached_property
    def simulation(self) -> Simulation:
        """The robot with its effects at x."""
        return exported(self.structure, self.x)[0]

    @cached_property
    def root(self) -> np.ndarray:
        """R with R Rᵀ the covariance of the physical numbers."""
        covariance = self.covariance[self.physical, self.physical]
        unit = np.sqrt(np.diagonal(covariance))
        return unit[:, None] * covariance_root(covariance / np.outer(unit, unit))

    def response(self, q: np.ndarray, frequency_hz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """FRFs (n, 3, 3, F) of the tool in m/s²/N at q (n, dof) in rad, and their sds."""
        means, sds = [], []
        for row in np.atleast_2d(q):
            misfit = FrfMisfit(self.structure, self.at(row[None], frequency_hz), self.tolerances)
            motion = misfit.motion(self.x, None)
            slopes, _ = misfit.slopes(motion, self.x)
            moved = self.root.T @ slopes[0].reshape(slopes.shape[1], -1)
            sd = np.sqrt(np.sum(moved.real**2 + moved.imag**2, axis=0))
            means.append(motion.accelerance[0])
            sds.append(sd.reshape(means[-1].shape))
        return np.array(means), np.array(sds)

    def at(self, q: np.ndarray, frequency_hz: np.ndarray, layout: Layout = TOOL) -> FrfData:
        """Nothing measured at q (n, dof) in rad on lines (F,) or (n, F), between some points."""
        elastic = self.structure.prior.carried
        lines = np.broadcast_to(frequency_hz, (len(q), np.shape(frequency_hz)[-1]))
        ones = np.ones((len(q), *layout.shape, lines.shape[1]))
        measured = Measured(
            lines, 2j * np.pi * lines, ones.astype(complex), ones, np.full(len(q), np.inf), layout
        )
        matrices = elastic.matrices(q, layout=layout)
        return FrfData(q, measured, matrices, elastic.body_jacobians(q))


@dataclass(frozen=True, eq=False)
class RobotPosterior(RobotBelief):
    """What a fit has made of it; `size` is that of the discrepancy."""

    size: float
    found: StructureFit

    @classmethod
    def of(cls, found: StructureFit) -> "RobotPosterior":
        """After a fit."""
        covariance = inverse(found.at.normal + found.structure.precision)
        misfit = found.misfit
        assert misfit.rho is not None
        return cls(found.structure, found.at.x, covariance, misfit.tolerances, misfit.rho, found)

    @property
    def explains(self) -> bool:
        """Whether the structure explains the recordings."""
        return self.size <= FOLLOWED

    def predicted(self, q: np.ndarray, frequency_hz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same; in the sds what no structure explains too, in proportion to the FRFs."""
        mean, sd = self.response(q, frequency_hz)
        rms = np.sqrt(np.mean(np.abs(mean) ** 2, axis=(1, 2), keepdims=True))
        return mean, np.hypot(sd, self.size * np.hypot(np.abs(mean), SHARE * rms))

    @cached_property
    def scale_sd(self) -> float:
        """Relative sd of the FRFs' common scale, which only gains and masses hold."""
        data = self.found.misfit.data
        misfit = replace(self.found.misfit, data=data)
        motion = misfit.motion(self.x, None)
        slopes, _ = misfit.slopes(motion, self.x)
        h = motion.accelerance
        along = np.einsum("nijf,ndijf->d", h.conj(), slopes).real / float(np.sum(np.abs(h) ** 2))
        return float(np.linalg.norm(self.root.T @ along))

    @property
    def lines_hz(self) -> np.ndarray:
        """Some (F,) of the band, where sds of FRFs are told."""
        lines = np.unique(self.found.misfit.data.measured.frequency_hz)
        return lines[:: max(1, len(lines) // LOOKED_AT)]

    @property
    def chain_scale(self) -> tuple[float, float]:
        """By what share the recordings are larger than the robot's FRFs, and what gains allow (sd).

        Of force and of the mean of three channels.
        """
        t, chain = self.tolerances, self.x[self.structure.chain]
        own = np.mean(chain[[0, 4, 8]])
        allowed = float(np.hypot(t.gain / np.sqrt(3), t.force_gain))
        return float(t.gain * own + t.force_gain * chain[-2]), allowed

    def misfits(self, least: float) -> tuple[float, np.ndarray]:
        """Square of what is `residual` over the noise's variance, of all and by pose (n,).

        `least` is a relative sd that counts as noise.
        """
        misfit = self.found.misfit
        m = misfit.data.measured
        noise = np.hypot(m.sd, least * misfit.data.weights.size)
        ratio = np.where(m.used, np.abs(self.residual / noise) ** 2, 0.0)
        count = np.maximum(m.used.sum(axis=(1, 2, 3)), 1)
        return float(ratio.sum() / count.sum()), ratio.sum(axis=(1, 2, 3)) / count

    @cached_property
    def residual(self) -> np.ndarray:
        """(n, r, c, F) in m/s²/N: simulated less measured, once the likeliest misses are out."""
        misfit, at = self.found.misfit, self.found.at
        columns = misfit.around(at.x, at.own).columns
        own = columns[:, self.structure.size : -1]
        return columns[:, -1] + np.einsum("nl,nlijf->nijf", at.own, own)

    def values(self, effect: Operator) -> dict[str, tuple[float, float]]:
        """An effect's stiffnesses and own numbers by name, with sds, in their units."""
        s, sd = self.structure, self.sd
        out = {}
        for i, p in enumerate(s.parameters[: s.stiffnesses]):
            if set(p.blocks) <= {*effect.springs, *effect.spring_priors}:
                out[p.name] = float(np.exp(self.x[i])), float(np.exp(self.x[i]) * sd[i])
        own = s.own[s.effects.index(effect)]
        for number, value, spread in zip(effect.numbers, self.x[own], sd[own], strict=True):
            at = number.value(float(value))
            out[number.name] = at, float(spread * at if number.log else spread)
        return out

    @cached_property
    def words(self) -> tuple[str, ...]:
        """What the structure has beside what is stated and that matters, and by how much."""
        return tuple(
            f"{words} A simulation without it has FRFs {significant(100 * share)} % off."
            for share, words, _ in self._told(artefacts=False)
        )

    @property
    def misread(self) -> tuple[str, ...]:
        """Where recordings are not of what they are said to be of, where that matters."""
        return tuple(words for words, _ in self._otherwise)

    @property
    def of_other_robots(self) -> frozenset[str]:
        """Poses at which something was on the robot, or held it, that is not there elsewhere."""
        effects = (effect for _, effect in self._otherwise)
        return frozenset(e.pose for e in effects if isinstance(e, OfOneVisit) and e.other_robot)

    @cached_property
    def _otherwise(self) -> tuple[tuple[str, Operator], ...]:
        """Of a pose what changes most: the rest stands in for what that has not."""
        told: dict[str, tuple[str, Operator]] = {}
        for _, words, effect in self._told(artefacts=True):
            pose = effect.pose if isinstance(effect, OfOneVisit) else words
            told.setdefault(pose, (words, effect))
        return tuple(told.values())

    def _told(self, artefacts: bool) -> list[tuple[float, str, Operator]]:
        """Shares of FRFs that effects change, largest first, and what each is."""
        told, known = [], dict(zip(self.structure.effects, self.found.shares, strict=True))
        for things in self._things:
            first = things[0]
            share = known[first] if len(things) == 1 else self.found.share_of(things)
            if share >= MATTERS and first.artefact == artefacts:
                words = first.words_together([self.values(effect) for effect in things])
                told.append((share, words.replace(first.at, first.name[1]), first))
        return sorted(told, key=lambda one: one[:2], reverse=True)

    @property
    def _things(self) -> list[list[Operator]]:
        """Effects beside what is stated; those that are one thing together."""
        things: list[list[Operator]] = []
        for effect in self.structure.effects:
            mine = self.values(effect)
            for one in things:
                if one[0].name == effect.name and all(
                    effect.same_thing(mine, self.values(other)) for other in one
                ):
                    one.append(effect)
                    break
            else:
                things += [] if effect.stated else [[effect]]
        return things
