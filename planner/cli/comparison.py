"""Comparison of sampling strategies on a pool of recordings (`planner compare`)."""

import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import RECORDED, AsJson, RobotOption, respond, warn
from planner.errors import InputError

SIMULATIONS = ("frozen", "updated", "none")


def compare(
    recordings: Annotated[
        Path, typer.Argument(metavar="RECORDINGS", help=f"{RECORDED}: the pool.")
    ],
    strategies: Annotated[
        str | None,
        typer.Option(metavar="A,B,…", help="random, sobol, maximin_lhs, default, variance, …"),
    ] = None,
    models: Annotated[
        str | None,
        typer.Option(metavar="A,B,…", help="default, gp, ar1, nargp, mfdgp, multitask, none."),
    ] = None,
    robot: RobotOption = None,
    repeats: Annotated[int, typer.Option(min=1, max=10_000, help="Seeds.")] = 20,
    initial: Annotated[
        int, typer.Option(min=1, help="First poses, the same for all strategies at a seed.")
    ] = 3,
    budget: Annotated[
        int | None, typer.Option(min=1, help="Measurements (default: 15, or what the pool allows).")
    ] = None,
    simulation: Annotated[
        str | None, typer.Option(metavar="USE", help="frozen, updated or none.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Of a Dask cluster that does the runs.")
    ] = None,
    workers: Annotated[int, typer.Option(min=1, max=256, help="Processes on this machine.")] = 2,
    campaign: Annotated[
        Path | None, typer.Option(metavar="CAMPAIGN_TOML", help="Workspace, modes, acquisition.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Where results and the picture go.")
    ] = None,
    rrd: Annotated[Path | None, typer.Option(help="Write a Rerun recording to this file.")] = None,
    as_json: AsJson = False,
) -> int:
    """Compare sampling strategies: error by number of measurements, on poses not used.

    `--models` compares models of the frequencies, as `[surrogate] model` names them.

    Example: planner compare exports --robot robot/robot.toml --strategies random,default
    """
    from planner.campaign import store
    from planner.campaign.material import material
    from planner.cli.progress import telling
    from planner.compare.bench import assemble, decide
    from planner.compare.resume import conduct, recorded
    from planner.compare.tasks import Study
    from planner.report.comparison import comparison

    started = time.perf_counter()
    if simulation not in (None, *SIMULATIONS):
        raise InputError(f"--simulation {simulation} is not known; give {', '.join(SIMULATIONS)}.")
    given = material(recordings, robot, 0.0)
    loaded = given.nominal
    listed = given.listed(loaded)
    if campaign is None and given.campaign is not None:
        campaign = given.campaign.directory / store.CONFIG
    config = decide(loaded, listed, campaign, simulation)
    folder = out or _cache_folder()
    with telling("comparing", quiet=as_json) as progress:
        poses = recorded(listed, loaded.joints, config.modes, workers, progress)
        bench, remarks = assemble(loaded, config, poses)
        study = Study.plan(bench, strategies, models, repeats, initial, budget)
        found, damaged = conduct(bench, study, folder, scheduler, workers, progress)
    answer = comparison(bench, study, found, poses, (*remarks, *damaged))
    answer = answer.with_pictures(out, rrd, bench.key)
    answer = replace(answer, seconds=time.perf_counter() - started)
    if out is not None:
        answer.write(out)
    for run in answer.failed:
        warn(f"The run of {run.strategy} with seed {run.seed} failed: {run.reason}")
    return respond(answer, as_json)


def _cache_folder() -> Path:
    from planner import cache_folder

    try:
        return cache_folder.folder("compare")
    except RuntimeError:
        raise InputError(
            "There is no home folder to keep results in; name one with --out."
        ) from None
