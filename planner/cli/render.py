"""Answers as text for the engineer; units in every column."""

from typing import Any

from rich.console import Group, RenderableType
from rich.markup import escape
from rich.table import Table
from rich.text import Text

SIMULATED = Text("SIMULATED RECORDINGS: no measured data in this campaign", style="bold magenta")


def table(title: str, *columns: str) -> Table:
    """A table whose first column is text and the others numbers."""
    made = Table(title=title, title_justify="left", header_style="bold")
    for i, column in enumerate(columns):
        made.add_column(column, justify="left" if i == 0 else "right", overflow="fold")
    return made


def _number(value: float | None, form: str = ".2f") -> str:
    return "–" if value is None or value != value else format(value, form)


def _with_sd(value: float | None, sd: float | None, form: str = ".2f") -> str:
    return f"{_number(value, form)} ± {_number(sd, form)}"


def created(answer: dict[str, Any]) -> RenderableType:
    """Text of `new`."""
    remarks = "".join(f"{escape(remark)}\n" for remark in answer["remarks"])
    return (
        f"Campaign in {escape(answer['campaign'])}: robot {escape(answer['robot'])}, "
        f"{answer['modes']} modes, chosen by {answer['acquisition']}.\n"
        f"{remarks}Next: planner next {escape(answer['campaign'])}"
    )


def proposals(answer: dict[str, Any]) -> RenderableType:
    """Text of `next`."""
    parts: list[RenderableType] = []
    for proposal in answer["proposals"]:
        angles = table(
            f"Pose {proposal['pose']}", *(f"{name} (°)" for name in answer["joint_names"])
        )
        angles.add_row(*(f"{value:.3f}" for value in proposal["joints_deg"]))
        expected = table("expected there", "mode", "frequency (Hz)", "damping (%)")
        for k, mode in enumerate(proposal["expected"]):
            expected.add_row(
                str(k + 1),
                _with_sd(mode["frequency_hz"], mode["sd_hz"]),
                _with_sd(100 * mode["damping_ratio"], 100 * mode["damping_sd"]),
            )
        x, y, z = proposal["position_m"]
        hits = f"hit along {', '.join(proposal['hits'])}"
        place = f"tool at x {x:.3f} m, y {y:.3f} m, z {z:.3f} m; {hits}; {proposal['reason']}"
        parts += [angles, Text(place), expected]
    said = [answer["forecast"]["text"], (answer["repeat"] or {"text": ""})["text"]]
    parts += [Text(remark, style="yellow") for remark in answer["remarks"]]
    return Group(*parts, Text(" ".join(filter(None, said))))


def imported(answer: dict[str, Any]) -> RenderableType:
    """Text of `import`."""
    parts: list[RenderableType] = []
    for pose in answer["poses"]:
        made = table(
            f"Pose {pose['pose']}: {len(pose['accepted'])} hits accepted, "
            f"{len(pose['refused'])} refused, {len(pose['already_imported'])} known before",
            *("mode", "frequency (Hz)", "expected (Hz)", "damping (%)"),
        )
        for mode in pose["modes"]:
            expected = mode["expected"] or {"frequency_hz": None, "sd_hz": None}
            made.add_row(
                "–" if mode["label"] is None else str(mode["label"]),
                _with_sd(mode["frequency_hz"], mode["frequency_sd_hz"], ".3f"),
                _with_sd(expected["frequency_hz"], expected["sd_hz"]),
                _with_sd(100 * mode["damping_ratio"], 100 * mode["damping_sd"]),
            )
        parts.append(made)
        if pose["question"]:
            parts.append(Text(f"  {pose['question']['text']}", style="bold red"))
        parts += [Text(f"  {remark}", style="yellow") for remark in pose["remarks"]]
        before, after = pose["frequency_sd_percent_before"], pose["frequency_sd_percent"]
        change = ", ".join(f"{b:.1f} → {a:.1f} %" for b, a in zip(before, after, strict=True))
        parts.append(Text(f"  sd of frequencies: {change} (refit {pose['refit_seconds']:.2f} s)"))
    if answer["simulated"]:
        parts.append(SIMULATED)
    return Group(*parts)


