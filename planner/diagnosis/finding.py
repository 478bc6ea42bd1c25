"""What signals tell without any model: an effect at a place, with odds and parameters."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Finding:
    """`log_evidence` is the gain over "nothing of this kind" in nats; `parameters` maps a name to
    value, standard deviation and unit."""

    effect: str
    at: str | None
    log_evidence: float
    parameters: dict[str, tuple[float, float, str]] = field(default_factory=dict)
    text: str = ""
