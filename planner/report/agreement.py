"""Agreement of simulated with measured FRFs as answers state it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planner.diagnosis.diagnose import ThreefoldSimilarity
    from planner.measurement.agreement import Similarity


@dataclass(frozen=True)
class FrfSimilarity:
    """Global FRAC and Frobenius similarity over magnitudes (Birk et al. 2025), 1 where equal.

    None where there is no pose to compare at.
    """

    frac: float | None
    frobenius: float | None

    @classmethod
    def of(cls, found: "Similarity | None") -> "FrfSimilarity":
        """Of what identification and diagnosis find."""
        return cls(None, None) if found is None else cls(found.frac, found.frobenius)


@dataclass(frozen=True)
class SimilarityChange:
    """After an identification, and before it."""

    frac: float | None
    frobenius: float | None
    before: FrfSimilarity


@dataclass(frozen=True)
class HeldOutChange(SimilarityChange):
    """The same at poses that the fit did not see."""

    poses: tuple[str, ...]


@dataclass(frozen=True)
class ThreeSimilarities:
    """The simulation as given, with its own parameters refitted, and with what explains it."""

    nominal: FrfSimilarity
    refitted: FrfSimilarity
    explained: FrfSimilarity

    @classmethod
    def of(cls, found: "ThreefoldSimilarity | None") -> "ThreeSimilarities":
        """None where there is no pose to compare at."""
        if found is None:
            return cls(*(FrfSimilarity(None, None),) * 3)
        sides = found.nominal, found.refitted, found.explained
        return cls(*map(FrfSimilarity.of, sides))


@dataclass(frozen=True)
class HeldOutSimilarities:
    """The same at `poses`, which no fit had seen."""

    poses: tuple[str, ...]
    nominal: FrfSimilarity
    refitted: FrfSimilarity
    explained: FrfSimilarity

    @classmethod
    def at(
        cls, poses: tuple[str, ...], found: "ThreefoldSimilarity | None"
    ) -> "HeldOutSimilarities":
        """Of what was judged there."""
        return cls(poses, **vars(ThreeSimilarities.of(found)))
