"""The chapter of the report on a diagnosis that was kept."""

import json
from pathlib import Path
from typing import Any

from planner.errors import InputError
from planner.report.page.html import Markup, bullets, joined, picture, section, table, tag

KEPT = "diagnosis.json"  # as `diagnose --out` writes it
LEAST_SHOWN = 5e-4  # of a probability in the table: 0.05 %
MOST_PICTURES = 4


def diagnosis_of(directory: Path, given: Path | None) -> Path | None:
    """Where the kept diagnosis is: the folder or file that was named, else the campaign's own."""
    if given is None:
        own = directory / "diagnosis" / KEPT
        return own if own.is_file() else None
    file = given / KEPT if given.is_dir() else given
    if not file.is_file():
        raise InputError(f"{file} does not exist; name what planner diagnose --out has written.")
    return file


def diagnosis(file: Path) -> Markup:
    """Verdict, findings, what else was considered, agreement."""
    found = _read(file)
    parts: list[object] = [tag("p", tag("b", found.get("verdict_text", found["verdict"])))]
    for finding in found["findings"]:
        parts.append(tag("p", finding["text"]))
        rows = [
            (name, f"{v['value']:.4g} ± {v['sd']:.2g}", v["unit"])
            for name, v in finding["parameters"].items()
        ]
        parts += [table(("parameter", "value", "unit"), rows)] if rows else []
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


def _read(file: Path) -> dict[str, Any]:
    try:
        found = json.loads(file.read_bytes())
        _ = found["verdict"], found["findings"], found["candidates"]
    except (ValueError, KeyError, TypeError, OSError):
        raise InputError(f"{file} is no answer of planner diagnose; name another.") from None
    return found
