"""The answer of `planner identify` as text."""

import math
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from planner.cli.render import SIMULATED, table


def identified(answer: dict[str, Any]) -> RenderableType:
    """Text of `identify`."""
    low, high = answer["band_hz"]
    made = table(
        f"Elastic parameters from {len(answer['misfit_by_pose'])} poses, {low:g} to {high:g} Hz",
        *("joint and axis", "stiffness (N·m/rad)", "told", "damping (N·m·s/rad)", "told"),
    )
    for entry in answer["parameters"]:
        made.add_row(
            f"{entry['joint']} {_axis(entry['axis'])}",
            _with_sd(entry["stiffness"], entry["stiffness_sd"]),
            _yes(entry["identifiable"]),
            _with_sd(entry["damping"], entry["damping_sd"]),
            _yes(entry["damping_identifiable"]),
        )
    parts: list[RenderableType] = [made, Text("  told: identified by the data.")]
    if answer["undetermined"]:
        parts.append(Text("What these recordings cannot tell:"))
        parts += [Text(f"  {text}") for text in answer["undetermined"]]
    parts.append(_agreement(answer))
    parts += [Text(f"  {remark}", style="yellow") for remark in answer["remarks"]]
    if answer["plots"]:
        parts.append(Text("\n  ".join(["Pictures:", *answer["plots"]])))
    if answer["rrd"]:
        parts.append(Text(f"Rerun recording: {answer['rrd']}"))
    if answer["out"]:
        frac = 100 * answer["written"]["frac"]
        parts.append(Text(f"Written: {answer['out']} (FRAC {frac:.2f} %), {answer['urdf']}"))
    if answer["simulated"]:
        parts.append(SIMULATED)
    return Group(*parts)


def _agreement(answer: dict[str, Any]) -> RenderableType:
    aside = answer["held_out"]
    made = table(
        f"Agreement of simulated with measured FRFs (misfit {answer['misfit']:.2f}, 1 at the "
        f"noise; {answer['seconds']:.1f} s)",
        *("poses", "FRAC before", "FRAC after", "Frobenius before", "Frobenius after"),
    )
    rows = [("all", answer["fit"])]
    if aside["poses"]:
        rows.append((f"held out: {', '.join(aside['poses'])}", aside))
    for name, of in rows:
        cells = [side[key] for key in ("frac", "frobenius") for side in (of["before"], of)]
        made.add_row(name, *(f"{100 * value:.2f} %" for value in cells))
    return made


def _with_sd(value: float, sd: float | None) -> str:
    """Both with the exponent of the value."""
    exponent = 0 if 0.1 <= value < 1000 or value == 0 else math.floor(math.log10(value))
    power = f"e{exponent}" if exponent else ""
    if sd is None:
        return f"{value / 10**exponent:.3f}{power} (kept)"
    return f"{value / 10**exponent:.3f} ± {sd / 10**exponent:.3f}{power}"


def _axis(axis: list[float]) -> str:
    letters = [letter for a, letter in zip(axis, "xyz", strict=True) if abs(a) == 1]
    return letters[0] if letters else " ".join(f"{a:.3g}" for a in axis)


def _yes(identified: bool) -> str:
    return "yes" if identified else "no"
