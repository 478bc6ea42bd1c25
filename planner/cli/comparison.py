"""Comparison of sampling strategies on a pool of recordings (`planner compare`)."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import typer

from planner.cli.answer import AsJson, respond, warn
from planner.errors import InputError

if TYPE_CHECKING:
    from planner.compare.bench import Bench
    from planner.compare.curves import Curves
    from planner.compare.pool import PoolPose
    from planner.compare.processes import Failure
    from planner.compare.tasks import Run, Study, Task
    from planner.report.learning_curves import Learning

SIMULATIONS = ("frozen", "updated", "none")
PICTURE, TABLE = "learning_curves.png", "comparison.json"


def compare(
    recordings: Annotated[
        Path, typer.Argument(metavar="RECORDINGS", help="Folder with recordings.csv: the pool.")
    ],
    robot: Annotated[Path, typer.Option(metavar="ROBOT_TOML", help="The robot's robot.toml.")],
    strategies: Annotated[
        str, typer.Option(metavar="A,B,…", help="random, sobol, maximin_lhs, default, variance, …")
    ],
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
    """Compare sampling strategies: error by number of measurements, on poses not used."""
    from planner.cli.progress import bars
    from planner.cli.render_comparison import compared
    from planner.compare.bench import assemble, decide
    from planner.compare.resume import conduct, recorded
    from planner.compare.tasks import Study
    from planner.recording.folder import read_recordings
    from planner.robot.robot import Robot

    started = time.perf_counter()
    if simulation not in (None, *SIMULATIONS):
        raise InputError(f"--simulation {simulation} is not known; give {', '.join(SIMULATIONS)}.")
    loaded = Robot.load(robot)
    rows = read_recordings(recordings, loaded.joint_names).rows
    config = decide(loaded, [row.joints_deg for row in rows], campaign, simulation)
    folder = out or _cache_folder()
    with bars(quiet=as_json) as progress:
        poses = recorded(recordings, loaded.joint_names, config.modes, workers, progress)
        bench, remarks = assemble(loaded, config, poses)
        study = Study.plan(bench, strategies, repeats, initial, budget)
        found = conduct(bench, study, folder, scheduler, workers, progress)
    answer = _answer(bench, study, found) | _about(poses, remarks)
    answer |= _shown(answer, bench, study, found, out, rrd)
    answer["seconds"] = time.perf_counter() - started
    if out is not None:
        _write(out / TABLE, answer)
    for entry in answer["failed"]:
        warn(f"The run of {entry['strategy']} with seed {entry['seed']} failed: {entry['reason']}")
    return respond(answer, as_json, compared)


def _cache_folder() -> Path:
    from planner import cache_folder

    try:
        return cache_folder.folder("compare")
    except RuntimeError:
        raise InputError(
            "There is no home folder to keep results in; name one with --out."
        ) from None


def _by_name(
    study: "Study", found: "dict[Task, Run | Failure]"
) -> "tuple[dict[str, Curves], list[dict[str, Any]]]":
    """Curves by the names that the user gave, and the runs that failed."""
    from planner.compare.curves import Curves
    from planner.compare.tasks import Run

    failed = [
        {"strategy": task.strategy, "seed": task.seed, "reason": answer.reason}
        for task, answer in found.items()
        if not isinstance(answer, Run)
    ]
    curves = {}
    for name, strategy in study.strategies.items():
        runs = [r for r in found.values() if isinstance(r, Run) and r.strategy == strategy]
        if not runs:
            raise InputError(f"Every run of {name} failed: {failed[0]['reason']}")
        curves[name] = Curves.of(runs)
    return curves, failed


def _answer(bench: "Bench", study: "Study", found: "dict[Task, Run | Failure]") -> dict[str, Any]:
    from planner.compare.curves import baseline_of, paired

    curves, failed = _by_name(study, found)
    baseline = baseline_of(list(curves))
    against = {
        name: _difference(paired(curve, curves[baseline]))
        for name, curve in curves.items()
        if name != baseline
    }
    return {
        "strategies": {name: _curve(curve) for name, curve in curves.items()},
        "measurements_to_one_percent": {name: curve.to_goal for name, curve in curves.items()},
        "minutes_to_one_percent": {name: curve.minutes_to_goal for name, curve in curves.items()},
        "paired": {"baseline": baseline, "against": against},
        "acquisitions": study.strategies,
        "robot": bench.robot.name,
        "pool": len(bench.measurements),
        "repeats": study.repeats,
        "initial": study.initial,
        "budget": study.budget,
        "simulation": bench.config.fidelity.simulation,
        "failed": failed,
    }


def _curve(curve: "Curves") -> dict[str, Any]:
    import numpy as np

    low, middle, high = np.percentile(curve.frequency_rmse_percent, (25, 50, 75), axis=0)
    return {
        "n": curve.n,
        "frequency_rmse_percent": middle,
        "frequency_rmse_percent_quartiles": [low, high],
        "frequency_rmse_percent_worst": curve.frequency_rmse_percent.max(axis=0),
        "r2": np.median(curve.r2, axis=0),
        "coverage95": np.median(curve.coverage95, axis=0),
        "coverage95_mean": np.mean(curve.coverage95, axis=0),
        "minutes": np.median(curve.minutes, axis=0),
        "wall_seconds": curve.wall_seconds.sum(),
        "process_seconds": curve.process_seconds.sum(),
        "runs": len(curve.seeds),
    }


def _difference(found: Any) -> dict[str, Any] | None:
    if found is None:
        return None
    return {
        "seeds": found.seeds,
        "difference_percent": found.difference,
        "difference_percent_interval95": found.interval,
        "measurements_to_one_percent": found.to_goal,
        "measurements_to_one_percent_interval95": found.to_goal_interval,
    }


def _about(poses: "tuple[PoolPose, ...]", remarks: tuple[str, ...]) -> dict[str, Any]:
    return {
        "refused": [{"file": r.file, "reason": r.reason} for p in poses for r in p.refused],
        "remarks": list(remarks),
        "simulated": any(p.simulated for p in poses),
    }


def _shown(
    answer: dict[str, Any],
    bench: "Bench",
    study: "Study",
    found: "dict[Task, Run | Failure]",
    out: Path | None,
    rrd: Path | None,
) -> dict[str, Any]:
    """The picture in `out` and the Rerun file, where they are wanted."""
    shown: dict[str, Any] = {"out": None, "plots": [], "rrd": None}
    if out is None and rrd is None:
        return shown
    from planner.report.learning_curves import learning_figure

    curves = {name: _learning(curve) for name, curve in _by_name(study, found)[0].items()}
    mark = "SIMULATED recordings · " if answer["simulated"] else ""
    title = (
        f"{mark}{answer['robot']}: pool of {answer['pool']} poses, {answer['repeats']} repeats, "
        f"simulation {answer['simulation']}"
    )
    figure = learning_figure(curves, title)
    if out is not None:
        from planner.report.frf_plots import save

        shown |= {"out": str(out.absolute()), "plots": [str(out.absolute() / PICTURE)]}
        save(figure, out / PICTURE)
    if rrd is not None:
        from planner.report.rerun_learning import write

        shown["rrd"] = str(rrd.absolute())
        write(curves, figure, rrd, bench.key, title)
    return shown


def _learning(curve: "Curves") -> "Learning":
    from planner.report.learning_curves import Band, Learning

    parts = (curve.frequency_rmse_percent, curve.r2, curve.coverage95)
    return Learning(curve.n, *(Band.of(part) for part in parts))


def _write(path: Path, answer: dict[str, Any]) -> None:
    from planner.campaign.journal import write_synced
    from planner.cli.answer import plain

    write_synced(path, msgspec.json.format(msgspec.json.encode(plain(answer)), indent=2))
