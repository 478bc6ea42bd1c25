"""The command line: one function per command, heavy imports inside them."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import AsJson, respond, warn
from planner.cli.comparison import compare
from planner.cli.diagnosis import diagnose
from planner.cli.identification import identify
from planner.cli.proving import prove
from planner.cli.study import study

app = typer.Typer(
    name="planner",
    help="Plans hammer tests of a milling robot, fuses them with its simulation, explains both.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Directory = Annotated[Path, typer.Argument(metavar="DIR", help="Campaign folder.")]
PoseArgument = Annotated[str, typer.Argument(metavar="POSE", help="Name of the pose.")]
Rrd = Annotated[Path | None, typer.Option(help="Write a Rerun recording to this file.")]
Viewer = Annotated[bool, typer.Option("--viewer", help="Show progress in a live Rerun viewer.")]


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        from planner import __version__

        print(f"planner {__version__}")


@app.command()
def new(
    directory: Directory,
    robot: Annotated[Path, typer.Option(metavar="ROBOT_TOML", help="The robot's robot.toml.")],
    campaign: Annotated[
        Path | None, typer.Option(metavar="CAMPAIGN_TOML", help="Workspace, modes, acquisition.")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Start a campaign."""
    from planner.campaign.campaign import Campaign
    from planner.cli import answers, render

    made = Campaign.new(directory, robot, campaign)
    return respond(answers.created(made), as_json, render.created)


@app.command(name="next")
def next_(
    directory: Directory,
    count: Annotated[int, typer.Option(min=1, max=100, help="How many poses.")] = 1,
    acquisition: Annotated[
        str | None, typer.Option(metavar="NAME", help="Instead of campaign.toml's.")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Propose the next pose or poses to measure."""
    from planner.campaign.campaign import Campaign
    from planner.cli import answers, render

    opened = Campaign(directory)
    proposals = opened.next(count, acquisition)
    return respond(answers.proposals(opened, proposals), as_json, render.proposals)


@app.command(name="import")
def import_(
    directory: Directory,
    paths: Annotated[list[Path], typer.Argument(metavar="PATH...", help="Hits, or a folder.")],
    pose: Annotated[str | None, typer.Option(metavar="ID", help="Pose of these hits.")] = None,
    as_json: AsJson = False,
) -> int:
    """Import hits, refit, and say what changed."""
    from planner.campaign.campaign import Campaign
    from planner.cli import answers, render
    from planner.cli.progress import reporting

    with reporting("importing", quiet=as_json) as progress:
        reports = Campaign(directory).import_paths(tuple(paths), pose, progress)
    answer, code = answers.imported(reports), 0
    for report in answer["poses"]:
        asked = report["question"]
        for hit in report["refused"]:
            if asked is None or hit["reason"] != asked["text"]:
                warn(f"Refused {hit['file']}: {hit['reason']}")
        if asked is not None:
            warn(answers.what_to_say(directory, asked["pose"], asked["text"]))
        code = 3 if asked or report["refused"] else code
    return respond(answer, as_json, render.imported, code)


@app.command()
def confirm(
    directory: Directory,
    pose: PoseArgument,
    at: Annotated[
        str | None, typer.Option("--at", metavar="POSE", help="Where they are from instead.")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Use the held hits of a pose: they are from there indeed, or from another pose."""
    from planner.campaign.campaign import Campaign
    from planner.cli import answers, render

    campaign = Campaign(directory)
    if at is None:
        campaign.confirm(pose)
        answer = {"confirmed": pose, "frequency_sd_percent": campaign.model.frequency_sd_percent}
        return respond(answer, as_json, render.confirmed)
    answer = answers.imported((campaign.move(pose, at),))
    if answer["question"]:
        warn(answers.what_to_say(directory, at, answer["question"]["text"]))
    return respond(answer, as_json, render.imported, 3 if answer["refused"] else 0)


@app.command()
def status(
    directory: Directory,
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Draw each pose predicted without it into this folder."
        ),
    ] = None,
    format_: Annotated[str, typer.Option("--format", help="Of the picture: png or svg.")] = "png",
    as_json: AsJson = False,
) -> int:
    """What has been measured, what is open, how sure the model is and whether it may be."""
    from planner.campaign.campaign import Campaign
    from planner.cli import answers, render
    from planner.cli.left_out import left_out
    from planner.report.plot_files import Pictures

    campaign, pictures = Campaign(directory), Pictures(plot, format_)
    answer = answers.status(campaign) | left_out(campaign, pictures)
    return respond(answer, as_json, render.status)


