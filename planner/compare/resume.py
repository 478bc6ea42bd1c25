"""Conducting a comparison: what was done before is taken up, the rest done and kept at once."""

from collections.abc import Sequence
from pathlib import Path

from planner.campaign.config import ModesTable
from planner.campaign.journal import read_checked, write_checked
from planner.compare import pool, processes
from planner.compare.bench import Bench
from planner.compare.pool import PoolPose
from planner.compare.processes import Failure
from planner.compare.run import run
from planner.compare.tasks import Run, Study, Task
from planner.dataset.visits import Recording
from planner.errors import InputError
from planner.progress import ProgressCallback
from planner.recording.joints import JointUnits

RUNS = "runs"


def recorded(
    recordings: Sequence[Recording],
    joints: JointUnits,
    table: ModesTable,
    workers: int,
    progress: ProgressCallback,
) -> tuple[PoolPose, ...]:
    """All poses of recordings; what was found of them before is taken up."""
    files = pool.poses_of(recordings, joints, table)
    found = {i: pool.make(None, f) for i, f in enumerate(files) if f.measured.is_kept}
    todo = [i for i in range(len(files)) if i not in found]
    _count(progress, "poses", len(found), len(files))
    for k, pose in processes.each(pool.make, None, [files[i] for i in todo], workers):
        if isinstance(pose, Failure):
            raise InputError(f"Pose {files[todo[k]].pose}: {pose.reason}")
        found[todo[k]] = pose
        _count(progress, "poses", len(found), len(files))
    return tuple(found[i] for i in range(len(files)))


def conduct(
    bench: Bench,
    study: Study,
    folder: Path,
    scheduler: str | None,
    workers: int,
    progress: ProgressCallback,
) -> tuple[dict[Task, Run | Failure], tuple[str, ...]]:
    """Every run of a study, and remarks on kept ones that were damaged and are done again.

    Runs are kept in `folder` as they end, under what they hang on.
    """
    kept = _folder(folder / RUNS)
    paths = {task: kept / f"{task.key(bench)}.json" for task in study.tasks}
    read = {task: read_checked(path, Run) for task, path in paths.items()}
    found: dict[Task, Run | Failure] = {task: run for task, run in read.items() if run}
    todo = [task for task in study.tasks if task not in found]
    damaged = [paths[task].name for task in todo if paths[task].exists()]
    _count(progress, "runs", len(found), len(paths))
    if todo:
        for k, answer in processes.each(run, bench, todo, workers, scheduler):
            if isinstance(answer, Run):
                write_checked(paths[todo[k]], answer)
            found[todo[k]] = answer
            _count(progress, "runs", len(found), len(paths))
    return {task: found[task] for task in study.tasks}, _told(damaged, kept)


def _count(progress: ProgressCallback, what: str, done: int, total: int) -> None:
    progress(f"{what}, {done} of {total}", done / max(total, 1))


def _told(damaged: list[str], folder: Path) -> tuple[str, ...]:
    if not damaged:
        return ()
    what = f"{len(damaged)} kept runs in {folder} were" if damaged[1:] else "1 kept run was"
    where = ", ".join(damaged) if damaged[1:] else str(folder / damaged[0])
    return (f"{what} damaged ({where}) and done again.",)


def _folder(path: Path) -> Path:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{path} cannot be made ({error.strerror}); name another folder with --out."
        ) from None
    return path
