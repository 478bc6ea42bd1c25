"""Claims of a paper, each with the rule that would call it false, judged on figures of every seed.

A rule stands on bounds of named figures. It does not hold where a figure is at its bound or beyond
it on any seed (a tie is a no), or less than its own spread over seeds away from it in the mean. It
holds where figures are as far on the right side, in the mean over at least two seeds, as the paper
has them, and else in kind. A figure that was not computed cannot be judged, nor can a claim whose
condition (`given`) is not met here.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import SupportsFloat

import numpy as np

HOLDS, IN_KIND, NOT, UNTESTED = "holds", "holds in kind", "does not hold", "not testable here"
Figures = Mapping[str, Sequence[float]]  # values of each seed by the figure's name


@dataclass(frozen=True)
class Bound:
    """What one figure must exceed (`above`) or stay under (`below`).

    `paper`: the paper's own figure. As a number it is from where on the claim holds in full; where
    the paper has words or a picture only, `full` says that.
    """

    figure: str
    above: float | None = None
    below: float | None = None
    full: float | None = None
    paper: float | str = ""

    @property
    def limit(self) -> float:
        """The bound itself."""
        limit = self.above if self.below is None else self.below
        assert limit is not None
        return limit

    @property
    def in_full(self) -> float | None:
        """From where on the claim holds in full; None: wherever it is not false."""
        return self.paper if isinstance(self.paper, int | float) else self.full

    @property
    def false_if(self) -> str:
        """Such as "≤ 0"."""
        return f"{'≤' if self.below is None else '≥'} {self.limit:g}"

    def judged(self, values: Sequence[float], note: str = "") -> "JudgedFigure":
        """The verdict on the figure of every seed (NaN: not computed), and why."""
        each = np.asarray(values, dtype=float)
        known = each[np.isfinite(each)]
        mean, sd = (float(np.mean(known)) if len(known) else None), None
        if len(known) > 1:
            sd = float(np.std(known, ddof=1))
        if not len(each) or len(known) < len(each):
            verdict, why = UNTESTED, "not computed here"
        else:
            verdict, why = self._verdict(each, sd or 0.0)
        paper = f"{self.paper:g}" if isinstance(self.paper, int | float) else self.paper
        return JudgedFigure(self.figure, verdict, paper, tuple(known.tolist()), mean, sd,
                            self.false_if, "; ".join(filter(None, (why, note))))  # fmt: skip

    def _verdict(self, each: np.ndarray, sd: float) -> tuple[str, str]:
        sign, mean = (1.0 if self.below is None else -1.0), float(each.mean())
        worst = float(min(sign * each) * sign)
        if sign * worst <= sign * self.limit:
            return NOT, f"no: {worst:.3g} on the worst seed is {self.false_if}"
        if sign * mean - sd <= sign * self.limit:
            return NOT, f"no: {mean:.3g} is within the spread ({sd:.2g}) of {self.limit:g}"
        if len(each) < 2:
            return IN_KIND, f"in kind: {mean:.3g} on one seed, which has no spread"
        if self.in_full is None:
            return HOLDS, f"yes: {worst:.3g} on the worst seed is not {self.false_if}"
        side = "≥" if self.below is None else "≤"
        if sign * mean >= sign * self.in_full:
            return HOLDS, f"yes: {mean:.3g} in the mean is {side} {self.in_full:g}"
        return IN_KIND, f"in kind: {mean:.3g} in the mean, in full from {side} {self.in_full:g}"


@dataclass(frozen=True)
class JudgedFigure:
    """A figure's verdict and reason; `values` of the seeds on which it was computed."""

    figure: str
    verdict: str
    paper: str
    values: tuple[float, ...]
    mean: float | None
    sd: float | None
    false_if: str
    reason: str

    @property
    def spread(self) -> str:
        """Such as "sd 0.1, 1.2 to 1.4 (3)"."""
        if self.sd is None:
            return f"{len(self.values)} seed" if self.values else "–"
        return f"sd {self.sd:.2g}, {min(self.values):.3g} to {max(self.values):.3g} " \
               f"({len(self.values)})"  # fmt: skip

    @property
    def cells(self) -> tuple[str, ...]:
        """Figure, the paper's, here, spread, false if, reason."""
        here = "–" if self.mean is None else f"{self.mean:.3g}"
        return self.figure, self.paper or "–", here, self.spread, self.false_if, self.reason


