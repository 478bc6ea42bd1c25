"""Answer of `compare`: learning curves of sampling strategies, and how they differ."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from planner.compare.bench import Bench
from planner.compare.curves import Curves, StrategyCurve, StrategyDifference, baseline_of, paired
from planner.compare.pool import PoolPose
from planner.compare.processes import Failure
from planner.compare.tasks import Run, Study, Task
from planner.errors import InputError, RefusedFile
from planner.report.answer import Answer, encoded, plain
from planner.report.pictures import Pictures
from planner.report.text import table

PICTURE, TABLE = "learning_curves", "comparison.json"
SHOWN = 8  # columns of measurements that fit


@dataclass(frozen=True, eq=False)
class ComparisonReport(Answer):
    """Answer of `compare`; a task that `failed` has the reason."""

    bench: Bench
    study: Study
    curves: Mapping[str, Curves]
    failed: Mapping[Task, Failure]
    refused: tuple[RefusedFile, ...]
    remarks: tuple[str, ...]
    simulated: bool
    out: str | None = None
    plots: tuple[str, ...] = ()
    rrd: str | None = None
    seconds: float = 0.0

    @cached_property
    def baseline(self) -> str:
        """The strategy against which all others are held."""
        return baseline_of(list(self.curves))

    @cached_property
    def against(self) -> dict[str, StrategyDifference | None]:
        """The others against it."""
        base = self.baseline
        others = {name: curve for name, curve in self.curves.items() if name != base}
        return {name: paired(curve, self.curves[base]) for name, curve in others.items()}

    @cached_property
    def strategies(self) -> dict[str, StrategyCurve]:
        """Medians over repeats."""
        return {name: StrategyCurve.of(curve) for name, curve in self.curves.items()}

    def to_json(self) -> dict[str, Any]:
        """ "acquisitions" says which one each strategy is, "models" its model."""
        study, bench, curves = self.study, self.bench, self.curves.items()
        own = bench.config.surrogate.model
        return plain({
            "strategies": self.strategies,
            "measurements_to_one_percent": {name: curve.to_goal for name, curve in curves},
            "minutes_to_one_percent": {name: curve.minutes_to_goal for name, curve in curves},
            "paired": {"baseline": self.baseline, "against": self.against},
            "acquisitions": study.strategies,
            "models": {name: model or own for name, model in study.models.items()},
            "robot": bench.robot.name, "pool": len(bench.measurements), "repeats": study.repeats,
            "initial": study.initial, "budget": study.budget,
            "simulation": bench.config.fidelity.simulation,
            "failed": [{"strategy": task.strategy, "seed": task.seed, "reason": why.reason}
                       for task, why in self.failed.items()],
            "refused": self.refused, "remarks": self.remarks, "simulated": self.simulated,
            "out": self.out, "plots": self.plots, "rrd": self.rrd, "seconds": self.seconds,
        })  # fmt: skip

    def with_pictures(self, out: Path | None, rrd: Path | None) -> "ComparisonReport":
        """The same with the picture in `out` and the Rerun file, where they are wanted."""
        bench, study = self.bench, self.study
        title = (
            f"Pool of {len(bench.measurements)} poses, {study.repeats} repeats, simulation "
            f"{bench.config.fidelity.simulation}"
        )

        def figures():
            from planner.report.learning_curves import learning_figure

            return {PICTURE: learning_figure(self.curves, title)}

        note = f"{title}\n\nPool {bench.key}."
        shown = self.with_figures(Pictures(out, rrd=rrd), figures, bench.robot.name, note)
        return shown if out is None else replace(shown, out=str(out.absolute()))

    def write(self, folder: Path) -> None:
        """The JSON answer as a file of the folder."""
        from planner.campaign.journal import write_synced

        write_synced(folder / TABLE, encoded(self))

    def text(self) -> Group:
        """Curves as tables, then what each strategy needs to reach 1 %."""
        bench, study, n = self.bench, self.study, len(next(iter(self.curves.values())).n)
        # Up to SHOWN columns, first and last among them.
        columns = np.unique(np.linspace(0, n - 1, min(n, SHOWN)).round().astype(int)).tolist()
        head = Text(
            f"{bench.robot.name}: pool of {len(bench.measurements)} poses, {study.repeats} repeats "
            f"from {study.initial} to {study.budget} measurements, simulation "
            f"{bench.config.fidelity.simulation}; medians, on poses not used."
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
            f"To 1 %, and compared with {self.baseline} from the same initial poses "
            f"(95 % interval)",
            "strategy", "to 1 %", "robot (min)", "measurements more",
            f"RMSE more after {self.study.budget} (points)", "wall (s)",
        )  # fmt: skip
        for name, curve in self.curves.items():
            d, reached = self.against.get(name), (curve.to_goal, curve.minutes_to_goal)
            goal = after = "–"
            if d is not None:
                to_goal = d.measurements_to_one_percent, d.measurements_to_one_percent_interval95
                goal = _interval(*to_goal, "+.1f")
                last = d.difference_percent[-1], d.difference_percent_interval95[-1]
                after = _interval(*last, "+.3f")
            cells = ("–" if v is None else f"{v:.0f}" for v in reached)
            made.add_row(name, *cells, goal, after, f"{self.strategies[name].wall_seconds:.1f}")
        return made


def comparison(
    bench: Bench,
    study: Study,
    found: Mapping[Task, Run | Failure],
    poses: Sequence[PoolPose],
    remarks: tuple[str, ...],
) -> ComparisonReport:
    """Of all runs of a study; InputError where every run of a strategy failed."""
    failed = {task: answer for task, answer in found.items() if isinstance(answer, Failure)}
    runs = [run for run in found.values() if isinstance(run, Run)]
    curves = {}
    for name, strategy in study.strategies.items():  # as the user named them
        own = [run for run in runs if (run.strategy, run.model) == (strategy, study.models[name])]
        if not own:
            why = next(iter(failed.values())).reason
            raise InputError(f"Every run of {name} failed: {why}")
        curves[name] = Curves.of(own)
    refused = tuple(file for pose in poses for file in pose.refused)
    simulated = any(p.simulated for p in poses)
    return ComparisonReport(bench, study, curves, failed, refused, remarks, simulated)


def _interval(value: float, interval: np.ndarray, form: str) -> str:
    low, high = interval
    return f"{value:{form}} ({low:{form}}, {high:{form}})"