def status(answer: dict[str, Any]) -> RenderableType:
    """Text of `status`."""
    measured = table(
        f"{answer['campaign']}: {len(answer['measurements'])} poses measured",
        *("pose", "hits", "refused", "frequencies (Hz)", "time (UTC)"),
    )
    for m in answer["measurements"]:
        mark = (" ★" if m["starred"] else "") + (" withdrawn" if m["withdrawn"] else "")
        frequencies = "  ".join(f"{f:.2f}" for f in m["frequency_hz"]) or "none"
        measured.add_row(
            m["pose"] + mark, str(m["hits"]), str(m["refused"]), frequencies, m["time"][:19]
        )
    lines = [
        "open: " + (", ".join(p["pose"] for p in answer["open"]) or "none"),
        "skipped: " + (", ".join(s["pose"] for s in answer["skipped"]) or "none"),
        "sd of frequencies over the workspace: "
        + ", ".join(f"mode {k + 1} {v:.2f} %" for k, v in enumerate(answer["frequency_sd_percent"]))
        + f" (target {answer['target_frequency_sd_percent']:g} %)",
        answer["forecast"]["text"] + (" The target is reached." if answer["done"] else ""),
        f"log: {answer['log']['entries']} entries",
    ]
    if answer["log"]["torn_bytes"]:
        lines.append("The log's last line was torn by a crash; the next act sets it aside.")
    if answer["stored_but_not_imported"]:
        lines.append(
            f"{len(answer['stored_but_not_imported'])} recordings were stored, but the program "
            f"stopped before they were imported: import them again."
        )
    lines += answer["remarks"] + answer["leave_one_out"]["text"]
    lines += [
        f"Held, not used: {h['question']['text']} Answer with planner confirm, or withdraw."
        for h in answer["held"]
    ]
    lines += [f"refused {r['file']}: {r['reason']}" for r in answer["refused"]]
    if answer["plots"]:
        lines.append("\n  ".join(["Pictures:", *answer["plots"]]))
    parts: list[RenderableType] = [measured, Text("\n".join(lines))]
    return Group(*parts, SIMULATED) if answer["simulated"] else Group(*parts)


def confirmed(answer: dict[str, Any]) -> RenderableType:
    """Text of `confirm`."""
    sd = ", ".join(f"{v:.1f} %" for v in answer["frequency_sd_percent"])
    return f"The hits of pose {escape(answer['confirmed'])} are used; sd of frequencies: {sd}."


def undone(answer: dict[str, Any]) -> RenderableType:
    """Text of `undo`."""
    return f"Took back entry {answer['undone']} ({answer['event']})."


def withdrawn(answer: dict[str, Any]) -> RenderableType:
    """Text of `withdraw`."""
    return f"Pose {escape(answer['withdrawn'])} is set aside; its recordings are kept."


def skipped(answer: dict[str, Any]) -> RenderableType:
    """Text of `skip`."""
    return f"Pose {escape(answer['skipped'])} will not be offered again."


def session(answer: dict[str, Any]) -> RenderableType | None:
    """Text of `watch`: the session has said it all."""
    return None


def predicted(answer: dict[str, Any]) -> RenderableType:
    """Text of `predict`."""
    made = table(
        f"After {answer['measurements']} measured poses",
        *("pose", "mode", "frequency (Hz)", "damping (%)"),
    )
    for pose in answer["poses"]:
        for k, mode in enumerate(pose["modes"]):
            made.add_row(
                pose["pose"] if k == 0 else "",
                str(k + 1),
                _with_sd(mode["frequency_hz"], mode["sd_hz"]),
                _with_sd(100 * mode["damping_ratio"], 100 * mode["damping_sd"]),
            )
    return Group(made, Text(f"FRFs (m/s²/N) with sd: {answer['npz']}"))


def replayed(answer: dict[str, Any]) -> RenderableType:
    """Text of `replay`."""
    other = answer["otherwise"]
    asked = any(step["instead"] for step in answer["steps"])
    more = ["instead (deg)"] if asked else []
    made = table("Replay", "entry", "event", "check", "what", "sd of frequencies (%)", *more)
    for step in answer["steps"]:
        sd = "  ".join(f"{v:.2f}" for v in step["frequency_sd_percent"])
        style = "red" if step["check"] == "differs" else None
        poses = [" ".join(f"{v:.0f}" for v in p["joints_deg"]) for p in step["instead"]]
        made.add_row(
            str(step["seq"]), step["event"], step["check"], step["detail"], sd,
            *(["\n".join(poses)] if asked else []), style=style,
        )  # fmt: skip
    verdict = "reproduced" if answer["reproduced"] else "NOT reproduced"
    lines = [f"The log was {verdict}."]
    if answer["rrd"]:
        lines.append(f"Rerun recording: {answer['rrd']}")
    if other is None:
        return Group(made, Text("\n".join(lines)))
    counts = next(iter(other["runs"].values()))["n"]
    curves = table("Frequency RMSE (%) on poses not yet used, by measurements", "order",
                   *map(str, counts))  # fmt: skip
    for name, run in other["runs"].items():
        curves.add_row(name, *(f"{v:.2f}" for v in run["frequency_rmse_percent"]))
    return Group(made, curves, Text("\n".join([*lines, other["text"]])))


