"""Laws of one joint that were fitted to hits of several levels: weighed, and told."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.diagnosis.finding import Finding
from planner.diagnosis.laws.equivalent_stiffness import System
from planner.diagnosis.laws.fit_in_time import frfs
from planner.diagnosis.laws.law_at_joints import LawMisfit, Laws
from planner.diagnosis.laws.level_data import LevelData
from planner.diagnosis.laws.torque_laws import behaviour
from planner.diagnosis.thresholds import ALIKE, INDEPENDENT, LAW_INEXACT, LAW_UNEXPLAINED, TIED
from planner.inference.evidence import occam, temper, unexplained_shares


@dataclass(frozen=True)
class LevelMisfit:
    """Σ weight |error|² of a linear joint: of the differences between levels, of the strongest.

    `values` is what noise alone would leave of the differences, `noise` of the strongest. A linear
    simulation says that levels do not differ; how closely it follows the strongest may be owed to
    anything else, and another linear fit could follow them to the noise.
    """

    differing: float
    strongest: float
    values: float
    noise: float

    @property
    def linear(self) -> float:
        """What a linear joint leaves at least."""
        return self.differing + self.noise

    @property
    def expected(self) -> float:
        """What noise alone would leave."""
        return self.values + self.noise

    @property
    def excess(self) -> float:
        """What there is to be explained."""
        return max(self.differing - self.values, 1e-9)

    def explained(self, candidate: LawMisfit) -> float:
        """Share of the excess that a law takes away, the strongest being followed as closely."""
        if not np.isfinite(candidate.chi2):
            return -np.inf
        differing = max(candidate.differing - self.values, 0.0)
        strongest = max(candidate.chi2 - candidate.differing - self.strongest, 0.0)
        return 1 - (differing + strongest) / self.excess


@dataclass(frozen=True, eq=False)
class WeighedLaw:
    """A law at a joint: its log evidence over a linear joint, and the share that it explains.

    `levels` is what it was to explain, `volume` what its own numbers cost, in nats.
    """

    candidate: LawMisfit
    at: str
    log_evidence: float
    explained: float
    levels: LevelMisfit
    per_value: float
    parameters: dict[str, tuple[float, float, str]]
    temper: float
    volume: float

    @property
    def gain(self) -> float:
        """Log evidence by the differences between levels alone, over a linear joint.

        `log_evidence` also holds what else the law made fit, or did not: that is no law of levels.
        """
        differing = self.levels.differing - self.candidate.differing
        return differing / self.temper - self.volume


def weighed_laws(
    data: LevelData, system: System, kept: Sequence[LawMisfit]
) -> tuple[WeighedLaw, ...]:
    """Every fitted law of `kept` against a linear joint, the most probable first.

    `system` names the joints. Errors are weighed as if only as many values were independent as the
    best law's misfit allows (`temper`).
    """
    count = 2 * int(np.count_nonzero(data.weight))
    t = temper(min(2 * c.chi2 for c in kept) / count, ALIKE)
    levels = levels_of(data, system)
    out = []
    for c in kept:
        volume = _volume(c, t)
        evidence = (levels.linear - _cost(c)) / t - volume
        explained = levels.explained(c)
        at, per_value = system.ports[c.law.ports[0]], 2 * c.chi2 / count
        parameters = _parameters(c, t)
        own = at, evidence, explained, levels, per_value, parameters, t, volume
        out.append(WeighedLaw(c, *own))
    return tuple(sorted(out, key=lambda w: -w.log_evidence))


def levels_of(data: LevelData, system: System) -> LevelMisfit:
    """What a linear `system` leaves of the strongest hits, and of what weaker ones differ by."""
    weaker, still = data.weaker[:, 0, 0], np.zeros((1, 1, *data.force.shape))
    linear = frfs(data, system, np.array([0]), still)[0]
    each = data.chi2(data.compared(data.h) - np.where(data.weaker, 0.0, linear))
    count = np.count_nonzero(data.weight, axis=(1, 2))
    values, noise = float(np.sum(count[weaker])), float(np.sum(count[~weaker]))
    strongest = max(float(np.sum(each[~weaker])), noise)
    return LevelMisfit(float(np.sum(each[weaker])), strongest, values, noise)


def _cost(candidate: LawMisfit) -> float:
    """χ², and how far springs and inertias had to move from what is stated."""
    mean, sd = candidate.law.law_prior()
    own = (candidate.law.nu.ravel() - mean) / sd
    return candidate.value - 0.5 * float(own @ own)


def _volume(candidate: LawMisfit, temper: float) -> float:
    """What ν costs: ln of how much narrower the data make it than the prior, and its distance."""
    mean, sd = candidate.law.law_prior()
    spread = np.sqrt(np.diagonal(candidate.covariance(temper))[-2:])
    return occam((candidate.law.nu.ravel() - mean) / sd, spread, sd)


def _parameters(candidate: LawMisfit, temper: float) -> dict[str, tuple[float, float, str]]:
    law = candidate.law
    return law.parameters(0, candidate.covariance(temper)[-2:, -2:], LAW_INEXACT)


def shares_of_laws(weighed: Sequence[WeighedLaw]) -> tuple[list[WeighedLaw], tuple[float, ...]]:
    """The laws at the joint of the best, and the shares that all that is not explained gives."""
    at, levels = weighed[0].at, weighed[0].levels
    there = sorted((w for w in weighed if w.at == at), key=lambda w: _cost(w.candidate))
    chi2 = np.array([_cost(w.candidate) for w in there])
    # Below what noise is expected to leave, the best law is as good as any: others count from it.
    beyond = chi2 - min(levels.expected, chi2[0])
    left = np.maximum(beyond, max(LAW_UNEXPLAINED * levels.excess, INDEPENDENT / 2))
    return there, tuple(unexplained_shares(left, INDEPENDENT).tolist())


def law_finding(there: Sequence[WeighedLaw], laws: Laws) -> Finding:
    """The best law `there`, at its joint, with its rivals by name and share."""
    best = there[0]
    others = zip(there[1:], laws.probability[1:], strict=True)
    rivals = {w.candidate.law.effect: share for w, share in others}
    (first, (k, k_sd, unit)), (second, (a, a_sd, other)) = best.parameters.items()
    name = best.candidate.law.effect
    text = (
        f"{best.at.replace('_', ' ').capitalize()} {behaviour(name, k)} "
        f"({first.replace('_', ' ')} {k:.3g} ± {k_sd:.1g} {unit}, {second.replace('_', ' ')} "
        f"{a:.3g} ± {a_sd:.1g} {other}); it explains {100 * best.explained:.0f} % of how FRFs "
        f"change with the force.{_or_else(there[1:], laws.probability[1:])}"
    )
    if borne := best.candidate.law.borne:
        held = f"At rest {100 * borne:.2g} % of its weight hold it at one end of the gap."
        text = f"{text} {held}"
    return Finding(
        name, best.at, best.log_evidence, best.parameters, text, best.per_value, best.explained,
        tuple(rivals.items()), laws,
    )  # fmt: skip


def _or_else(others: Sequence[WeighedLaw], shares: Sequence[float]) -> str:
    """What else the joint may be: the same finding by another name."""
    laws = [w.candidate.law for w in others]
    told = [
        f"{behaviour(law.effect, float(law.k[0]))} ({100 * share:.0f} %)"
        for law, share in zip(laws, shares, strict=True)
        if share > TIED
    ]
    return f" These hits cannot tell it from a joint that {' or '.join(told)}." if told else ""
