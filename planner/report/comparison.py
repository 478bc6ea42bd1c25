"""Answer of `compare`: learning curves of sampling strategies, drawn, and how they differ."""

import time
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text

from planner.campaign.journal import write_synced
from planner.compare.bench import Bench
from planner.compare.curves import Curves, baseline_of, medians, paired
from planner.compare.pool import PoolPose
from planner.compare.processes import Failure
from planner.compare.tasks import Run, Study, Task
from planner.errors import InputError
from planner.report.answer import Done, encoded
from planner.report.pictures import Pictures
from planner.report.text import ending, table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKS = "osv^DPX*<>"
PICTURE, TABLE = "learning_curves", "comparison.json"
SHOWN = 8  # columns of measurements that fit
CURVES = (
    ("frequency_rmse_percent", "Frequency RMSE (%)", ".2f"),
    ("r2", "R²", ".3f"),
    ("coverage95", "Share in 95 % interval", ".2f"),
)


def comparison(
    bench: Bench, study: Study, found: Mapping[Task, Run | Failure], poses: Sequence[PoolPose],
    told: Sequence[str], pictures: Pictures, started: float,
) -> Done:  # fmt: skip
    """Answer of `compare`, of all runs of a study; the picture's folder holds the JSON, too.

    "acquisitions" says which one each strategy is, "models" its model. `started` is when, in
    seconds. Raises InputError where every run of a strategy failed.
    """
    failed = {task: answer for task, answer in found.items() if isinstance(answer, Failure)}
    curves, fidelity = _curves(study, found, failed), bench.config.fidelity.simulation
    base, size, out = baseline_of(list(curves)), len(bench.measurements), pictures.folder
    others = {name: curve for name, curve in curves.items() if name != base}
    against = {name: paired(curve, curves[base]) for name, curve in others.items()}
    middle = {name: medians(curve) for name, curve in curves.items()}
    title = f"Pool of {size} poses, {study.repeats} repeats, simulation {fidelity}"
    simulated, name = any(p.simulated for p in poses), bench.robot.name
    note, usual = f"{title}\n\nPool {bench.key}.", bench.config.surrogate.model
    keys = {
        "strategies": middle,
        "measurements_to_one_percent": {name: curve.to_goal for name, curve in curves.items()},
        "minutes_to_one_percent": {name: curve.minutes_to_goal for name, curve in curves.items()},
        "paired": {"baseline": base, "against": against}, "robot": name,
        "acquisitions": {name: own for name, (own, _) in study.strategies.items()},
        "models": {name: model or usual for name, (_, model) in study.strategies.items()},
        "pool": size, "repeats": study.repeats, "initial": study.initial, "budget": study.budget,
        "simulation": fidelity,
        "failed": [{"strategy": task.strategy, "seed": task.seed, "reason": why.reason}
                   for task, why in failed.items()],
        "refused": [file for pose in poses for file in pose.refused], "remarks": told,
        "simulated": simulated, "out": None if out is None else str(out.absolute()),
        **pictures.write(
            lambda: {PICTURE: _figure(curves, title)}, name, note, simulated=simulated
        ),
        "seconds": time.perf_counter() - started,
    }  # fmt: skip
    goals = _goals(curves, middle, against, study.budget)
    answer = Done(keys, Group(
        _head(keys), *_tables(middle), goals, *map(Text, told), *ending(keys)
    ))  # fmt: skip
    if out is not None:
        write_synced(out / TABLE, encoded(answer))
    return answer


def _head(keys: Mapping[str, Any]) -> Text:
    return Text(
        f"{keys['robot']}: pool of {keys['pool']} poses, {keys['repeats']} repeats from "
        f"{keys['initial']} to {keys['budget']} measurements, simulation {keys['simulation']}; "
        f"medians, on poses not used."
    )


def _curves(
    study: Study, found: Mapping[Task, Run | Failure], failed: Mapping[Task, Failure]
) -> dict[str, Curves]:
    """By strategy, as the user named them."""
    runs, curves = [run for run in found.values() if isinstance(run, Run)], {}
    for name, asked in study.strategies.items():
        own = [run for run in runs if (run.strategy, run.model) == asked]
        if not own:
            why = next(iter(failed.values())).reason
            raise InputError(f"Every run of {name} failed: {why}")
        curves[name] = Curves.of(own)
    return curves


