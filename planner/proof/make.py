"""Concealed cases and their sealed answers.

    python -m planner.proof.make FOLDER --cases 12 --seed 7

writes FOLDER/case_001/{robot,recordings} …, prints the hash of every answer, and puts the answers
into FOLDER/answers. Nothing in a case's folder tells what was concealed.
"""

import argparse
import hashlib
import importlib
import json
import secrets
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from planner.proof.engine import Made, NothingShowsError
from planner.proof.refit import left

ENGINES = {"arms": "planner.truth.cases", "tree": "planner.proof.tree.engine"}
NULLS, OUTSIDERS, PAIRS = 0.15, 0.15, 0.2  # shares of the cases
SCENES, ANOTHER = 5, 1_000_003  # seeds of which something comes; step to the next one


def deck(count: int, singles: Sequence[str], outsiders: Sequence[str], seed: int) -> list[str]:
    """Shuffled kinds of as many cases; singles and outsiders come up equally often."""
    rng = np.random.default_rng([seed, 55])

    def some(kinds: Sequence[str], number: int) -> list[str]:
        rounds = -(-number // len(kinds))
        return [str(k) for _ in range(rounds) for k in rng.permutation(list(kinds))][:number]

    nulls, outside, pairs = (round(share * count) for share in (NULLS, OUTSIDERS, PAIRS))
    plain = ["null"] * nulls + ["pair"] * pairs + some(outsiders, outside)
    kinds = plain + some(singles, count - len(plain))
    return [str(kind) for kind in rng.permutation(kinds)]


def answer(kind: str, engine: str, made: Made) -> str:
    """What was concealed, and what a refit leaves of it: JSON, with salt against guessing."""
    effects = [
        {"effect": c.effect, "at": c.at, "parameters": c.parameters, **asdict(left(c.question()))}
        for c in made.concealed
    ]
    whole: dict[str, Any] = {
        "kind": kind,
        "engine": engine,
        "robot": made.robot,
        "effects": effects,
        "imperfections": [{"effect": e, "at": at} for e, at in made.imperfections],
        "held_out": made.held_out,
        "salt": secrets.token_hex(16),
    }
    return json.dumps(whole, indent=1)


def make_one(kind: str, engine: str, seed: int, folder: Path, laboratory: bool = False) -> str:
    """Write a case of an engine of ENGINES; its answer."""
    module = importlib.import_module(ENGINES[engine])
    for attempt in range(SCENES):
        try:
            made = module.make(kind, seed + attempt * ANOTHER, folder, laboratory)
            return answer(kind, engine, made)
        except NothingShowsError:
            continue
    raise SystemExit(f"No {kind} of seed {seed} shows in the noise; take another seed.")


def main() -> None:
    """Make cases of the engines in turn; those that are there already stay."""
    parser = argparse.ArgumentParser(prog="python -m planner.proof.make", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cases", type=int, default=25)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--engine", choices=list(ENGINES), action="append")
    parser.add_argument("--laboratory", action="store_true", help="no hit and no sensor errs")
    options = parser.parse_args()
    engines = options.engine or list(ENGINES)
    (options.folder / "answers").mkdir(parents=True, exist_ok=True)
    for place, engine in enumerate(engines):
        module = importlib.import_module(ENGINES[engine])
        mine = range(place, options.cases, len(engines))
        kinds = deck(len(mine), module.SINGLES, module.OUTSIDERS, options.seed)
        for i, (number, kind) in enumerate(zip(mine, kinds, strict=True)):
            name = f"case_{number + 1:03d}"
            path = options.folder / "answers" / f"{name}.json"
            if not path.is_file():
                seed = 100_000 * options.seed + i
                text = make_one(kind, engine, seed, options.folder / name, options.laboratory)
                path.write_text(text, encoding="utf-8")
            seal = hashlib.sha256(path.read_bytes()).hexdigest()
            print(f"{name} {seal}", flush=True)


if __name__ == "__main__":
    main()
