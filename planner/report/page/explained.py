"""The chapter of the report on a diagnosis that was kept."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from planner.report.kept_diagnosis import read_diagnosis, two_answers
from planner.report.page.html import Markup, bullets, joined, picture, section, table, tag
from planner.report.refitted_springs import RefittedSpring

LEAST_SHOWN = 5e-4  # of a probability in the table: 0.05 %
MOST_PICTURES = 4


def diagnosis(file: Path, springs: Sequence[RefittedSpring]) -> Markup:
    """Verdict, findings, what else was considered, agreement; beside the model's `springs`."""
    found = read_diagnosis(file)
    parts: list[object] = [tag("p", tag("b", found.get("verdict_text", found["verdict"])))]
    for finding in found["findings"]:
        parts.append(tag("p", finding["text"]))
        rows = [
            (name, f"{v['value']:.4g} ± {v['sd']:.2g}", v["unit"])
            for name, v in finding["parameters"].items()
        ]
        parts += [table(("parameter", "value", "unit"), rows)] if rows else []
    both = two_answers(springs, found)
    parts += [tag("p", both, class_="warn")] if both else []
    shown = [c for c in found["candidates"] if c["probability"] >= LEAST_SHOWN]
    rows = [
        (c["effect"].replace("_", " "), c["at"] or "–", f"{100 * c['probability']:.1f}")
        for c in shown
    ]
    parts.append(table(("explanation", "at", "probability (%)"), rows))
    parts += [_agreement(found), bullets(found.get("remarks", ()))]
    parts += [
        picture(Path(p).read_bytes(), Path(p).stem.replace("_", " "))
        for p in found.get("plots", ())[:MOST_PICTURES]
        if Path(p).is_file() and Path(p).suffix == ".png"
    ]
    return section("What the simulation lacks", joined(parts), id_="diagnosis")


def _agreement(found: dict[str, Any]) -> Markup:
    rows = []
    for where, name in (("fit", "poses used"), ("held_out", "poses held out")):
        for side in ("nominal", "refitted", "explained"):
            one = found.get(where, {}).get(side)
            if one and one.get("frac") is not None:
                rows.append((f"{name}, {side}", f"{one['frac']:.4f}", f"{one['frobenius']:.4f}"))
    return table(("agreement", "Global FRAC", "Frobenius similarity"), rows)
