"""A diagnosis that was kept: its chapter of a report, what it says beside the campaign's model."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from planner.errors import InputError
from planner.report.springs import RefittedSpring
from planner.words import listed

KEPT = "diagnosis.json"  # as `diagnose --out` writes it


def diagnosis_of(directory: Path, given: Path | None = None) -> Path | None:
    """Where the kept diagnosis is: the folder or file that was named, else the campaign's own."""
    if given is None:
        own = directory / "diagnosis" / KEPT
        return own if own.is_file() else None
    file = given / KEPT if given.is_dir() else given
    if not file.is_file():
        raise InputError(f"{file} does not exist; name what planner diagnose --out has written.")
    return file


def read_diagnosis(file: Path) -> dict[str, Any]:
    """The answer in JSON. Raises InputError where it is none."""
    try:
        found = json.loads(file.read_bytes())
        _ = found["verdict"], found["findings"], found["candidates"]
    except (ValueError, KeyError, TypeError, OSError):
        raise InputError(f"{file} is no answer of planner diagnose; name another.") from None
    return found


def two_answers(springs: Sequence[RefittedSpring], found: Mapping[str, Any]) -> str:
    """Why the campaign's model has other springs than a diagnosis names; "" where it has not.

    `springs` are those of the model, `found` is the diagnosis' answer as JSON.
    """
    names = found.get("place_names") or {}
    # Springs that robot.toml states the model refits, too: they tell nothing apart.
    said = [one["at"] for one in found["findings"] if one["effect"] != "joint_stiffness"]
    told = {names.get(at, at) for at in said if at}
    added = {spring.joint for spring in springs if spring.stated is None} - told
    if not added or not told:
        return ""
    return (
        f"The campaign's model adds springs at {listed(sorted(added))}, which the diagnosis does "
        f"not name. The model predicts, and so lets every joint and the floor tilt "
        f"at once; the diagnosis adds only what the recordings cannot do without, and is what to "
        f"go by for repairs."
    )


def chapter(file: Path) -> dict[str, Any]:
    """The answer, and the first four of its pictures."""
    found = read_diagnosis(file)
    pictures = [Path(p) for p in found.get("plots", ())[:4]]
    return found | {"pictures": [p for p in pictures if p.is_file() and p.suffix == ".png"]}
