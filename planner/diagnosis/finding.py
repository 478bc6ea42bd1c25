"""What a screen found: an effect at a place, with odds and parameters."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planner.diagnosis.laws.law_at_joints import Laws
    from planner.diagnosis.linear.drift_fit import DriftFits


@dataclass(frozen=True)
class Finding:
    """`log_evidence` is the gain over "nothing of this kind" (natural logarithm).

    `parameters` maps a name to value, standard deviation and unit. `misfit` is χ² per value of the
    fit that says so, ∞ where there is none. No finding is surer than `sure`, and `rivals` are other
    effects at the same place that take a share of its probability; `laws` are their fits, by which
    a further hit can be planned. `wants` says what would have to be measured for it to be told at
    all: until then it is no more than a remark, and what is `slight` stays one. `gain` is the
    factor by which χ² falls where that is so little that physics has to be weighed against it;
    `drift_fits` are those behind a drift.
    """

    effect: str
    at: str | None
    log_evidence: float
    parameters: dict[str, tuple[float, float, str]] = field(default_factory=dict)
    text: str = ""
    misfit: float = float("inf")
    sure: float = 1.0
    rivals: tuple[tuple[str, float], ...] = ()
    laws: "Laws | None" = None
    wants: str = ""
    slight: bool = False
    gain: float = float("inf")
    drift_fits: "DriftFits | None" = None