class ClaimRule:
    """A sentence of the paper, or one claimed for this program (`ours`), and what it stands on.

    `given`: what must be so for the claim to say anything here.
    """

    def __init__(
        self, sentence: str, *bounds: Bound, ours: bool = False, given: tuple[Bound, ...] = ()
    ) -> None:
        self.sentence, self.bounds, self.ours, self.given = sentence, bounds, ours, given

    @property
    def figures(self) -> tuple[str, ...]:
        """Names of all figures that it needs."""
        return tuple(bound.figure for bound in (*self.bounds, *self.given))


@dataclass(frozen=True)
class PaperClaim:
    """A judged rule: every figure of it, the verdict, and the reason whatever it is.

    `holds`: whether the verdict is that it holds as the paper has it; `why_not`: the reason if not.
    """

    paper: str
    here: str
    holds: bool
    why_not: str = ""
    ours: bool = False
    verdict: str = NOT
    rule: str = ""
    reason: str = ""
    figures: tuple[JudgedFigure, ...] = ()

    @property
    def sentence(self) -> str:
        """The claim, marked where it is not the paper's."""
        return f"(this program) {self.paper}" if self.ours else self.paper

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """As COLUMNS name them, one for each figure; the claim stands in the first."""
        heads = [(self.sentence, self.verdict), *[("", "")] * (len(self.figures) - 1)]
        return [(*h, *figure.cells) for h, figure in zip(heads, self.figures, strict=True)]


COLUMNS = ("verdict", "figure", "the paper's", "here (mean over seeds)", "spread over seeds",
           "false if, on any seed or within the spread", "reason")  # fmt: skip


def in_order(rules: Sequence[ClaimRule], values: Iterable[SupportsFloat]) -> dict[str, float]:
    """Figures by name, from values in the order in which the rules' bounds need them."""
    names = [bound.figure for rule in rules for bound in rule.bounds]
    return dict(zip(names, map(float, values), strict=True))


def gathered(each: Sequence[Mapping[str, float]]) -> dict[str, list[float]]:
    """Figures of all robots by name, from those of each, which may lack some."""
    names = dict.fromkeys(name for one in each for name in one)
    return {name: [one[name] for one in each if name in one] for name in names}


def judge(
    rules: Sequence[ClaimRule], figures: Figures, notes: Mapping[str, str] | None = None
) -> tuple[PaperClaim, ...]:
    """Every rule on the figures of all seeds; `notes` say, by a figure's name, what lies behind."""
    return tuple(_judged(rule, figures, notes or {}) for rule in rules)


def _judged(rule: ClaimRule, figures: Figures, notes: Mapping[str, str]) -> PaperClaim:
    def each(bounds: Sequence[Bound]) -> list[JudgedFigure]:
        return [b.judged(figures.get(b.figure, ()), notes.get(b.figure, "")) for b in bounds]

    judged = each(rule.bounds)
    given = [replace(f, figure=f"given: {f.figure}") for f in each(rule.given)]
    unmet = [f for f in given if f.verdict in (NOT, UNTESTED)]
    # A figure that says no settles it, whatever could not be computed beside it.
    order = (NOT, UNTESTED, IN_KIND, HOLDS)
    verdict = UNTESTED if unmet else min((f.verdict for f in judged), key=order.index)
    decisive = unmet or [f for f in judged if f.verdict == verdict]
    reason = "; ".join(f"{f.figure}: {f.reason}" for f in decisive)
    return PaperClaim(
        rule.sentence,
        "; ".join(f"{f.figure} {f.cells[2]}" for f in judged),
        verdict == HOLDS,
        "" if verdict == HOLDS else reason,
        rule.ours,
        verdict,
        " or ".join(f"{f.figure} {f.false_if}" for f in judged),
        reason,
        tuple(given + judged),
    )
