"""The command line: one function per command, heavy imports inside them."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import (
    AsJson,
    Directory,
    FromNames,
    PictureFormat,
    Rrd,
    argument,
    option,
    progress_bar,
    refusals,
    respond,
    warn,
)
from planner.cli.campaign_commands import confirm, export, new, redo, report, skip, undo, withdraw
from planner.cli.documentation import check, manual, prove, schema, study
from planner.cli.identification import compare, diagnose, identify, modes
from planner.cli.stability import couple, stability
from planner.errors import InputError
from planner.words import command

app = typer.Typer(
    name="planner",
    help="Plans hammer tests of a milling robot, fuses them with its simulation, explains both.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",  # in which brackets are no markup
    context_settings={"help_option_names": ["-h", "--help"]},
)

Viewer = Annotated[bool, option("Show progress in a live Rerun viewer.", None, "--viewer")]


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[bool, option("Print the version.", None, "--version")] = False,
) -> None:
    if version:
        from planner.version import __version__

        print(f"planner {__version__}")


@app.command(name="next")
def next_(
    directory: Directory,
    count: Annotated[int, option("How many poses.", min=1, max=100)] = 1,
    acquisition: Annotated[str | None, option("Instead of campaign.toml's.", "NAME")] = None,
    as_json: AsJson = False,
) -> int:
    """Propose the next pose or poses to measure.

    Example: planner next cell7 --count 3
    """
    from planner.campaign.campaign import Campaign
    from planner.report.proposals import proposals

    campaign = Campaign(directory)
    return respond(proposals(campaign, campaign.next(count, acquisition)), as_json)


@app.command(name="import")
def import_(
    directory: Directory,
    paths: Annotated[list[Path], argument("Hits, or a folder.", "PATH...")],
    pose: Annotated[str | None, option("Pose of these hits.", "ID")] = None,
    from_names: FromNames = False,
    as_json: AsJson = False,
) -> int:
    """Import hits, refit, and say what changed.

    Example: planner import cell7 exports/P001
    """
    from planner.campaign.campaign import Campaign
    from planner.report.imports import imported

    with progress_bar("importing", quiet=as_json) as progress:
        campaign = Campaign(directory)
        reports = campaign.import_paths(tuple(paths), pose, progress, from_names)
    answer, refused, asked = imported(reports, directory, campaign.state.simulated)
    return respond(answer, as_json, refusals(refused, asked))


@app.command(name="status")
def status_(
    directory: Directory,
    plot: Annotated[
        Path | None, option("Draw each pose predicted without it into this folder.", "FOLDER")
    ] = None,
    format_: PictureFormat = "png",
    models: Annotated[
        bool, option("Try every [surrogate] model, poses left out.", None, "--models")
    ] = False,
    as_json: AsJson = False,
) -> int:
    """What has been measured, what is open, how sure the model is and whether it may be.

    Example: planner status cell7 --plot pictures
    """
    from planner.campaign.campaign import Campaign
    from planner.report.pictures import Pictures
    from planner.report.status import status

    campaign, pictures, compared = Campaign(directory), Pictures(plot, format_), None
    if models:
        from planner.campaign.model_comparison import compared_models

        with progress_bar("models", quiet=as_json) as progress:
            compared = compared_models(campaign.model, progress=progress)
    return respond(status(campaign, None, pictures, compared), as_json)


@app.command()
def watch(
    directory: Directory,
    folder: Annotated[Path, argument("Folder into which the analyser exports.")],
    auto: Annotated[bool, option("Import without asking.", None, "--auto")] = False,
    hits_per_pose: Annotated[
        int | None, option("Hits that make a pose; else [cost] hits_per_axis along each.", min=1)
    ] = None,
    explain: Annotated[
        bool, option("Diagnose beside the session, after each import.", None, "--diagnose")
    ] = False,
    rrd: Rrd = None,
    viewer: Viewer = False,
    as_json: AsJson = False,
) -> int:
    """Interactive session: propose, wait for the analyser's export, import, refit.

    Example: planner watch cell7 exports/ --diagnose
    """

    if not folder.is_dir():
        raise InputError(
            f"{folder} is no folder; name the one the analyser exports into, or make it: "
            f"{command('mkdir', '-p', folder)}"
        )
    from planner.report.text import UnbrokenConsole

    screen = UnbrokenConsole(stderr=as_json)
    # What follows takes seconds before the first page: libraries, the model.
    screen.print(f"Opening {directory}: the first pose comes in a few seconds.")
    from planner.campaign.campaign import Campaign
    from planner.report.imports import how_to_answer
    from planner.session.watch import watch as run

    campaign = Campaign(directory)
    summary = run(
        campaign,
        folder,
        console=screen,
        auto=auto,
        hits_per_pose=hits_per_pose,
        rrd=rrd,
        viewer=viewer,
        explain=explain,
    )
    held = campaign.state.held.items()
    asked = [how_to_answer(directory, pose, m.question) for pose, m in held if m.question]
    return respond(summary, as_json, refusals((), asked))


@app.command()
def predict(
    source: Annotated[Path, argument("Campaign folder, or a robot alone.", "DIR|ROBOT_TOML")],
    poses: Annotated[
        Path, argument("pose, joint_…_deg, slides: …_mm[, peak_force_n]", "POSES_CSV")
    ],
    out: Annotated[Path | None, option("Where FRFs go.", "FILE.npz")] = None,
    peak_force_n: Annotated[
        float | None,
        option(
            "Of hits, where POSES_CSV states none: joints may not be linear ([[law]]).",
            "N",
            min=0.001,
        ),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Modes and FRFs, with uncertainty, at given poses.

    The npz holds for n poses: frf_mean and frf_sd (n, 3, 3, F) in m/s²/N (response where the sensor
    is, by force at the tcp; x, y, z of the tcp frame: with sensor_frame = tcp_frame in robot.toml
    both are at the tool's tip), frequency_hz (F,), pose (n,), joints_deg (n, joints).

    Example: planner predict cell7 poses.csv --out frfs.npz
    """
    from planner.campaign.campaign import Campaign
    from planner.campaign.cell import checked_pose
    from planner.recording.folder import peak_forces, read_poses
    from planner.report.predictions import predictions, robot_predictions
    from planner.robot.robot import Robot

    with progress_bar("predicting", quiet=as_json) as progress:
        campaign = None if source.is_file() else Campaign(source)
        robot = Robot.load(source) if campaign is None else campaign.cell.robot
        rows = read_poses(poses, robot.joints)
        q = [checked_pose(robot, row.joints_deg, f"{poses}, row {row.row}") for row in rows]
        beside = source.parent if campaign is None else campaign.directory
        npz = out or beside / "predictions" / f"{poses.stem}.npz"
        asked = [row.pose for row in rows], q, npz, peak_forces(rows, peak_force_n)
        if campaign is None:
            answer = robot_predictions(robot, *asked)
        else:
            progress(f"{len(rows)} poses", 0.0)
            answer = predictions(campaign, *asked)
    return respond(answer, as_json)


