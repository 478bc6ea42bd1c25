"""The answer of `planner diagnose` as text."""

from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from planner.cli.render import SIMULATED, table

SHOWN = 6
VERDICTS = {
    "consistent": "The simulation explains the recordings once its own parameters are refitted.",
    "explained": "The simulation lacks something, and this explains the recordings:",
    "unexplained": "Something is there that no effect of the library describes.",
}


def diagnosed(answer: dict[str, Any]) -> RenderableType:
    """Text of `diagnose`."""
    parts: list[RenderableType] = [Text(VERDICTS[answer["verdict"]], style="bold")]
    parts += [Text(f"  {finding['text']}") for finding in answer["findings"]]
    parts.append(Text(_where(answer["where"])))
    made = table("What was considered", "effect", "at", "probability")
    for c in answer["candidates"][:SHOWN]:
        made.add_row(
            c["effect"].replace("_", " "), c["at"] or "–", f"{100 * c['probability']:.1f} %"
        )
    parts += [made, _agreement(answer)]
    if answer["next"]:
        parts.append(Text(_next(answer["next"]), style="bold"))
    parts += [Text(f"  {remark}", style="yellow") for remark in answer["remarks"]]
    for key, what in (("npz", "Predictions"), ("robot", "Robot with what was found")):
        if answer[key]:
            parts.append(Text(f"{what}: {answer[key]}"))
    if answer["plots"]:
        parts.append(Text("\n  ".join(["Pictures:", *answer["plots"]])))
    if answer["simulated"]:
        parts.append(SIMULATED)
    return Group(*parts)


def _next(told: dict[str, Any]) -> str:
    angles = ", ".join(f"{v:.1f}" for v in told["joints_deg"])
    force = " and ".join(f"{n:g}" for n in told["force_n"])
    force = f" with about {force} N" if force else ""
    return (
        f"To tell apart {' from '.join(told['between'])}: hit{force} along {told['hit']} at "
        f"{told['pose']} ({angles}°); the odds are expected to become e^{told['log_odds']:.1f}."
    )


def _where(where: dict[str, Any]) -> str:
    if not where["bands_hz"]:
        return "Refitted, the simulation misses the recordings in no band clearly."
    bands = ", ".join(f"{low:.0f} to {high:.0f}" for low, high in where["bands_hz"])
    return (
        f"Refitted without any effect, the simulation misses the recordings at {bands} Hz, at "
        f"poses {', '.join(where['poses']) or '–'}, along {', '.join(where['directions']) or '–'}."
    )


def _agreement(answer: dict[str, Any]) -> RenderableType:
    made = table(
        f"Agreement with measured FRFs, FRAC / Frobenius ({answer['seconds']:.0f} s)",
        *("poses", "as given", "refitted", "explained"),
    )
    aside = answer["held_out"]
    rows = [("used", answer["fit"])]
    if aside["poses"]:
        rows.append((f"held out: {', '.join(aside['poses'])}", aside))
    for name, of in rows:
        sides = (of["nominal"], of["refitted"], of["explained"])
        made.add_row(name, *(f"{s['frac']:.4f} / {s['frobenius']:.4f}" for s in sides))
    return made
