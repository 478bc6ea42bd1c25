"""What stands by itself (`check`, `schema`, `manual`, `study`, `prove`)."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import AsJson, PictureFormat, option, respond, warn
from planner.report.answer import Done


def check(
    robot: Annotated[Path, typer.Argument(metavar="ROBOT_TOML", help="The robot's robot.toml.")],
    campaign: Annotated[
        Path | None,
        typer.Option(metavar="CAMPAIGN_TOML", help="Check its workspace and modes as well."),
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
    from planner.report.robot_check import RobotCheckReport

    pictures = Pictures(plot, format_)
    answer = RobotCheckReport.of(examine_robot(robot, campaign))
    answer = answer.with_pictures(pictures, answer.robot)
    if as_json:  # the text says them itself
        for finding in answer.findings:
            if finding.severity == "error":
                warn(finding.sentence)
    return respond(answer, as_json, 0 if answer.ok else 2)


def schema(
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="robot, campaign, cut or tool.")
    ] = "robot",
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
    out: Annotated[Path, typer.Option(metavar="FILE.html", help="Where the manual goes.")] = Path(
        "planner_manual.html"
    ),
    as_json: AsJson = False,
) -> int:
    """Write the manual as one HTML file: tutorial, files, commands, what numbers mean.

    Example: planner manual --out manual.html
    """
    from planner.report.documentation import write_manual

    assert context.parent is not None
    commands = getattr(context.parent.command, "commands", {})
    told = [(name, command.help or "") for name, command in commands.items()]
    file = write_manual(out, told)
    return respond(Done({"manual": str(file)}, f"The manual: {file}"), as_json)


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
    from planner.cli.progress import progress_bar
    from planner.studies import registry
    from planner.studies.run import run_all, run_study

    with progress_bar("studying", quiet=as_json) as progress:
        if name == registry.ALL:
            answer = run_all(out, small, progress)
        else:
            answer = run_study(name, out, small, progress)
    return respond(answer, as_json)


def prove(
    cases: Annotated[int, typer.Option(min=1, max=5000, help="How many cases.")] = 25,
    seed: Annotated[int, typer.Option(min=0, help="Of the cases.")] = 0,
    out: Annotated[Path | None, option("Where all goes; resumed if it is there.", "FOLDER")] = None,
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
    from planner.cli.progress import progress_bar
    from planner.proof.report import write
    from planner.proof.run import Proof, results
    from planner.proof.run import seal as sealed

    folder = out or Path(f"proof-{cases}-{seed}")
    with progress_bar("proving", quiet=as_json) as progress:
        scored = results(Proof(cases, seed, laboratory), folder, jobs, scheduler, progress)
    return respond(write(folder, sealed(folder), tuple(scored.values())), as_json)