def _tables(middle: Mapping[str, dict[str, Any]]) -> Iterator[Table]:
    """Curves; up to SHOWN columns, first and last among them."""
    n = next(iter(middle.values()))["n"]
    columns = np.unique(np.linspace(0, len(n) - 1, min(len(n), SHOWN)).round().astype(int)).tolist()
    for key, title, form in CURVES:
        made = table(f"{title} by measurements", "strategy", *(str(n[i]) for i in columns))
        for name, curve in middle.items():
            made.add_row(name, *(format(float(curve[key][i]), form) for i in columns))
        yield made


def _goals(
    curves: Mapping[str, Curves], middle: Mapping[str, dict[str, Any]],
    against: Mapping[str, dict[str, Any] | None], budget: int,
) -> Table:  # fmt: skip
    """What each strategy needs to reach 1 %, and how it differs from the baseline."""
    made = table(
        f"To 1 %, and compared with {baseline_of(list(curves))} from the same initial poses "
        f"(95 % interval)",
        "strategy", "to 1 %", "robot (min)", "measurements more",
        f"RMSE more after {budget} (points)", "wall (s)",
    )  # fmt: skip
    for name, curve in curves.items():
        d, reached = against.get(name), (curve.to_goal, curve.minutes_to_goal)
        goal = after = "–"
        if d is not None:
            to_goal = d["measurements_to_one_percent"], d["measurements_to_one_percent_interval95"]
            goal = _interval(*to_goal, "+.1f")
            last = d["difference_percent"][-1], d["difference_percent_interval95"][-1]
            after = _interval(*last, "+.3f")
        cells = ("–" if v is None else f"{v:.0f}" for v in reached)
        made.add_row(name, *cells, goal, after, f"{middle[name]['wall_seconds']:.1f}")
    return made


def _interval(value: float, interval: np.ndarray, form: str) -> str:
    low, high = interval
    return f"{value:{form}} ({low:{form}}, {high:{form}})"


def _figure(strategies: Mapping[str, Curves], title: str) -> "Figure":
    """Medians with quartiles over repeats; RMSE on a logarithmic axis with the 1 % line."""
    from planner.report.plot_marks import empty

    figure = empty((11.0, 4.6), title)
    panels = figure.subplot_mosaic([["rmse", "r2"], ["rmse", "coverage"]], width_ratios=(1.5, 1))
    for i, (name, curve) in enumerate(strategies.items()):
        style: dict[str, Any] = {
            "color": f"C{i % 10}",
            "marker": MARKS[i % len(MARKS)],
            "label": name,
        }
        low, median, high = np.percentile(curve.frequency_rmse_percent, (25, 50, 75), axis=0)
        panels["rmse"].fill_between(curve.n, low, high, color=style["color"], alpha=0.15, lw=0)
        medians = {"rmse": median, "r2": np.median(curve.r2, axis=0)}
        medians["coverage"] = np.median(curve.coverage95, axis=0)
        for key, values in medians.items():
            panels[key].plot(curve.n, values, ms=4, lw=1.4, **style)
    _finish(panels, strategies)
    return figure


def _finish(panels: "Mapping[str, Axes]", strategies: Mapping[str, Curves]) -> None:
    from matplotlib.ticker import MaxNLocator, ScalarFormatter

    rmse, r2, coverage = panels["rmse"], panels["r2"], panels["coverage"]
    rmse.set_yscale("log")
    rmse.yaxis.set_major_formatter(ScalarFormatter())
    rmse.yaxis.set_minor_formatter(ScalarFormatter())
    rmse.tick_params(axis="y", which="minor", labelsize=7)
    rmse.axhline(1.0, color="black", lw=0.8, ls="--")
    rmse.annotate("1 %", (1.0, 1.0), xycoords=("axes fraction", "data"), fontsize=8,
                  xytext=(-4, 3), textcoords="offset points", ha="right")  # fmt: skip
    rmse.set_ylabel("frequency RMSE at unused poses (%)")
    # One bad start must not squeeze all the rest into a line.
    worst = min(float(np.min(np.median(c.r2, axis=0))) for c in strategies.values())
    r2.set(ylim=(max(worst - 0.05, -0.5), 1.02), ylabel="R²")
    coverage.axhline(0.95, color="black", lw=0.8, ls="--")
    coverage.set_ylim(min(0.8, coverage.get_ylim()[0]), 1.02)
    coverage.set_ylabel("share in 95 % interval")
    for panel in panels.values():
        panel.xaxis.set_major_locator(MaxNLocator(integer=True))
        panel.grid(True, which="both", alpha=0.25)
    for panel in (rmse, coverage):
        panel.set_xlabel("measurements")
    rmse.legend(fontsize=8, title="median, band: quartiles", title_fontsize=8)
