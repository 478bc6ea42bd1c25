"""What takes hours: the papers' studies, and concealed cases (`planner study`, `planner prove`)."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import AsJson, respond


def study(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME|all",
            help="busch2022, busch2020, seyedhosseini2025, lei2023, birk2025, or all.",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Write tables (CSV), pictures and pages (HTML) here."),
    ] = None,
    small: Annotated[
        bool,
        typer.Option("--small", help="A version of seconds, to see that it works: says little."),
    ] = False,
    as_json: AsJson = False,
) -> int:
    """Do a paper's study again on simulated recordings: tables, pictures, what holds.

    `all` keeps each finished study in FOLDER and does not run it again.

    Example: planner study busch2022 --out figures
    """
    from planner.cli.progress import telling
    from planner.studies import registry
    from planner.studies.conduct import conduct, conduct_all

    with telling("studying", quiet=as_json) as progress:
        if name == registry.ALL:
            answer = conduct_all(out, small, progress)
        else:
            answer = conduct(name, out, small, progress)
    return respond(answer, as_json)


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
    from planner.cli.progress import telling
    from planner.proof.report import write
    from planner.proof.run import Proof, results
    from planner.proof.run import seal as sealed

    folder = out or Path(f"proof-{cases}-{seed}")
    with telling("proving", quiet=as_json) as tell:
        scored = results(Proof(cases, seed, laboratory), folder, jobs, scheduler, tell)
    return respond(write(folder, sealed(folder), tuple(scored.values())), as_json)
