"""Concealed cases and their answers.

    python -m planner.proof.make FOLDER --cases 12 --seed 7 --number 3

writes FOLDER/{robot,recordings} of the third of twelve cases, and prints its answer. Nothing in the
folder tells what was concealed. With `--named local_resonator@link_3` it prints instead how much
of |H| that imperfection changes.
"""

import argparse
import json
import secrets
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from planner.proof.arms import ARMS
from planner.proof.cases import RANDOM, ConcealedCase, make_case
from planner.proof.measurement_errors import EVERYDAY, LABORATORY, ROUGH
from planner.proof.refit import detectability
from planner.proof.table import OUT_OF_LIBRARY_KINDS, SINGLES, NothingDetectableError

ENGINES = "arms", "tree"  # known arms by MuJoCo, robots drawn at random by a tree of frames
NULL_SHARE, OUT_OF_LIBRARY_SHARE, PAIR_SHARE = 0.15, 0.15, 0.2  # shares of the cases
SCENES, ANOTHER = 5, 1_000_003  # seeds of which something comes; step to the next one


def deck(count: int, singles: Sequence[str], outsiders: Sequence[str], seed: int) -> list[str]:
    """Shuffled kinds of as many cases; singles and outsiders come up equally often."""
    rng = np.random.default_rng([seed, 55])

    def some(kinds: Sequence[str], number: int) -> list[str]:
        rounds = -(-number // len(kinds))
        return [str(k) for _ in range(rounds) for k in rng.permutation(list(kinds))][:number]

    shares = NULL_SHARE, OUT_OF_LIBRARY_SHARE, PAIR_SHARE
    nulls, outside, pairs = (round(share * count) for share in shares)
    plain = ["null"] * nulls + ["pair"] * pairs + some(outsiders, outside)
    kinds = plain + some(singles, count - len(plain))
    return [str(kind) for kind in rng.permutation(kinds)]


def answer(kind: str, engine: str, made: ConcealedCase) -> str:
    """What was concealed, and what a refit leaves of it: JSON, with salt against guessing."""
    effects = [
        {"effect": c.effect, "at": c.at, "parameters": {**c.parameters, "size": c.size}}
        | asdict(detectability(question()))
        for c, question in zip(made.concealed, made.questions, strict=True)
    ]
    whole: dict[str, Any] = {
        "kind": kind,
        "engine": engine,
        "robot": made.robot,
        "effects": effects,
        "imperfections": [{"effect": effect, "at": at} for effect, at in made.imperfections],
        "held_out": made.held_out,
        "salt": secrets.token_hex(16),
    }
    return json.dumps(whole, indent=1)


def sizes(made: ConcealedCase, named: Sequence[str]) -> str:
    """Sizes of imperfections that a diagnosis named as effect@place, by name: JSON."""
    places = {name: tuple(name.split("@")) for name in named}
    asked = {
        name: made.imperfections[at] for name, at in places.items() if at in made.imperfections
    }
    return json.dumps({name: detectability(question()).size for name, question in asked.items()})


def make_one(
    kind: str, engine: str, seed: int, folder: Path, laboratory: bool = False
) -> ConcealedCase:
    """Write a case of an engine of ENGINES, known robots in turn."""
    drawn = engine == "tree"
    handling = LABORATORY if laboratory else ROUGH if drawn else EVERYDAY
    for tried in range(seed, seed + SCENES * ANOTHER, ANOTHER):
        robot = RANDOM if drawn else sorted(ARMS)[tried % len(ARMS)]
        try:
            return make_case(kind, robot, tried, folder, handling)
        except NothingDetectableError:
            continue
    raise SystemExit(f"No {kind} of seed {seed} shows in the noise; take another seed.")


def main() -> None:
    """Make one case of a proof; print its answer."""
    parser = argparse.ArgumentParser(prog="python -m planner.proof.make", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cases", type=int, default=25, help="of the proof, engines in turn")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--number", type=int, default=1, help="of the case, from 1 on")
    parser.add_argument("--laboratory", action="store_true", help="no hit and no sensor errs")
    parser.add_argument("--named", nargs="*", help="imperfections of which to tell the size")
    options = parser.parse_args()
    place, own = (options.number - 1) % len(ENGINES), (options.number - 1) // len(ENGINES)
    count = len(range(place, options.cases, len(ENGINES)))
    kind = deck(count, SINGLES, OUT_OF_LIBRARY_KINDS, options.seed)[own]
    seed, engine = 100_000 * options.seed + own, ENGINES[place]
    made = make_one(kind, engine, seed, options.folder, options.laboratory)
    told = answer(kind, engine, made) if options.named is None else sizes(made, options.named)
    print(told, end="")


if __name__ == "__main__":
    main()
