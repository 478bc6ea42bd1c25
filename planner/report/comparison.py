"""Answer of `compare`: learning curves of sampling strategies, and how they differ."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from planner.compare.bench import Bench
from planner.compare.curves import (
    Curves,
    StrategyCurve,
    StrategyDifference,
    baseline_of,
    paired,
)
from planner.compare.pool import PoolPose
from planner.compare.processes import Failure
from planner.compare.tasks import Run, Study, Task
from planner.errors import InputError
from planner.report.answer import NOT_IN_JSON, Answer, RefusedFile, encoded
from planner.report.pictures import Pictures
from planner.report.text import table

PICTURE, TABLE = "learning_curves", "comparison.json"
SHOWN = 8  # columns of measurements that fit


@dataclass(frozen=True)
class PairedStrategies:
    """All strategies but one held against that one."""

    baseline: str
    against: Mapping[str, StrategyDifference | None]


@dataclass(frozen=True)
class FailedRun:
    """A run that ended in an error."""

    strategy: str
    seed: int
    reason: str


@dataclass(frozen=True, eq=False)
class ComparisonReport(Answer):
    """Answer of `compare`; `acquisitions` says which one each strategy is, `models` its model."""

    strategies: Mapping[str, StrategyCurve]
    measurements_to_one_percent: Mapping[str, int | None]
    minutes_to_one_percent: Mapping[str, float | None]
    paired: PairedStrategies
    acquisitions: Mapping[str, str]
    models: Mapping[str, str]
    robot: str
    pool: int
    repeats: int
    initial: int
    budget: int
    simulation: str
    failed: tuple[FailedRun, ...]
    refused: tuple[RefusedFile, ...]
    remarks: tuple[str, ...]
    simulated: bool
    out: str | None = None
    plots: tuple[str, ...] = ()
    rrd: str | None = None
    seconds: float = 0.0
    curves: Mapping[str, Curves] | None = field(default=None, repr=False, metadata=NOT_IN_JSON)

    def with_pictures(self, out: Path | None, rrd: Path | None, key: str) -> "ComparisonReport":  # pyrefly: ignore[bad-override-param-name]
        """The same with the picture in `out` and the Rerun file, where they are wanted.

        `key` is the pool's content hash.
        """
        curves = self.curves
        if curves is None:
            return self
        title = f"Pool of {self.pool} poses, {self.repeats} repeats, simulation {self.simulation}"

        def figures():
            from planner.report.learning_curves import learning_figure

            return {PICTURE: learning_figure(curves, title)}

        note = f"{title}\n\nPool {key}."
        shown = self.with_figures(Pictures(out, rrd=rrd), figures, self.robot, note)
        return shown if out is None else replace(shown, out=str(out.absolute()))

    def write(self, folder: Path) -> None:
        """The JSON answer as a file of the folder."""
        from planner.campaign.journal import write_synced

        write_synced(folder / TABLE, encoded(self))

    def text(self) -> Group:
        """Curves as tables, then what each strategy needs to reach 1 %."""
        columns = _spread(len(next(iter(self.strategies.values())).n))
        head = Text(
            f"{self.robot}: pool of {self.pool} poses, {self.repeats} repeats from {self.initial} "
            f"to {self.budget} measurements, simulation {self.simulation}; medians, on poses not "
            f"used."
        )
        return Group(
            head,
            self._curves("frequency_rmse_percent", "Frequency RMSE (%)", ".2f", columns),
            self._curves("r2", "R²", ".3f", columns),
            self._curves("coverage95", "Share in 95 % interval", ".2f", columns),
            self._goals(),
            *map(Text, self.remarks),
            *self.end,
        )

    def _curves(self, name: str, title: str, form: str, columns: list[int]) -> RenderableType:
        n = next(iter(self.strategies.values())).n
        made = table(f"{title} by measurements", "strategy", *(str(n[i]) for i in columns))
        for strategy, curve in self.strategies.items():
            values = getattr(curve, name)
            made.add_row(strategy, *(format(float(values[i]), form) for i in columns))
        return made

    def _goals(self) -> RenderableType:
        made = table(
            f"To 1 %, and compared with {self.paired.baseline} from the same initial poses "
            f"(95 % interval)",
            "strategy", "to 1 %", "robot (min)", "measurements more",
            f"RMSE more after {self.budget} (points)", "wall (s)",
        )  # fmt: skip
        for name, curve in self.strategies.items():
            d = self.paired.against.get(name)
            reached = self.measurements_to_one_percent[name], self.minutes_to_one_percent[name]
            goal = after = "–"
            if d is not None:
                to_goal = d.measurements_to_one_percent, d.measurements_to_one_percent_interval95
                goal = _interval(*to_goal, "+.1f")
                last = d.difference_percent[-1], d.difference_percent_interval95[-1]
                after = _interval(*last, "+.3f")
            cells = ("–" if v is None else f"{v:.0f}" for v in reached)
            made.add_row(name, *cells, goal, after, f"{curve.wall_seconds:.1f}")
        return made


def comparison(
    bench: Bench,
    study: Study,
    found: Mapping[Task, Run | Failure],
    poses: Sequence[PoolPose],
    remarks: tuple[str, ...],
) -> ComparisonReport:
    """Of all runs of a study; InputError where every run of a strategy failed."""
    failed = tuple(
        FailedRun(task.strategy, task.seed, answer.reason)
        for task, answer in found.items()
        if isinstance(answer, Failure)
    )
    curves = _by_name(study, found, failed)
    baseline = baseline_of(list(curves))
    against = {
        name: paired(curve, curves[baseline]) for name, curve in curves.items() if name != baseline
    }
    return ComparisonReport(
        strategies={name: StrategyCurve.of(curve) for name, curve in curves.items()},
        measurements_to_one_percent={name: curve.to_goal for name, curve in curves.items()},
        minutes_to_one_percent={name: curve.minutes_to_goal for name, curve in curves.items()},
        paired=PairedStrategies(baseline, against),
        acquisitions=study.strategies,
        models={name: m or bench.config.surrogate.model for name, m in study.models.items()},
        robot=bench.robot.name,
        pool=len(bench.measurements),
        repeats=study.repeats,
        initial=study.initial,
        budget=study.budget,
        simulation=bench.config.fidelity.simulation,
        failed=failed,
        refused=tuple(RefusedFile(r.file, r.reason) for p in poses for r in p.refused),
        remarks=remarks,
        simulated=any(p.simulated for p in poses),
        curves=curves,
    )


def _by_name(
    study: Study, found: Mapping[Task, Run | Failure], failed: Sequence[FailedRun]
) -> dict[str, Curves]:
    """Curves by the names that the user gave."""
    curves = {}
    for name, strategy in study.strategies.items():
        asked = strategy, study.models[name]
        runs = [r for r in found.values() if isinstance(r, Run) and (r.strategy, r.model) == asked]
        if not runs:
            raise InputError(f"Every run of {name} failed: {failed[0].reason}")
        curves[name] = Curves.of(runs)
    return curves


def _interval(value: float, interval: np.ndarray, form: str) -> str:
    low, high = interval
    return f"{value:{form}} ({low:{form}}, {high:{form}})"


def _spread(count: int) -> list[int]:
    """Up to SHOWN places of `count`, first and last among them."""
    return np.unique(np.linspace(0, count - 1, min(count, SHOWN)).round().astype(int)).tolist()