def modes(answer: dict[str, Any]) -> RenderableType:
    """Text of `modes`."""
    low, high = answer["band_hz"]
    error = answer["fit_error"]
    fitted = "" if error is None else f" (fit error {100 * error:.1f} %)"
    made = table(
        f"Modes between {low:g} and {high:g} Hz{fitted}",
        *("mode", "frequency (Hz)", "damping (%)", "shape x, y, z", "physical (%)"),
    )
    for k, mode in enumerate(answer["modes"]):
        parts_of_shape = [f"{re:+.2f}{im:+.2f}i" for re, im in mode["shape"]]
        more = f"  and {len(parts_of_shape) - 3} more" if len(parts_of_shape) > 4 else ""
        shape = "  ".join(parts_of_shape[:3] if more else parts_of_shape) + more
        made.add_row(
            str(k + 1),
            _with_sd(mode["frequency_hz"], mode["frequency_sd_hz"], ".3f"),
            _with_sd(100 * mode["damping_ratio"], 100 * mode["damping_sd"]),
            shape,
            f"{100 * mode['probability']:.0f}",
        )
    parts: list[RenderableType] = [made]
    parts += [Text(f"  {remark}", style="yellow") for remark in answer["remarks"]]
    if answer["plots"]:
        parts.append(Text("\n  ".join(["Pictures:", *answer["plots"]])))
    if answer["rrd"]:
        parts.append(Text(f"Rerun recording: {answer['rrd']}"))
    return Group(*parts, SIMULATED) if answer["simulated"] else Group(*parts)


def survey(answer: dict[str, Any]) -> RenderableType:
    """Text of `modes` of several poses."""
    labels = sorted({mode["label"] for pose in answer["poses"] for mode in pose["modes"]})
    low, high = answer["band_hz"]
    made = table(
        f"Modes of {len(answer['poses'])} poses between {low:g} and {high:g} Hz",
        *("pose", *(f"mode {label} (Hz)" for label in labels), "without label (Hz)"),
    )
    for pose in answer["poses"]:
        by_label = {mode["label"]: mode for mode in pose["modes"]}
        cells = [_labelled(by_label.get(label)) for label in labels]
        others = "  ".join(f"{mode['frequency_hz']:.2f}" for mode in pose["unlabelled"])
        made.add_row(pose["pose"], *cells, others)
    parts: list[RenderableType] = [made, Text("  ?: the label is less than 90 % sure.")]
    if answer["plots"]:
        parts.append(Text("\n  ".join(["Pictures:", *answer["plots"]])))
    return Group(*parts, SIMULATED) if answer["simulated"] else Group(*parts)


def _labelled(mode: dict[str, Any] | None) -> str:
    if mode is None:
        return "–"
    doubt = " ?" if mode["label_probability"] < 0.9 else ""
    return f"{mode['frequency_hz']:.2f}{doubt}"


def demo(answer: dict[str, Any]) -> RenderableType:
    """Text of `demo`."""
    course = table("Course", "measurement", "pose", "measured (Hz)", "sd of frequencies (%)")
    for number, step in enumerate(answer["steps"], 1):
        hz = "  ".join(f"{f:.2f}" for f in step["frequency_hz"])
        sd = "  ".join(f"{v:.2f}" for v in step["frequency_sd_percent"])
        course.add_row(str(number), step["pose"], hz, sd)
    made = table(
        f"Demonstration on {answer['robot']}: {answer['measurements']} of {answer['pool']} poses",
        *("mode", "planner RMSE (%)", "simulation alone RMSE (%)", "in 95 % interval (%)"),
    )
    rows = zip(
        answer["frequency_rmse_percent_per_mode"],
        answer["simulation_rmse_percent_per_mode"],
        answer["coverage95_per_mode"],
        strict=True,
    )
    for k, (ours, simulation, coverage) in enumerate(rows):
        made.add_row(str(k + 1), _number(ours), _number(simulation), f"{100 * coverage:.0f}")
    made.add_row(
        "all",
        _number(answer["frequency_rmse_percent"]),
        _number(answer["simulation_rmse_percent"]),
        f"{100 * answer['coverage95']:.0f}",
        style="bold",
    )
    seconds = answer["step_seconds"]
    lines = [
        *answer["remarks"],
        f"On {answer['unused']} poses that were never used. Refit and next proposal: first "
        f"{seconds[0]:.2f} s, then at most {max(seconds[1:], default=0.0):.2f} s.",
        f"Campaign: {answer['campaign']}",
        f"Rerun recording: {answer['rrd']} (open with: rerun FILE)",
    ]
    return Group(course, made, Text("\n".join(lines)), SIMULATED)
