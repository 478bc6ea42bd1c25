"""The report of a proof: report.json, report.md and pictures."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from planner.proof.curves import MEASURES
from planner.proof.pictures import PICTURES
from planner.proof.run import Proof, told, unseal
from planner.proof.score import Scored, score
from planner.proof.summary import summary
from planner.report.answer import Answer, plain
from planner.report.frf_plots import png


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
    for name, draw in PICTURES.items():
        (proof.folder / f"{name}.png").write_bytes(png(draw(scored), dpi=110))
    (proof.folder / "report.md").write_text(_markdown(proof, scored, figures), encoding="utf-8")
    return answer


def _markdown(proof: Proof, scored: Sequence[Scored], figures: dict[str, Any]) -> str:
    lines = [
        f"# Proof on {len(scored)} concealed cases",
        "",
        f"Seal of all answers, printed before the diagnosis: `{proof.whole}`",
        "",
        "Shares with Wilson's 95 % intervals. Nats: what the recordings tell of an effect against",
        "the best robot without it, refitted; hits and measuring chain known, or open too.",
        "",
        *_curves(figures),
        "",
        "| of | right | share |",
        "| --- | --- | --- |",
        *(f"| {name} | {_text(of)} |" for name, of in figures["groups"].items()),
        *(
            f"| {name.replace('_', ' ')} | {_text(of)} |"
            for name, of in figures.items()
            if isinstance(of, dict) and "interval95" in of
        ),
        "",
    ]
    plainly = [k for k, v in figures.items() if not isinstance(v, dict)] + ["own_held_out"]
    lines += [f"- {key.replace('_', ' ')}: {figures[key]}" for key in plainly]
    pictures = ("curves", "confusion", "calibration")
    lines += ["", " ".join(f"![{name}]({name}.png)" for name in pictures), "", "## Misses"]
    return "\n".join([*lines, *_misses(scored), ""])


def _curves(figures: dict[str, Any]) -> list[str]:
    """A table with one row a bin and both measures side by side."""
    heads = ["nats", "named, chain known", "in a set of 2", "named, chain open", "in a set of 2"]
    lines = [f"| {' | '.join(heads)} |", "|" + " --- |" * len(heads)]
    known, opened = (figures["curves"][m] for m in MEASURES)
    ends = [(figures["clearly"][m],) for m in MEASURES]
    for a, b in zip([*known, *ends[0]], [*opened, *ends[1]], strict=True):
        most = "up" if a["most"] is None else f"{a['most']:g}"
        cells = [_text(row[of], " · ") for row in (a, b) for of in ("named", "in_set")]
        lines.append(f"| {a['least']:g} – {most} | {' | '.join(cells)} |")
    return lines


def _text(of: dict[str, Any], between: str = " | ") -> str:
    if not of["of"]:
        return f"0/0{between}"
    low, high = of["interval95"]
    return f"{of['right']}/{of['of']}{between}{of['share']:.0%} ({low:.0%}–{high:.0%})"


def _misses(scored: Sequence[Scored]) -> list[str]:
    heads = ["case", "robot", "concealed (nats)", "said", "falsely named", "probability"]
    lines = ["", f"| {' | '.join(heads)} |", "|" + " --- |" * len(heads)]
    for s in scored:
        if not s.right:
            true = ", ".join(f"{e.effect} {e.at or ''} ({e.nats_open:.3g})" for e in s.shown)
            said, false = (
                ", ".join(f"{n} {at or ''}" for n, at in of) for of in (s.said, s.false_names)
            )
            lines.append(
                f"| {s.name} | {s.robot} | {true or 'nothing'} | {said} | {false} | "
                f"{s.probability:.2f} |"
            )
    return lines
