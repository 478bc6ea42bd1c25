"""What stands by itself (`check`, `schema`, `manual`, `study`, `prove`)."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import AsJson, PictureFormat, argument, option, progress_bar, respond, warn
from planner.report.answer import Done


def check(
    robot: Annotated[Path, argument("The robot's robot.toml.", "ROBOT_TOML")],
    campaign: Annotated[
        Path | None, option("Check its workspace and modes as well.", "CAMPAIGN_TOML")
    ] = None,
    plot: Annotated[Path | None, option("Draw the robot into this folder.", "FOLDER")] = None,
    format_: PictureFormat = "png",
    as_json: AsJson = False,
) -> int:
    """Check a robot: masses, frequencies, limits, units, frames, collision geometry.

    Example: planner check robot/robot.toml --plot pictures
    """
    from planner.campaign.cell import examine_robot
    from planner.report.pictures import Pictures
    from planner.report.robot_check import robot_check

    pictures = Pictures(plot, format_)
    found = examine_robot(robot, campaign)
    answer = robot_check(found, pictures)
    if as_json:  # the text says them itself
        for finding in found.errors:
            warn(finding.sentence)
    return respond(answer, as_json, 2 if found.errors else 0)


def schema(
    file: Annotated[str, argument("robot, campaign, cut or tool.", "FILE")] = "robot",
    as_json: AsJson = False,
) -> int:
    """Every entry of robot.toml, campaign.toml, cut.toml or tool.toml, as they are read.

    --json holds a JSON Schema, which editors complete and check by.

    Example: planner schema campaign
    """
    from planner.report.documentation import schema as entries

    return respond(entries(file), as_json)


def manual(
    context: typer.Context,
    out: Annotated[Path, option("Where the manual goes.", "FILE.html")] = Path(
        "planner_manual.html"
    ),
    as_json: AsJson = False,
) -> int:
    """Write the manual as one HTML file: tutorial, files, commands, what numbers mean.

    Example: planner manual --out manual.html
    """
    from planner.report.documentation import manual as text_of
    from planner.report.html import write_page

    assert context.parent is not None
    commands = getattr(context.parent.command, "commands", {})
    told = [(name, command.help or "") for name, command in commands.items()]
    file = write_page(text_of(told), out)
    return respond(Done({"manual": str(file)}, f"The manual: {file}"), as_json)


def study(
    name: Annotated[
        str,
        argument("busch2022, busch2020, seyedhosseini2025, lei2023, birk2025, or all.", "NAME|all"),
    ],
    out: Annotated[
        Path | None, option("Write tables (CSV), pictures and pages (HTML) here.", "FOLDER")
    ] = None,
    small: Annotated[
        bool, option("A version of seconds, to see that it works: says little.", None, "--small")
    ] = False,
    as_json: AsJson = False,
) -> int:
    """Do a paper's study again on simulated recordings: tables, pictures, what holds.

    `all` keeps each finished study in FOLDER and does not run it again.

    Example: planner study busch2022 --out figures
    """
    from planner.studies import registry
    from planner.studies.run import run_all, run_study

    with progress_bar("studying", quiet=as_json) as progress:
        if name == registry.ALL:
            answer = run_all(out, small, progress)
        else:
            answer = run_study(name, out, small, progress)
    return respond(answer, as_json)


def prove(
    cases: Annotated[int, option("How many cases.", min=1, max=5000)] = 25,
    seed: Annotated[int, option("Of the cases.", min=0)] = 0,
    out: Annotated[Path | None, option("Where all goes; resumed if it is there.", "FOLDER")] = None,
    jobs: Annotated[int, option("Diagnoses at a time.", min=1, max=64)] = 1,
    scheduler: Annotated[
        str | None, option("Of a Dask cluster that does the cases.", "ADDRESS")
    ] = None,
    laboratory: Annotated[
        bool, option("No hit misses, and no sensor errs.", None, "--laboratory")
    ] = False,
    as_json: AsJson = False,
) -> int:
    """Make concealed cases with other engines, seal, diagnose, unseal and score them.

    Example: planner prove --cases 20 --out proof
    """
    from planner.proof.report import write
    from planner.proof.run import Proof, results
    from planner.proof.run import seal as sealed

    folder = out or Path(f"proof-{cases}-{seed}")
    with progress_bar("proving", quiet=as_json) as progress:
        scored = results(Proof(cases, seed, laboratory), folder, jobs, scheduler, progress)
    return respond(write(folder, sealed(folder), tuple(scored.values())), as_json)
