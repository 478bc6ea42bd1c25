"""The answer of `planner compare` as text."""

from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from planner.cli.render import SIMULATED, table

SHOWN = 8  # columns of measurements that fit


def compared(answer: dict[str, Any]) -> RenderableType:
    """Text of `compare`."""
    strategies = answer["strategies"]
    n = list(next(iter(strategies.values()))["n"])
    columns = _spread(len(n))
    parts: list[RenderableType] = [SIMULATED] if answer["simulated"] else []
    parts.append(
        Text(
            f"{answer['robot']}: pool of {answer['pool']} poses, {answer['repeats']} repeats from "
            f"{answer['initial']} to {answer['budget']} measurements, simulation "
            f"{answer['simulation']}; medians, on poses not used."
        )
    )
    for key, title, form in (
        ("frequency_rmse_percent", "Frequency RMSE (%) by measurements", ".2f"),
        ("r2", "R² by measurements", ".3f"),
        ("coverage95", "Share in 95 % interval by measurements", ".2f"),
    ):
        made = table(title, "strategy", *(str(n[i]) for i in columns))
        for name, curve in strategies.items():
            made.add_row(name, *(format(float(curve[key][i]), form) for i in columns))
        parts.append(made)
    parts += [_goals(answer), *map(Text, answer["remarks"])]
    for key in ("plots", "rrd"):
        if answer[key]:
            parts.append(Text(f"Written: {answer[key][0] if key == 'plots' else answer[key]}"))
    return Group(*parts)


def _goals(answer: dict[str, Any]) -> RenderableType:
    baseline = answer["paired"]["baseline"]
    last = answer["budget"]
    made = table(
        f"To 1 %, and compared with {baseline} from the same initial poses (95 % interval)",
        "strategy", "to 1 %", "robot (min)", "measurements more",
        f"RMSE more after {last} (points)", "wall (s)",
    )  # fmt: skip
    for name, reached in answer["measurements_to_one_percent"].items():
        found = answer["paired"]["against"].get(name)
        goal = after = "–"
        if found is not None:
            goal = _interval(
                found["measurements_to_one_percent"],
                found["measurements_to_one_percent_interval95"],
                "+.1f",
            )
            after = _interval(
                found["difference_percent"][-1],
                found["difference_percent_interval95"][-1],
                "+.3f",
            )
        wall = f"{answer['strategies'][name]['wall_seconds']:.1f}"
        minutes = answer["minutes_to_one_percent"][name]
        made.add_row(
            name, *("–" if v is None else f"{v:.0f}" for v in (reached, minutes)), goal, after, wall
        )
    return made


def _interval(value: float, interval: Any, form: str) -> str:
    low, high = interval
    return f"{value:{form}} [{low:{form}}, {high:{form}}]".replace("[", "(").replace("]", ")")


def _spread(count: int) -> list[int]:
    """Up to SHOWN places of `count`, first and last among them."""
    if count <= SHOWN:
        return list(range(count))
    return sorted({round(i * (count - 1) / (SHOWN - 1)) for i in range(SHOWN)})
