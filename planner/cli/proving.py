"""Proof of the diagnosis on concealed cases (`planner prove`)."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import AsJson, respond


def prove(
    cases: Annotated[int, typer.Option(min=1, max=5000, help="How many cases.")] = 25,
    seed: Annotated[int, typer.Option(min=0, help="Of the cases.")] = 0,
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Where all goes; resumed if it is there.")
    ] = None,
    jobs: Annotated[int, typer.Option(min=1, max=64, help="Diagnoses at a time.")] = 1,
    laboratory: Annotated[
        bool, typer.Option("--laboratory", help="No hit misses, and no sensor errs.")
    ] = False,
    as_json: AsJson = False,
) -> int:
    """Make concealed cases with another engine, seal, diagnose, unseal and score them.

    Example: planner prove --cases 20 --out proof
    """
    from planner.cli.progress import counting
    from planner.proof.report import prove_report
    from planner.proof.run import diagnose_all, make

    folder = out or Path(f"proof-{cases}-{seed}")
    with counting(quiet=as_json) as tell:
        proof = make(folder, cases, seed, tell, laboratory)
        print(f"Sealed answers: {proof.whole}", file=sys.stderr, flush=True)
        diagnose_all(proof, jobs, tell)
    return respond(prove_report(proof), as_json)
