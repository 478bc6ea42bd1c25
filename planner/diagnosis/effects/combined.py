"""Two or more effects at once."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from planner.diagnosis.effects.effect import Effect, Setting, Transfer
from planner.diagnosis.thresholds import ODDS_OF_NOTHING, SECOND_EFFECT
from planner.dynamics.gradient import Impedance
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Priors


@dataclass(frozen=True)
class Both(Effect):
    """Effects that act together; ψ is that of the first, then that of the next."""

    members: tuple[Effect, ...] = ()

    name = "both"

    @property
    def prior(self) -> float:
        """As if effects came independently of each other."""
        shares = np.array([m.prior for m in self.members])
        return float(shares.prod() * (SECOND_EFFECT / ODDS_OF_NOTHING) ** (len(shares) - 1))

    @classmethod
    def of(cls, *effects: Effect) -> "Both":
        """The effects together; those that are several already are taken apart."""
        members = tuple(part for e in effects for part in e.parts())
        quantities = tuple(q for m in members for q in m.quantities)
        return cls(" and ".join(m.at for m in members), quantities, members)

    @property
    def artefact(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Whether all members are artefacts."""
        return all(m.artefact for m in self.members)

    def parts(self) -> tuple[Effect, ...]:
        """See `Effect.parts`."""
        return self.members

    def _split(self, psi: np.ndarray) -> Iterator[tuple[Effect, np.ndarray]]:
        first = 0
        for member in self.members:
            last = first + len(member.quantities)
            yield member, psi[first:last]
            first = last

    def structure(self, simulation: Simulation) -> Simulation:
        """One after the other."""
        for member in self.members:
            simulation = member.structure(simulation)
        return simulation

    def priors(self, simulation: Simulation, priors: Priors) -> Priors:
        """One after the other."""
        for member in self.members:
            priors = member.priors(simulation, priors)
        return priors

    def springs(self, simulation: Simulation) -> tuple[str, ...]:
        """Names of all members' springs."""
        return tuple(name for m in self.members for name in m.springs(simulation))

    def impedance(self, setting: Setting, psi: np.ndarray) -> tuple[Impedance, ...]:
        """What all members add; each depends on its own parameters only."""
        return tuple(i for m, own in self._split(psi) for i in m.impedance(setting, own))

    def transfer(self, setting: Setting, psi: np.ndarray) -> Transfer | None:
        """Product of the effects' transfer functions, the last one's nearest to the recorder."""
        left, slopes = None, []
        for member, own in self._split(psi):
            now = member.transfer(setting, own)
            if now is None:
                continue
            if left is None:
                left, slopes = now.left, [now.slope]
                continue
            slopes = [np.einsum("nijf,npjkf->npikf", now.left, s) for s in slopes]
            slopes.append(np.einsum("npijf,njkf->npikf", now.slope, left))
            left = np.einsum("nijf,njkf->nikf", now.left, left)
        return None if left is None else Transfer(left, np.concatenate(slopes, axis=1))

    def rate(self, psi: np.ndarray) -> float | None:
        """Rate of the exponential window, where one of the effects is one."""
        rates = [m.rate(own) for m, own in self._split(psi)]
        return next((r for r in rates if r is not None), None)

    def starts(self) -> np.ndarray:
        """The last effect's starts, all others at their priors' means."""
        last = self.members[-1].starts()
        middle = [q.mean for m in self.members[:-1] for q in m.quantities]
        return np.hstack([np.tile(middle, (len(last), 1)), last])


@dataclass(frozen=True)
class Family(Both):
    """One kind of effect at all its places, by one cause: say, robot.toml lacks all bearings."""

    @property
    def prior(self) -> float:
        """That of a second effect: one cause gives at all these places."""
        return SECOND_EFFECT


def families(effects: Sequence[Effect]) -> list[Effect]:
    """Transverse compliance of all joints that have it, where there are several."""
    kin = [e for e in effects if e.name == "transverse_compliance"]
    if len(kin) < 2:
        return []
    quantities = tuple(q for m in kin for q in m.quantities)
    return [Family(" and ".join(m.at for m in kin), quantities, tuple(kin))]


def together(a: Effect, b: Effect) -> Both | None:
    """Both effects at once; None for the same effect at one place, or for two windows."""
    same = any((x.name, x.at) == (y.name, y.at) for x in a.parts() for y in b.parts())
    both = Both.of(a, b)
    own = [p for p in both.members if p.quantities or p.name == "polarity"]
    order = {"impedance": 0, "rate": 1, "transfer": 2}
    ranks = [order[_acts(p)] for p in own]
    if same or ranks.count(1) > 1:
        return None
    if ranks != sorted(ranks):
        members = tuple(sorted(both.members, key=lambda p: order[_acts(p)]))
        both = Both.of(*members)
    return both


def _acts(effect: Effect) -> str:
    if not effect.artefact:
        return "impedance"
    return "rate" if effect.name == "exponential_window" else "transfer"
