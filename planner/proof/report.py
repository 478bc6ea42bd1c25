"""The report of a proof: report.json, report.md and two pictures."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from planner.proof.score import Place, Scored, Share, by_probability, figures
from planner.report.answer import Done, plain
from planner.report.pictures import png
from planner.report.plot_marks import empty, write_values


def write(folder: Path, seal: str, scored: Sequence[Scored]) -> Done:
    """Answer of `prove`, once all files are in a folder; `seal` is the hash of all sealed answers.

    Its keys are those of `score.figures`, and "misses".
    """
    found = figures(scored)
    misses = tuple(s for s in scored if not s.right)
    own, report = {"seal": seal, "cases": len(scored)}, folder / "report.md"
    answer = Done(
        {**own, **found, "misses": misses, "report": str(report)}, _markdown(seal, scored, found)
    )
    text = json.dumps(answer.to_json() | {"scored": plain(scored)}, indent=1)
    (folder / "report.json").write_text(text, encoding="utf-8")
    for name, draw in {"confusion": confusion, "calibration": calibration}.items():
        (folder / f"{name}.png").write_bytes(png(draw(scored), dpi=110))
    report.write_text(str(answer.said), encoding="utf-8")
    return answer


def _markdown(seal: str, scored: Sequence[Scored], found: Mapping[str, Any]) -> str:
    shares = {name.replace("_", " "): of for name, of in found.items() if isinstance(of, Share)}
    for way, rows in found["by"].items():
        shares |= {f"by {way}: {name.replace('_', ' ')}": of for name, of in rows.items()}
    plainly = {k: v for k, v in found.items() if isinstance(v, float)}
    lines = [
        f"# Proof on {len(scored)} concealed cases",
        "",
        f"Seal of all answers: `{seal}`",
        "",
        "An effect is required where the best robot without it, refitted, leaves 1.5 times what",
        "matters at poses set aside, and the recordings tell it. Wilson's 95 % intervals.",
        "",
        "| of | right | share |",
        "| --- | --- | --- |",
        *(f"| {name} | {_text(of)} |" for name, of in shares.items()),
        "",
        *(f"- {key.replace('_', ' ')}: {value:.3g}" for key, value in plainly.items()),
        "",
        "![confusion](confusion.png) ![calibration](calibration.png)",
        "",
        "## Misses",
        "",
        "| case | robot | concealed (left, nats) | verdict | named | falsely | probability |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for s in scored:
        if not s.right:
            true = [f"{e.effect} {e.at or ''} ({e.size:.2%}, {e.nats:.3g})" for e in s.shown]
            told = ", ".join(true) or "nothing"
            cells = told, s.verdict, _places(s.named), _places(s.false_names)
            lines.append(f"| {s.name} | {s.robot} | {' | '.join(cells)} | {s.probability:.2f} |")
    return "\n".join([*lines, ""])


def _places(places: Sequence[Place]) -> str:
    return ", ".join(f"{effect} {at or ''}".strip() for effect, at in places)


def _text(of: Share) -> str:
    if of.share is None:
        return "0/0 | "
    low, high = of.interval95
    return f"{of.right}/{of.of} | {of.share:.0%} ({low:.0%}–{high:.0%})"


def _name(places: Sequence[Place]) -> str:
    if len(places) > 1:
        return "pair"
    return places[0][0] if places else "none"


def confusion(scored: Sequence[Scored]) -> Figure:
    """What was concealed against what was said first."""
    true = [_name([(e.effect, e.at) for e in s.shown]) for s in scored]
    said = [_name(s.said) for s in scored]
    names = sorted({*true, *said})
    counts = np.zeros((len(names), len(names)), dtype=int)
    for one, other in zip(true, said, strict=True):
        counts[names.index(one), names.index(other)] += 1
    figure = empty((9, 8))
    panel = figure.subplots()
    image = panel.imshow(np.where(counts > 0, counts, np.nan), cmap="Blues", vmin=0)
    write_values(panel, image, ".0f")
    panel.set_xticks(range(len(names)), names, rotation=90)
    panel.set_yticks(range(len(names)), names)
    panel.set_xlabel("said first")
    panel.set_ylabel("concealed")
    return figure


def calibration(scored: Sequence[Scored]) -> Figure:
    """How often what was said first is right, over its stated probability."""
    figure = empty((5, 5))
    panel = figure.subplots()
    panel.plot([0, 1], [0, 1], color="black", lw=0.8, ls=":")
    for p, right in by_probability(scored):
        panel.plot(p.mean(), right.mean(), "o", ms=3 + np.sqrt(len(p)))
        panel.annotate(str(len(p)), (p.mean(), right.mean()))
    panel.set_xlabel("stated probability")
    panel.set_ylabel("share that is right")
    return figure