@app.command()
def undo(directory: Directory, as_json: AsJson = False) -> int:
    """Take back the last act."""
    from planner.campaign.campaign import Campaign
    from planner.cli import answers, render

    entry = Campaign(directory).undo()
    return respond(answers.undone(entry), as_json, render.undone)


@app.command()
def withdraw(
    directory: Directory,
    pose: PoseArgument,
    reason: Annotated[str, typer.Option(help="Why; kept in the log.")] = "",
    as_json: AsJson = False,
) -> int:
    """Set a measured pose aside; its recordings stay."""
    from planner.campaign.campaign import Campaign
    from planner.cli import render

    Campaign(directory).withdraw(pose, reason)
    return respond({"withdrawn": pose, "reason": reason}, as_json, render.withdrawn)


@app.command()
def skip(
    directory: Directory,
    pose: PoseArgument,
    reason: Annotated[str, typer.Option(help="Why; kept in the log.")] = "",
    as_json: AsJson = False,
) -> int:
    """Say that a proposed pose cannot be measured; it is not offered again.

    With a reason its neighbours are not offered either: what stands in the way there does so
    around it too.
    """
    from planner.campaign.campaign import Campaign
    from planner.cli import render

    Campaign(directory).skip(pose, reason, neighbours=bool(reason))
    return respond({"skipped": pose, "reason": reason}, as_json, render.skipped)


@app.command()
def watch(
    directory: Directory,
    folder: Annotated[Path, typer.Argument(help="Folder into which the analyser exports.")],
    auto: Annotated[bool, typer.Option("--auto", help="Import without asking.")] = False,
    hits_per_pose: Annotated[int, typer.Option(min=1, help="Hits that make a pose.")] = 12,
    explain: Annotated[
        bool, typer.Option("--diagnose", help="Diagnose beside the session, after each import.")
    ] = False,
    rrd: Rrd = None,
    viewer: Viewer = False,
    as_json: AsJson = False,
) -> int:
    """Interactive session: propose, wait for the analyser's export, import, refit."""
    from planner.campaign.campaign import Campaign
    from planner.cli import answers, render
    from planner.cli.progress import console
    from planner.session.watch import watch as run

    summary = run(
        Campaign(directory),
        folder,
        console=console(quiet=False, stderr=as_json),
        auto=auto,
        hits_per_pose=hits_per_pose,
        rrd=rrd,
        viewer=viewer,
        explain=explain,
    )
    for pose, text in summary.questions.items():
        warn(answers.what_to_say(directory, pose, text))
    code = 3 if summary.questions else 0
    return respond(answers.session(summary), as_json, render.session, code)


@app.command()
def predict(
    directory: Directory,
    poses: Annotated[Path, typer.Argument(metavar="POSES_CSV", help="pose, joint_…_deg")],
    out: Annotated[Path | None, typer.Option(metavar="FILE.npz", help="Where FRFs go.")] = None,
    as_json: AsJson = False,
) -> int:
    """Modes and FRFs, with uncertainty, at given poses."""
    from planner.campaign.campaign import Campaign
    from planner.cli import answers, render

    return respond(answers.predicted(Campaign(directory), poses, out), as_json, render.predicted)


