"""Agreement of simulated with measured FRFs as answers state it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from msgspec import UNSET
from msgspec import UnsetType as Unset

if TYPE_CHECKING:
    from planner.diagnosis.diagnose import ThreefoldSimilarity
    from planner.measurement.agreement import Similarity


@dataclass(frozen=True)
class FrfSimilarity:
    """Global FRAC and Frobenius similarity over magnitudes (Birk et al. 2025), 1 where equal.

    None where there is no pose to compare at.
    """

    frac: float | None = None
    frobenius: float | None = None

    @classmethod
    def of(cls, found: "Similarity | None") -> "FrfSimilarity":
        """Of what identification and diagnosis find."""
        return cls() if found is None else cls(found.frac, found.frobenius)


@dataclass(frozen=True, kw_only=True)
class SimilarityChange(FrfSimilarity):
    """After an identification, and before it; at `poses` that the fit did not see, or at all."""

    before: FrfSimilarity
    poses: tuple[str, ...] | Unset = UNSET


@dataclass(frozen=True)
class ThreeSimilarities:
    """The simulation as given, with its own parameters refitted, and with what explains it.

    At `poses` that no fit had seen, or at all.
    """

    nominal: FrfSimilarity
    refitted: FrfSimilarity
    explained: FrfSimilarity
    poses: tuple[str, ...] | Unset = UNSET

    @classmethod
    def of(
        cls, found: "ThreefoldSimilarity | None", poses: tuple[str, ...] | Unset = UNSET
    ) -> "ThreeSimilarities":
        """None where there is no pose to compare at."""
        if found is None:
            nothing = FrfSimilarity()
            return cls(nothing, nothing, nothing, poses)
        of = FrfSimilarity.of
        return cls(of(found.nominal), of(found.refitted), of(found.explained), poses)
