"""What another strategy would have saved in a campaign: played on the poses that were measured."""

from dataclasses import dataclass
from typing import Any

from threadpoolctl import threadpool_limits

from planner.campaign.campaign import Campaign
from planner.compare.bench import Bench, assemble, cell_of
from planner.compare.curves import Curves
from planner.compare.pool import PoolPose
from planner.compare.run import planned, play
from planner.compare.tasks import LEFT, Run, Task
from planner.design.propose import check_name
from planner.design.space_filling import NESTED
from planner.errors import InputError

LEAST_POSES = 2 + LEFT  # measured: one to begin with, one to choose, and some to judge by
KEYS = "poses", "n", "frequency_rmse_percent", "minutes"  # of a run that are told


@dataclass(frozen=True)
class OtherAcquisition:
    """What another acquisition would have saved among the poses measured; KEYS of `runs` by name.

    The campaign in the order in which it was measured, and as the acquisition would have chosen:
    both begin with the pose measured first and are judged on the poses not yet used, after n
    measurements each.
    """

    acquisition: str
    text: str
    runs: dict[str, dict[str, Any]]

    @classmethod
    def of(cls, campaign: Campaign, acquisition: str) -> "OtherAcquisition | None":
        """None with too few measured poses to tell.

        Raises InputError for an unknown acquisition.
        """
        if acquisition not in NESTED:
            check_name(acquisition)
        bench = _bench(campaign)
        if bench is None:
            return None
        count = len(bench.measurements)
        task = Task(acquisition, 0, 1, count - LEFT)
        order = list(range(count - LEFT))
        with threadpool_limits(1):
            rest = [i for i in planned(cell_of(bench), task) if i] if acquisition in NESTED else []
            was = play(bench, order[:1], order[1:], task)
            other = play(bench, order[:1], rest[: task.budget - 1], task)
        text = (
            f"To an RMSE of 1 % on the poses not yet used, {acquisition} would have needed "
            f"{_to_goal(other)}, the campaign as it was {_to_goal(was)} (chosen among the {count} "
            "poses measured)."
        )
        runs = {
            name: {key: getattr(run, key) for key in KEYS}
            for name, run in (("campaign", was), (acquisition, other))
        }
        return cls(acquisition, text, runs)


def _bench(campaign: Campaign) -> Bench | None:
    """The poses that were measured, if they are enough."""
    cell, used = campaign.cell, campaign.state.used
    if len(used) < LEAST_POSES:
        return None
    poses = [PoolPose(m, campaign.frf_of(m), (), "", m.simulated) for m in used]
    try:
        bench, _ = assemble(cell.robot, cell.config, poses)
    except InputError:
        return None
    return bench if len(bench.measurements) >= LEAST_POSES else None


def _to_goal(run: Run) -> str:
    curve = Curves.of([run])
    if curve.to_goal is None:
        return f"more than {run.n[-1]}"
    return f"{curve.to_goal} ({curve.minutes_to_goal:.0f} min of robot time)"
