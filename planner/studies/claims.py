"""Claims of a paper, each with the rule that would call it false, judged on figures of every seed.

A rule stands on bounds of named figures. It does not hold where a figure is at its bound or beyond
it on any seed (a tie is a no), holds in kind where all are on the right side, and holds where all
are as far on that side as the paper has them. A figure that was not computed cannot be judged.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

HOLDS, IN_KIND, NOT, UNTESTED = "holds", "holds in kind", "does not hold", "not testable here"
Figures = Mapping[str, Sequence[float]]  # values of each seed by the figure's name


@dataclass(frozen=True)
class Bound:
    """What one figure must exceed (`above`) or stay under (`below`), and from where in `full`.

    `paper`: the paper's own figure in words.
    """

    figure: str
    above: float | None = None
    below: float | None = None
    full: float | None = None
    paper: str = ""

    @property
    def false_if(self) -> str:
        """Such as "FRAC gained, points ≤ 0 on any seed"."""
        sign, limit = ("≤", self.above) if self.below is None else ("≥", self.below)
        return f"{self.figure} {sign} {limit:g}"

    def verdict(self, values: Sequence[float]) -> str:
        """Of the figure on every seed; NaN was not computed."""
        each = np.asarray(values, dtype=float)
        if not len(each) or np.isnan(each).any():
            return UNTESTED
        sign, limit = (1.0, self.above) if self.below is None else (-1.0, self.below)
        assert limit is not None
        full = limit if self.full is None else self.full
        if not np.all(sign * each > sign * limit):
            return NOT
        return HOLDS if np.all(sign * each >= sign * full) else IN_KIND


@dataclass(frozen=True)
class ClaimRule:
    """A sentence of the paper, or one claimed for this program (`ours`), and what it stands on."""

    sentence: str
    bounds: tuple[Bound, ...]
    ours: bool = False

    @classmethod
    def of(cls, sentence: str, *bounds: Bound, ours: bool = False) -> "ClaimRule":
        """With its bounds one after the other."""
        return cls(sentence, bounds, ours)


@dataclass(frozen=True)
class PaperClaim:
    """A judged rule: figures of the paper and here, their spread over seeds, verdict and reason.

    `holds`: whether the verdict is that it holds as the paper has it; `why_not`: the reason if not.
    """

    paper: str
    here: str
    holds: bool
    why_not: str = ""
    ours: bool = False
    verdict: str = NOT
    papers_figures: str = ""
    spread: str = ""
    rule: str = ""
    reason: str = ""

    @property
    def row(self) -> tuple[str, ...]:
        """As COLUMNS name it."""
        sentence = f"(this program) {self.paper}" if self.ours else self.paper
        return (sentence, self.verdict, self.papers_figures or "–", self.here, self.spread,
                self.rule, self.reason)  # fmt: skip


COLUMNS = ("verdict", "the paper's figure", "here (mean over seeds)", "spread over seeds",
           "false if, on any seed", "reason")  # fmt: skip


def judge(
    rules: Sequence[ClaimRule], figures: Figures, notes: Mapping[str, str] | None = None
) -> tuple[PaperClaim, ...]:
    """Every rule on the figures of all seeds; `notes` say, by a figure's name, what lies behind."""
    return tuple(_judged(rule, figures, notes or {}) for rule in rules)


def _judged(rule: ClaimRule, figures: Figures, notes: Mapping[str, str]) -> PaperClaim:
    values = {b.figure: list(figures.get(b.figure, ())) for b in rule.bounds}
    each = {b.figure: b.verdict(values[b.figure]) for b in rule.bounds}
    # A figure that says no settles it, whatever could not be computed beside it.
    verdict = next(v for v in (NOT, UNTESTED, IN_KIND, HOLDS) if v in each.values())
    decisive = [b for b in rule.bounds if each[b.figure] == verdict]
    reasons = [_reason(b, verdict, values[b.figure]) for b in decisive]
    if verdict != UNTESTED:
        reasons += dict.fromkeys(notes[b.figure] for b in rule.bounds if b.figure in notes)
    reason = "; ".join(reasons)
    return PaperClaim(
        rule.sentence,
        "; ".join(f"{name} {_mean(v)}" for name, v in values.items()),
        verdict == HOLDS,
        "" if verdict == HOLDS else reason,
        rule.ours,
        verdict,
        "; ".join(b.paper for b in rule.bounds if b.paper),
        "; ".join(_spread(v) for v in values.values()),
        " or ".join(b.false_if for b in rule.bounds),
        reason,
    )


def _reason(bound: Bound, verdict: str, values: Sequence[float]) -> str:
    if verdict == UNTESTED:
        return f"{bound.figure}: not computed here"
    worst = min(values) if bound.below is None else max(values)
    said = f"{bound.figure}: {worst:.3g} on the worst seed"
    if bound.full is None or verdict == NOT:
        return f"{said}, false if {bound.false_if.removeprefix(bound.figure).strip()}"
    sign = "≥" if bound.below is None else "≤"
    only = "" if verdict == HOLDS else "only "
    return f"{said}, in full {only}from {sign} {bound.full:g}"


def _mean(values: Sequence[float]) -> str:
    known = [v for v in values if v == v]
    return f"{np.mean(known):.3g}" if known else "–"


def _spread(values: Sequence[float]) -> str:
    known = [v for v in values if v == v]
    if len(known) < 2:
        return f"{len(known)} seed" if known else "–"
    return f"sd {np.std(known, ddof=1):.2g}, {min(known):.3g} to {max(known):.3g} ({len(known)})"
