"""The report of a proof: report.json, report.md and two pictures."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from planner.prove.run import Proof, told, unseal
from planner.prove.score import BINS, Scored, score, summary
from planner.report.answer import Answer, plain


@dataclass(frozen=True)
class ProofReport(Answer):
    """Answer of `prove`; `seal` is the hash of all sealed answers, `figures` as in `summary`."""

    seal: str
    cases: int
    figures: Mapping[str, Any]
    misses: tuple[Scored, ...]
    report: str

    def to_json(self) -> dict[str, Any]:
        """The figures are keys of their own."""
        found = super().to_json()
        figures = found.pop("figures")
        return {"seal": found.pop("seal"), "cases": found.pop("cases"), **figures, **found}

    def text(self) -> str:
        """The written report."""
        return Path(self.report).read_text(encoding="utf-8")


def prove_report(proof: Proof) -> ProofReport:
    """Unseal and score every case of a proof that was diagnosed, and write all files."""
    scored = []
    for name in sorted(proof.seals):
        found = json.loads(told(proof, name).read_text(encoding="utf-8"))
        scored.append(score(name, unseal(proof, name), found))
    return write(proof, scored)


def write(proof: Proof, scored: Sequence[Scored]) -> ProofReport:
    """Write all files into the proof's folder."""
    figures = summary(scored)
    misses = tuple(s for s in scored if not s.right)
    report = str(proof.folder / "report.md")
    answer = ProofReport(proof.whole, len(scored), figures, misses, report)
    whole = answer.to_json() | {"scored": plain(scored), "seals": proof.seals}
    text = json.dumps(whole, indent=1)
    (proof.folder / "report.json").write_text(text, encoding="utf-8")
    _confusion(scored).savefig(proof.folder / "confusion.png", dpi=110)
    _calibration(scored).savefig(proof.folder / "calibration.png", dpi=110)
    (proof.folder / "report.md").write_text(_markdown(proof, scored, figures), encoding="utf-8")
    return answer


def _name(places: Sequence[tuple[str, str | None]]) -> str:
    if len(places) > 1:
        return "pair"
    return places[0][0] if places else "none"


def _confusion(scored: Sequence[Scored]) -> Figure:
    names = sorted({_name(s.true) for s in scored} | {_name(s.said) for s in scored})
    counts = np.zeros((len(names), len(names)), dtype=int)
    for s in scored:
        counts[names.index(_name(s.true)), names.index(_name(s.said))] += 1
    figure = Figure(figsize=(9, 8), layout="constrained")
    FigureCanvasAgg(figure)
    panel = figure.subplots()
    panel.imshow(counts, cmap="Blues")
    for (i, j), count in np.ndenumerate(counts):
        if count:
            panel.text(j, i, str(count), ha="center", va="center")
    panel.set_xticks(range(len(names)), names, rotation=90)
    panel.set_yticks(range(len(names)), names)
    panel.set_xlabel("said first")
    panel.set_ylabel("concealed")
    return figure


def _calibration(scored: Sequence[Scored]) -> Figure:
    p = np.array([s.probability for s in scored])
    right = np.array([s.right for s in scored], dtype=float)
    place = np.minimum((p * BINS).astype(int), BINS - 1)
    figure = Figure(figsize=(5, 5), layout="constrained")
    FigureCanvasAgg(figure)
    panel = figure.subplots()
    panel.plot([0, 1], [0, 1], color="black", lw=0.8, ls=":")
    for k in np.unique(place):
        there = place == k
        panel.plot(p[there].mean(), right[there].mean(), "o", ms=3 + np.sqrt(there.sum()))
        panel.annotate(str(there.sum()), (p[there].mean(), right[there].mean()))
    panel.set_xlabel("stated probability")
    panel.set_ylabel("share that is right")
    return figure


def _markdown(proof: Proof, scored: Sequence[Scored], figures: dict[str, Any]) -> str:
    lines = [
        f"# Proof on {len(scored)} concealed cases",
        "",
        f"Seal of all answers, printed before the diagnosis: `{proof.whole}`",
        "",
        "| group | right | of |",
        "| --- | --- | --- |",
    ]
    for name, of in {**figures["groups"], "single, linear": figures["single_linear"]}.items():
        lines.append(f"| {name} | {of['right']} | {of['of']} |")
    rest = {k: v for k, v in figures.items() if k not in ("groups", "single_linear")}
    lines += ["", *(f"- {key.replace('_', ' ')}: {value}" for key, value in rest.items())]
    lines += ["", "![confusion](confusion.png) ![calibration](calibration.png)", "", "## Misses"]
    lines += ["", "| case | robot | concealed | change | said | probability |", "|" + " --- |" * 6]
    for s in sorted(scored, key=lambda s: s.detectability):
        if not s.right:
            true = ", ".join(f"{n} {at}" for n, at in s.true) or "nothing"
            said = ", ".join(f"{n} {at or ''}" for n, at in s.said)
            lines.append(
                f"| {s.name} | {s.robot} | {true} | {s.detectability:.2f} | {said} | "
                f"{s.probability:.2f} |"
            )
    return "\n".join([*lines, ""])
