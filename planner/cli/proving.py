"""Proof of the diagnosis on concealed cases (`planner prove`)."""

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from planner.cli.answer import AsJson, respond


def prove(
    cases: Annotated[int, typer.Option(min=1, max=5000, help="How many cases.")] = 25,
    seed: Annotated[int, typer.Option(min=0, help="Of the cases.")] = 0,
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Where all goes; resumed if it is there.")
    ] = None,
    jobs: Annotated[int, typer.Option(min=1, max=64, help="Diagnoses at a time.")] = 1,
    as_json: AsJson = False,
) -> int:
    """Make concealed cases with another engine, seal, diagnose, unseal and score them."""
    from planner.cli.progress import counting
    from planner.prove.report import write
    from planner.prove.run import diagnose_all, make, told, unseal
    from planner.prove.score import score

    folder = out or Path(f"proof-{cases}-{seed}")
    with counting(quiet=as_json) as tell:
        proof = make(folder, cases, seed, tell)
        print(f"Sealed answers: {proof.whole}", file=sys.stderr, flush=True)
        diagnose_all(proof, jobs, tell)
    scored = []
    for name in sorted(proof.seals):
        found = json.loads(told(proof, name).read_text(encoding="utf-8"))
        scored.append(score(name, unseal(proof, name), found))
    return respond(write(proof, scored), as_json, _rendered)


def _rendered(answer: dict[str, Any]) -> str:
    return Path(answer["report"]).read_text(encoding="utf-8")
