"""One run of a strategy on a bench: a pure function, the same numbers on every machine."""

import threading
import time
from dataclasses import replace

import msgspec
import numpy as np
from threadpoolctl import threadpool_limits

from planner import content_hash
from planner.campaign.build import build, hits_unknown
from planner.campaign.low_fidelity import Recall, in_memory
from planner.campaign.model import Model
from planner.campaign.proposals import propose
from planner.campaign.state import CampaignState
from planner.compare.bench import Bench, PoolCell, cell_of
from planner.compare.curves import Score, score
from planner.compare.tasks import Run, Task
from planner.design.space_filling import NESTED
from planner.errors import InputError

INITIAL_DESIGN = "maximin_lhs"  # gives the initial poses, so that this baseline is nested in itself

# A cell's robot and the BLAS threads belong to the whole process, of which a cluster's worker may
# use several threads.
_one_at_a_time = threading.Lock()


def run(bench: Bench, task: Task) -> Run:
    """Measure, refit and judge from the initial poses to the budget.

    Poses are chosen, and the model refitted, as a campaign does it; only that they come from the
    pool. Raises InputError if this machine runs another version of the program.
    """
    if bench.program != content_hash.program():
        raise InputError("This worker runs another version of planner; install the same one.")
    with _one_at_a_time, threadpool_limits(1):
        cell = _cell(bench, task)
        design = NESTED[INITIAL_DESIGN](cell.candidates.features, task.budget, task.seed)
        used = design[: task.initial].tolist()
        rest = [i for i in planned(cell, task) if i not in used]
        return play(bench, used, rest[: task.budget - task.initial], task)


def play(bench: Bench, used: list[int], then: list[int], task: Task) -> Run:
    """A run: first the poses `used`, then those of `then`, then what the strategy proposes."""
    wall, process = time.perf_counter(), time.process_time()
    cell = _cell(bench, task)
    counts, scores, recall = [], [], in_memory()
    while True:
        model, state = _fitted(bench, cell, used, task.seed, recall)
        counts.append(len(used))
        scores.append(_judged(bench, model, used))
        if len(used) == task.budget:
            break
        used = [*used, then.pop(0) if then else _chosen(bench, model, state, task.strategy)]
    names = tuple(bench.measurements[i].pose for i in used)
    minutes = _minutes(bench, cell, used)[task.initial - 1 :]
    seconds = time.perf_counter() - wall, time.process_time() - process
    rmse_percent, r2, coverage95 = zip(*scores, strict=True)
    return Run(
        task.strategy, task.seed, names, tuple(counts), rmse_percent, r2, coverage95, minutes,
        *seconds, task.model,
    )  # fmt: skip


def _cell(bench: Bench, task: Task) -> PoolCell:
    cell = cell_of(bench)
    if not task.model:
        return cell
    table = msgspec.structs.replace(cell.config.surrogate, model=task.model)
    return replace(cell, config=msgspec.structs.replace(cell.config, surrogate=table))


def _minutes(bench: Bench, cell: PoolCell, used: list[int]) -> tuple[float, ...]:
    """Robot time until each pose is measured, in this order, hit along the axes recorded."""
    cost, at, total = cell.cost, None, []
    for i in used:
        axes = tuple(axis for axis in range(3) if bench.frfs[i].hits[axis])
        total.append(float(cost.minutes(bench.q[i][None], at, axes)[0]))
        at = bench.q[i]
    return tuple(np.cumsum(total).tolist())


def planned(cell: PoolCell, task: Task) -> list[int]:
    """The poses that a strategy chooses without looking at the model; none if it does look."""
    if task.strategy not in NESTED:
        return []
    return NESTED[task.strategy](cell.candidates.features, task.budget, task.seed).tolist()


def _fitted(
    bench: Bench, cell: PoolCell, used: list[int], seed: int, recall: Recall
) -> tuple[Model, CampaignState]:
    measured = [bench.measurements[i] for i in used]
    frfs = {bench.measurements[i].pose: bench.frfs[i] for i in used}
    state = CampaignState(measurements={m.pose: m for m in measured}, events=seed)
    return build(cell, state, hits_unknown(frfs), recall), state


def _judged(bench: Bench, model: Model, used: list[int]) -> Score:
    unused = np.setdiff1d(np.arange(len(bench.measurements)), used)
    predicted = model.predict(bench.q[unused])
    truth = bench.frequency_hz[unused], bench.frequency_sd_hz[unused]
    return score(predicted.frequency_hz, predicted.frequency_sd_hz, *truth)


def _chosen(bench: Bench, model: Model, state: CampaignState, acquisition: str) -> int:
    (proposal,) = propose(model, state, 1, acquisition)
    joints = bench.robot.joints
    off = np.abs(joints.shown(bench.q) - np.array(proposal.joints_deg))
    away = (off / joints.same()).max(axis=1)
    return int(np.argmin(away))