@app.command()
def replay(
    directory: Directory,
    until: Annotated[int | None, typer.Option(metavar="N", help="Stop after entry N.")] = None,
    acquisition: Annotated[
        str | None, typer.Option(metavar="NAME", help="What would this one have proposed, saved?")
    ] = None,
    rrd: Rrd = None,
    viewer: Viewer = False,
    as_json: AsJson = False,
) -> int:
    """Rebuild the campaign from its log, step by step, and check each step."""
    from planner.campaign.campaign import Campaign
    from planner.cli import answers, render
    from planner.cli.progress import reporting

    with reporting("replaying", quiet=as_json) as progress:
        answer = answers.replayed(Campaign(directory), until, rrd, viewer, progress, acquisition)
    if not answer["reproduced"]:
        warn("The log was not reproduced; see the steps that differ.")
    return respond(answer, as_json, render.replayed, 0 if answer["reproduced"] else 1)


@app.command()
def modes(
    paths: Annotated[list[Path], typer.Argument(metavar="PATH...", help="Hits of one pose.")],
    band_hz: Annotated[
        tuple[float, float] | None, typer.Option(metavar="LOW HIGH", help="Band in Hz.")
    ] = None,
    force: Annotated[
        str | None, typer.Option(metavar="CHANNEL", help="Force channel, if not labelled.")
    ] = None,
    quantity: Annotated[
        str | None,
        typer.Option(
            metavar="KIND", help="Of unlabelled FRFs: accelerance, mobility or receptance."
        ),
    ] = None,
    estimator: Annotated[str, typer.Option(help="h1, h2 or hv.")] = "h1",
    window_rate_1_s: Annotated[
        float,
        typer.Option("--window-rate", metavar="1/S", help="Of the analyser's exponential window."),
    ] = 0.0,
    robot: Annotated[
        Path | None,
        typer.Option(metavar="ROBOT_TOML", help="Whose simulation guides labels over poses."),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Draw the analysis into this folder.")
    ] = None,
    format_: Annotated[str, typer.Option("--format", help="Of the pictures: png or svg.")] = "png",
    rrd: Rrd = None,
    as_json: AsJson = False,
) -> int:
    """Experimental modal analysis of one pose's hits, or of a folder with recordings.csv."""
    from planner.cli import modal, render, survey
    from planner.cli.progress import reporting
    from planner.report.plot_files import Pictures

    pictures = Pictures(plot, format_, rrd)
    if modal.several_poses(paths):
        modal.check(band_hz, estimator, quantity, window_rate_1_s)
        band = band_hz or modal.DEFAULT_BAND_HZ
        with reporting("identifying", quiet=as_json) as progress:
            answer = survey.analyse(
                paths[0], band, robot, estimator, window_rate_1_s, pictures, progress
            )
        for entry in answer["refused"]:
            warn(f"Refused {entry['file']}: {entry['reason']}")
        return respond(answer, as_json, render.survey, 3 if answer["refused"] else 0)
    answer = modal.analyse(
        tuple(paths), band_hz, force, estimator, pictures, quantity, window_rate_1_s
    )
    refused = answer["refused"]
    for entry in refused:
        warn(f"Refused {entry['file']}: {entry['reason']}")
    return respond(answer, as_json, render.modes, 3 if refused else 0)


app.command()(identify)
app.command()(diagnose)
app.command()(prove)
app.command()(compare)
app.command()(study)


@app.command()
def demo(
    directory: Annotated[
        Path | None, typer.Option("--dir", help="Where the campaign goes (default: temporary).")
    ] = None,
    measurements: Annotated[int, typer.Option(min=1, max=35, help="At most so many.")] = 10,
    viewer: Viewer = False,
    as_json: AsJson = False,
) -> int:
    """Play a whole campaign on recordings shipped with the project (simulated)."""
    from planner.cli import render
    from planner.cli.progress import reporting
    from planner.demo import play

    with reporting("playing", quiet=as_json) as progress:
        answer = play(directory, measurements, viewer, progress)
    return respond(answer, as_json, render.demo)
