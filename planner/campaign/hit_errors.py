"""Errors of hits in the units of a workshop, and what is systematic in them, in a sentence."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.recording.records import AXES
from planner.words import short_name

SURE = 2.0  # sds from which what hits have in common is told
Pair = tuple[float, float]


@dataclass(frozen=True)
class HitErrorEstimate:
    """A hit at r + o with direction e + δ: δ in ° and o in mm, each with its sd, in the tcp frame.

    The two numbers are those across the hit's axis, in cyclic order after it: x, y of a z hit.
    """

    file: str
    hit: str
    tilt_deg: Pair
    tilt_sd_deg: Pair
    offset_mm: Pair
    offset_sd_mm: Pair

    @property
    def cells(self) -> tuple[str, str, str]:
        """A row of a table: the hit and its file, how it tilts, where it lands."""
        tilt = _beside(self.tilt_deg, self.tilt_sd_deg, self.across, "°")
        named = f"{self.hit} {short_name(self.file, 16)}"
        return named, tilt, _beside(self.offset_mm, self.offset_sd_mm, self.across, " mm")

    @property
    def across(self) -> tuple[str, str]:
        """Letters of the two directions across its axis."""
        axis = AXES.index(self.hit[1])
        return AXES[(axis + 1) % 3], AXES[(axis + 2) % 3]


def systematic_errors(hits: Sequence[HitErrorEstimate]) -> tuple[str, ...]:
    """What errors along a signed axis have in common, where it is sure: a sentence an axis."""
    found = []
    for name in dict.fromkeys(hit.hit for hit in hits):
        group = [hit for hit in hits if hit.hit == name]
        place = _common([h.offset_mm for h in group], [h.offset_sd_mm for h in group])
        tilt = _common([h.tilt_deg for h in group], [h.tilt_sd_deg for h in group])
        said = []
        if lands := _sure(*place, group[0].across, " mm"):
            said.append(f"land {lands}")
        if tilts := _sure(*tilt, group[0].across, "°"):
            said.append(f"tilt by {tilts}")
        if said:
            axis = name.removeprefix("+").replace("-", "−")
            found.append(f"Your {axis} hits {' and '.join(said)}.")
    return tuple(found)


def _common(values: Sequence[Pair], sds: Sequence[Pair]) -> tuple[np.ndarray, np.ndarray]:
    """Mean (2,) and its sd: each hit scatters by itself, what is unsure is so of all alike."""
    each, n = np.array(values), len(values)
    scatter = np.var(each, axis=0, ddof=1) if n > 1 else np.zeros(2)
    return each.mean(axis=0), np.sqrt(scatter / n + np.mean(np.array(sds) ** 2, axis=0))


def _sure(mean: np.ndarray, sd: np.ndarray, across: tuple[str, str], unit: str) -> str:
    told = np.abs(mean) > SURE * sd
    chosen = [(m, s, a) for m, s, a, sure in zip(mean, sd, across, told, strict=True) if sure]
    return " and ".join(
        f"{abs(m):.{_digits(s)}f} ± {s:.{_digits(s)}f}{unit} towards {'+' if m > 0 else '−'}{a}"
        for m, s, a in chosen
    )


def _digits(sd: float) -> int:
    """Places after the point that one figure of an sd needs, two at most."""
    return 0 if sd >= 0.95 else 1 if sd >= 0.095 else 2


def _beside(values: Pair, sds: Pair, across: tuple[str, str], unit: str) -> str:
    both = zip(across, values, sds, strict=True)
    return ", ".join(f"{a} {v:+.{_digits(s)}f} ± {s:.{_digits(s)}f}{unit}" for a, v, s in both)
