"""Scores as curves over how much the recordings tell of an effect, with Wilson's intervals."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.proof.score import Scored, Shown

EDGES_NATS = (0.0, 5.0, 20.0, 100.0, 1e3, 1e4, 1e5, float("inf"))
CLEARLY_NATS = 20.0  # from which an effect should be named: odds of 5 · 10⁸
Z95 = 1.96
MEASURES = ("nats", "nats_open")


@dataclass(frozen=True)
class Share:
    """`right` of `of`, and Wilson's 95 % interval of the share; the share is None of nothing."""

    right: int
    of: int
    share: float | None
    interval95: tuple[float, float]


@dataclass(frozen=True)
class CurveBin:
    """Effects of which between `least` and `most` (None: no end) nats tell.

    `named`: effect and place are named; `in_set`: or stand in a set of at most two.
    """

    least: float
    most: float | None
    named: Share
    in_set: Share


def share(right: Sequence[bool]) -> Share:
    """Of those that are right."""
    good, n = sum(bool(r) for r in right), len(right)
    if n == 0:
        return Share(0, 0, None, (0.0, 1.0))
    p, square = good / n, Z95**2 / n
    middle = (p + square / 2) / (1 + square)
    half = Z95 * np.sqrt(p * (1 - p) / n + square / (4 * n)) / (1 + square)
    return Share(good, n, p, (max(0.0, float(middle - half)), min(1.0, float(middle + half))))


def nameable(scored: Sequence[Scored]) -> list[Shown]:
    """All concealed effects that the library has a name for."""
    return [e for s in scored for e in s.shown if e.effect != "unknown"]


def curve(effects: Sequence[Shown], measure: str) -> list[CurveBin]:
    """Bin by bin; `measure` is one of MEASURES."""
    out = []
    for least, most in itertools.pairwise(EDGES_NATS):
        there = [e for e in effects if least <= getattr(e, measure) < most]
        named, in_set = share([e.named for e in there]), share([e.in_set for e in there])
        out.append(CurveBin(least, most if np.isfinite(most) else None, named, in_set))
    return out


def clearly(effects: Sequence[Shown], measure: str) -> CurveBin:
    """All from CLEARLY_NATS on."""
    there = [e for e in effects if getattr(e, measure) >= CLEARLY_NATS]
    named, in_set = share([e.named for e in there]), share([e.in_set for e in there])
    return CurveBin(CLEARLY_NATS, None, named, in_set)
