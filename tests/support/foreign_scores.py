"""Diagnoses of cases by the second engine (`foreign_cells`), by the command, and their scores.

    python -m tests.support.foreign_scores FOLDER --first 1 --cases 40

makes the cases that FOLDER lacks, diagnoses those that have no answer yet, and prints the table.
"""

import argparse
import json
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from planner.diagnosis.thresholds import ARTEFACTS
from planner.program import command
from planner.proof.curves import share
from planner.proof.tree.__main__ import main as make

Place = tuple[str, str | None]
CLEARLY = 20.0  # nats from which an effect is to be named
LIMIT_S = 900.0


@dataclass(frozen=True)
class Scored:
    """What was concealed, with its nats, and what was named; `sets` can't be told apart.

    `beyond` are nats where FRFs err by 1 %, which need not be explained.
    """

    name: str
    true: dict[Place, float]
    beyond: dict[Place, float]
    outsider: bool
    verdict: str
    named: frozenset[Place]
    sets: tuple[frozenset[Place], ...]
    probability: float
    seconds: float

    @property
    def group(self) -> str:
        """Null, outsider, artefact, single or pair."""
        if not self.true:
            return "null"
        if self.outsider:
            return "outsider"
        if len(self.true) > 1:
            return "pair"
        return "artefact" if next(iter(self.true))[0] in ARTEFACTS else "single"

    @property
    def clear(self) -> frozenset[Place]:
        """Effects of a name that the recordings tell clearly."""
        return frozenset(p for p, n in self.true.items() if n >= CLEARLY and p[0] != "unknown")

    @property
    def mattering(self) -> frozenset[Place]:
        """Those that are clear beyond what need not be explained."""
        return frozenset(p for p in self.clear if self.beyond[p] >= CLEARLY)

    @property
    def made_up(self) -> frozenset[Place]:
        """What was named and is not there, nor in a set of two with what is."""
        there = self.true.keys()
        tied = {p for one in self.sets if len(one) <= 2 and one & there for p in one}
        return self.named - there - tied

    def told(self, place: Place, sets: bool = False) -> bool:
        """Whether an effect was named at its place, or with `sets` in a set of at most two."""
        tied = any(len(one) <= 2 and place in one and one & self.named for one in self.sets)
        return place in self.named or (sets and tied)


def scored(case: Path, answer: dict[str, Any]) -> Scored:
    """One case; a diagnosis that failed named nothing."""
    secret = json.loads((case / "answer.json").read_text(encoding="utf-8"))
    true = {(e["effect"], e["at"]): float(e["nats"]) for e in secret["effects"]}
    beyond = {(e["effect"], e["at"]): float(e["nats_at_1_percent"]) for e in secret["effects"]}
    verdict = answer.get("verdict", "failed")
    findings = answer.get("findings", ()) if verdict in ("explained", "unexplained") else ()
    return Scored(
        case.name, true, beyond, secret["outside_library"], verdict,
        frozenset((f["effect"], f["at"]) for f in findings),
        tuple(frozenset((e["effect"], e["at"]) for e in one) for one in answer.get("sets", ())),
        answer["candidates"][0]["probability"] if "candidates" in answer else 0.0,
        answer.get("seconds", 0.0),
    )  # fmt: skip


def diagnosed(folder: Path, seed: int) -> Scored:
    """The case of a seed, made and diagnosed where the folder lacks either."""
    case, told = folder / f"case{seed}", folder / f"case{seed}.json"
    if not (case / "answer.json").exists():
        make([str(case), "--seed", str(seed)])
    if not told.exists():
        robot = str(case / "robot" / "robot.toml")
        asked = command("diagnose", str(case / "recordings"), "--robot", robot, "--json")
        run = subprocess.run(asked, capture_output=True, text=True, timeout=LIMIT_S, check=False)
        failed = json.dumps({"failed": run.stderr})
        told.write_text(run.stdout if run.returncode in (0, 3) else failed, encoding="utf-8")
    return scored(case, json.loads(told.read_text(encoding="utf-8")))


def summary(found: Sequence[Scored]) -> dict[str, list[bool]]:
    """By line of the table, which of those that count were right."""
    effects = [(s, p) for s in found for p in s.clear]
    physics = [(s, p) for s, p in effects if p[0] not in ARTEFACTS]
    mattering = [(s, p) for s in found for p in s.mattering]
    outsiders = [s for s in found if s.outsider and sum(s.true.values()) >= CLEARLY]
    return {
        "nulls silent": [s.verdict == "consistent" for s in found if s.group == "null"],
        f"effects of {CLEARLY:g} nats named and placed": [s.told(p) for s, p in effects],
        "or in a set of at most two": [s.told(p, sets=True) for s, p in effects],
        f"of these {CLEARLY:g} nats at 1 % of |H|": [s.told(p) for s, p in mattering],
        "of these physics": [s.told(p) for s, p in physics],
        "outsiders unknown": [s.verdict == "unexplained" and not s.made_up for s in outsiders],
        "nothing made up": [not s.made_up for s in found],
        "artefacts never physics": [
            all(p[0] in ARTEFACTS for p in s.made_up) for s in found if s.group == "artefact"
        ],
        "no failure": [s.verdict != "failed" for s in found],
    }


def table(found: Sequence[Scored]) -> str:
    """Shares with Wilson's 95 % intervals, then every case."""
    lines = []
    for what, right in summary(found).items():
        one = share(right)
        low, high = one.interval95
        lines.append(f"{what}: {one.right} of {one.of} ({low:.0%} to {high:.0%})")
    for s in found:
        true = ", ".join(f"{e} {at or ''} ({n:.3g})" for (e, at), n in s.true.items()) or "nothing"
        named = ", ".join(f"{e} {at or ''}" for e, at in sorted(s.named, key=str)) or "nothing"
        lines.append(
            f"{s.name} {s.group}: {true} | {s.verdict} {s.probability:.2f}: {named} | "
            f"{s.seconds:.0f} s"
        )
    return "\n".join(lines)


def main() -> None:
    """Print the table of a folder's cases."""
    parser = argparse.ArgumentParser(prog="tests.support.foreign_scores")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--cases", type=int, default=40)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    seeds = range(options.first, options.first + options.cases)
    print(table([diagnosed(options.folder, seed) for seed in seeds]))


if __name__ == "__main__":
    main()
