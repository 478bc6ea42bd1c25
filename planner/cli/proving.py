"""Proof of the diagnosis on concealed cases (`planner prove`)."""

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
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Of a Dask cluster that does the cases.")
    ] = None,
    laboratory: Annotated[
        bool, typer.Option("--laboratory", help="No hit misses, and no sensor errs.")
    ] = False,
    as_json: AsJson = False,
) -> int:
    """Make concealed cases with other engines, seal, diagnose, unseal and score them.

    Example: planner prove --cases 20 --out proof
    """
    from planner.cli.progress import counting
    from planner.proof.report import write
    from planner.proof.run import Proof, results
    from planner.proof.run import seal as sealed

    folder = out or Path(f"proof-{cases}-{seed}")
    with counting(quiet=as_json) as tell:
        scored = results(Proof(cases, seed, laboratory), folder, jobs, scheduler, tell)
    return respond(write(folder, sealed(folder), tuple(scored.values())), as_json)
