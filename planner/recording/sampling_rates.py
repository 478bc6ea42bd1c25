"""Sampling rates of hits: which are the same, and which hits cannot be averaged with the others."""

from collections.abc import Sequence

from planner.recording.records import Hit

# Relative. Times that are rounded to a hundredth of a step, or to six digits, tell the rate of some
# hundred samples better than that; rates that analysers offer lie a percent or more apart. Chosen.
ALIKE = 1e-4


def same_rate(one: Hit, other: Hit) -> bool:
    """Whether two hits were sampled alike, as far as a rounded time column can tell."""
    return abs(one.sampling_rate_hz / other.sampling_rate_hz - 1) <= ALIKE


def sampled_otherwise(hits: Sequence[Hit]) -> tuple[str, ...]:
    """Per hit, at which other rate than most of them it was sampled; "" where it was not."""
    if not hits:
        return ()
    usual = max(hits, key=lambda hit: sum(same_rate(hit, other) for other in hits))
    return tuple(
        "" if same_rate(hit, usual) else
        f"sampled at {hit.sampling_rate_hz:.7g} Hz, the others at {usual.sampling_rate_hz:.7g} Hz"
        for hit in hits
    )  # fmt: skip
