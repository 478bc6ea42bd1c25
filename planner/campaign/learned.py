"""What recordings taught a campaign's simulation: a structure, and its parameters."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.identification.extended_structure import FLOOR, ExtendedModel
from planner.identification.parameters import Priors, parametrise
from planner.identification.result import Estimate, Identification
from planner.inference.block_diagonal import block_diagonal
from planner.inference.evidence import laplace
from planner.words import counted

# Misfit (χ² per value) from which the simulation is suspected to lack physics. On generated cells
# that lacked nothing it was 0.5 to 1.4, where a link bent 2.7.
SUSPECT = 2.0
# A spring not stated is named where its stiffness is known to 30 % and no more than that expected.
KNOWN, MATTERS, NAMED = 0.3, 1.0, 4
# Poses from which a place is told as found: from one, neighbours imitate each other (in each of
# four simulated campaigns another spring was told, with a small sd). Chosen.
PLACED = 3


@dataclass(frozen=True, eq=False)
class Learned:
    """What so many `poses` taught the simulation; `suspect` is the misfit that is too large."""

    structure: ExtendedModel
    identified: Identification
    suspect: float = SUSPECT
    poses: int = PLACED

    @property
    def fits(self) -> bool:
        """Whether nothing speaks for physics that it lacks."""
        return self.identified.misfit <= self.suspect

    @property
    def priors(self) -> Priors:
        """Those it was identified with."""
        return self.structure.priors

    def log_evidence(self, temper: float) -> float:
        """Of this structure, by Laplace's method, χ² counting 1/temper."""
        found = self.identified
        p = parametrise(self.structure.simulation, self.structure.priors)
        away = found.mean - np.append(p.mean, np.zeros(len(p.nuisances)))
        prior = block_diagonal(p.precision, np.eye(len(p.nuisances)))
        data = (np.linalg.inv(found.covariance) - prior) * max(found.misfit, 1.0)
        root = np.linalg.cholesky(np.linalg.inv(prior))
        white = root.T @ (data / temper + prior) @ root
        chi2 = found.misfit * found.values
        return laplace(chi2, np.linalg.solve(root, away), white, np.ones(len(away)), temper)

    @property
    def stated(self) -> int:
        """How many springs, the first ones, are not of those that were added."""
        return len(self.structure.simulation.robot.config.compliance) - self.structure.added

    @property
    def unstated(self) -> tuple[Estimate, ...]:
        """Springs that robot.toml does not state, that matter and that the recordings determine.

        The softest first, in units of the stiffest that is stated at the same place.
        """
        springs = [
            e for e in self.identified.estimates
            if e.kind == "stiffness" and min(e.blocks) >= self.stated
        ]  # fmt: skip
        told = [e for e in springs if e.log_sd < KNOWN and e.value < MATTERS * e.prior_median]
        return tuple(sorted(told, key=lambda e: e.value / e.prior_median))

    @property
    def found(self) -> tuple[str, ...]:
        """The same in words."""
        return tuple(
            f"{e.name.removeprefix('stiffness of ')} {e.value:.3g} ± {e.sd:.1g} {e.unit}"
            for e in self.unstated
        )


def likeliest(found: Sequence[Learned]) -> Learned:
    """By the evidence of each structure, χ² counting as the closest one's says."""
    temper = max(1.0, min(one.identified.misfit for one in found))
    return max(found, key=lambda one: one.log_evidence(temper))


def lacking(found: tuple[str, ...], poses: int = PLACED) -> str:
    """What to tell of springs that were `found` at so many poses; as `Learned.found`."""
    text = "The robot gives way where robot.toml has no spring"
    if not found:
        return (
            f"{text}; the recordings do not tell yet where, so the model lets all joints and the "
            f"floor tilt. Measure on."
        )
    more = f" and {len(found) - NAMED} more" if len(found) > NAMED else ""
    named = "; ".join(found[:NAMED])
    if poses < PLACED:
        return (
            f"{text}. It may be {named}{more}, but from {counted(poses, 'pose')} it may as well be "
            f"elsewhere: repair nothing yet, and measure {counted(PLACED - poses, 'more pose')}."
        )
    bolts = " Check the anchor bolts." if FLOOR in named else ""
    return (
        f"{text}: the recordings show {named}{more}, and the model counts on it.{bolts} planner "
        f"diagnose says how sure that is."
    )
