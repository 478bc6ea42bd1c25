"""Conducting a comparison: what was done before is taken up, the rest done and kept at once."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from planner.campaign.config import ModesTable
from planner.campaign.journal import write_synced
from planner.compare import cluster, pool, processes
from planner.compare.bench import Bench
from planner.compare.pool import PoolPose
from planner.compare.processes import Failure
from planner.compare.run import run
from planner.compare.tasks import Run, Study, Task
from planner.errors import InputError
from planner.robot.robot import Robot

RUNS = "runs"
Progress = Callable[[str, int, int], None]  # what is counted, done, of how many


def recorded(
    recordings: Path,
    robot: Robot,
    table: ModesTable,
    workers: int,
    progress: Progress,
) -> tuple[PoolPose, ...]:
    """All poses of a recordings folder; what was found of them before is taken up."""
    files = pool.poses_of(recordings, robot, table)
    found = {i: pool.make(None, f) for i, f in enumerate(files) if pool.kept(f)}
    todo = [i for i in range(len(files)) if i not in found]
    progress("poses", len(found), len(files))
    for k, pose in processes.each(pool.make, None, [files[i] for i in todo], workers):
        if isinstance(pose, Failure):
            raise InputError(f"Pose {files[todo[k]].rows[0].pose}: {pose.reason}")
        found[todo[k]] = pose
        progress("poses", len(found), len(files))
    return tuple(found[i] for i in range(len(files)))


def conduct(
    bench: Bench,
    study: Study,
    folder: Path,
    scheduler: str | None,
    workers: int,
    progress: Progress,
) -> dict[Task, Run | Failure]:
    """Every run of a study. Runs are kept in `folder` as they end, under what they hang on."""
    kept = _folder(folder / RUNS)
    paths = {task: kept / f"{task.key(bench)}.json" for task in study.tasks}
    found: dict[Task, Run | Failure] = {t: r for t, p in paths.items() if (r := _read(p))}
    todo = [task for task in study.tasks if task not in found]
    progress("runs", len(found), len(paths))
    if todo:
        for k, answer in _spread(bench, todo, scheduler, workers):
            if isinstance(answer, Run):
                write_synced(paths[todo[k]], msgspec.json.encode(answer))
            found[todo[k]] = answer
            progress("runs", len(found), len(paths))
    return {task: found[task] for task in study.tasks}


def _spread(bench: Bench, tasks: list[Task], scheduler: str | None, workers: int) -> Any:
    if scheduler is not None:
        return cluster.each(run, bench, tasks, scheduler)
    return processes.each(run, bench, tasks, workers)


def _read(path: Path) -> Run | None:
    """A run that was kept; None where there is none, or none that can be read: it is run again."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Run)
    except (OSError, UnicodeDecodeError, msgspec.DecodeError):
        return None


def _folder(path: Path) -> Path:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{path} cannot be made ({error.strerror}); name another folder with --out."
        ) from None
    return path