@app.command()
def replay(
    directory: Directory,
    until: Annotated[int | None, option("Stop after entry N.", "N")] = None,
    acquisition: Annotated[
        str | None, option("What would this one have proposed, saved?", "NAME")
    ] = None,
    rrd: Rrd = None,
    viewer: Viewer = False,
    as_json: AsJson = False,
) -> int:
    """Rebuild the campaign from its log, step by step, and check each step.

    Example: planner replay cell7 --rrd cell7.rrd
    """
    from planner.campaign.campaign import Campaign
    from planner.report.replayed import replayed

    with progress_bar("replaying", quiet=as_json) as progress:
        answer = replayed(Campaign(directory), until, rrd, viewer, progress, acquisition)
    reproduced = answer.keys["reproduced"]
    if not reproduced:
        warn("The log was not reproduced; see the steps that differ.")
    return respond(answer, as_json, 0 if reproduced else 1)


for _command in (
    new, undo, redo, confirm, skip, withdraw, check, report, export, modes, identify, diagnose,
    prove, compare, study, schema, manual, couple, stability,
):  # fmt: skip
    app.command()(_command)


@app.command()
def demo(
    directory: Annotated[
        Path | None, option("Where the campaign goes (default: temporary).", None, "--dir")
    ] = None,
    measurements: Annotated[int, option("At most so many.", min=1, max=35)] = 10,
    viewer: Viewer = False,
    as_json: AsJson = False,
) -> int:
    """Play a whole campaign on recordings shipped with the project (simulated).

    Example: planner demo --measurements 6
    """
    from planner.demo import play

    with progress_bar("playing", quiet=as_json) as progress:
        answer = play(directory, measurements, viewer, progress)
    return respond(answer, as_json)
