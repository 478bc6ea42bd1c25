"""Pictures of a diagnosis: FRFs before and after, FRF maps, residuals beside what matters."""

import re
from collections.abc import Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from planner.diagnosis.diagnose import Diagnosis
from planner.recording.points import TOOL
from planner.report.frf_map import frf_map
from planner.report.frf_plots import AXES
from planner.report.mismatch import Residuals, simulated
from planner.report.plot_text import plain_text, write_values

LINES = 256  # a pose
UNIT = "mean square residual (1: just matters)"
LEAST, MOST_SHOWN = 1e-3, 1000.0  # residuals: of the scale
MOST = 4  # poses whose FRFs are shown, those that differed most
# Dashes over a wide line: where an explanation changes nothing, both are seen.
REFITTED = {"label": "refitted", "color": "tab:orange", "ls": "-", "lw": 2.6, "ms": 8.0}
EXPLAINED = {"label": "explained", "color": "tab:red", "ls": "--", "lw": 1.0, "ms": 3.5}
GIVEN = {"label": "as given", "color": "tab:blue", "ls": ":", "lw": 1.1}
SIDES = (GIVEN, REFITTED, EXPLAINED)


def diagnosis_figures(found: Diagnosis, mark: str = "") -> dict[str, Figure]:
    """Residuals by band, pose and direction; FRF maps; direct FRFs of the worst poses.

    Of several sensors and hit points, FRFs are those of the first ones.
    """
    names, search = found.recorded.poses, found.search
    matters = search.prior.repertoire.stiff.robot.config.diagnose.matters
    before, after = (Residuals.of(f, search.band_hz, matters) for f in (found.refitted, found.best))
    figures = {"residuals": _residuals(before, after, names, mark)}
    data = search.data(LINES)
    measured = np.where(data.measured.used, np.abs(data.measured.accelerance), np.nan)
    lines = data.measured.frequency_hz
    sides = [np.abs(h) for h in simulated(found, data)]
    number, layout = np.arange(1.0, len(names) + 1), data.measured.layout
    if layout != TOOL:
        mark = f"{mark}{layout.sensors[0]}, hit at {layout.hits[0]}: "
    for i, axis in enumerate(AXES):
        for side, h in zip((str(side["label"]) for side in SIDES), sides, strict=True):
            title = f"{mark}Map of H {axis}{axis}, simulation {side}"
            figures[f"map_{axis}{axis}_{side.replace(' ', '_')}"] = frf_map(
                number, measured[:, i, i], h[:, i, i], lines[0], "pose, in recorded order", title,
                names=names,
            )  # fmt: skip
    for k in np.argsort(-before.by_pose)[:MOST].tolist():
        name = re.sub(r"[^\w.-]", "_", str(names[k]))
        curves = [h[k] for h in sides]
        figures[f"frf_{name}"] = _overlay(lines[k], measured[k], curves, f"{mark}Pose {names[k]}")
    return figures


def _figure(width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _overlay(
    lines: np.ndarray, measured: np.ndarray, curves: Sequence[np.ndarray], title: str
) -> Figure:
    figure = _figure(7.5, 7.0)
    panels = figure.subplots(3, 1, sharex=True)
    for i, panel in enumerate(panels):
        panel.semilogy(lines, measured[i, i], color="0.25", lw=4.5, label="measured")
        for side, h in zip(SIDES, curves, strict=True):
            panel.semilogy(lines, h[i, i], **side)
        panel.set_ylabel(f"|H {AXES[i]}{AXES[i]}| (m/s²/N)", fontsize=8)
        panel.grid(True, which="both", alpha=0.25)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    panels[-1].set_xlabel("frequency (Hz)")
    figure.suptitle(plain_text(title), fontsize=10)
    return figure


def _residuals(before: Residuals, after: Residuals, names: Sequence[str], mark: str) -> Figure:
    figure = _figure(9.0, 6.5)
    (bands, poses), (left, right) = figure.subplots(2, 2)
    middle = (before.edges_hz[1:] + before.edges_hz[:-1]) / 2
    number = np.arange(len(names))
    for place, side in ((before, REFITTED), (after, EXPLAINED)):
        bands.semilogy(middle, np.maximum(place.by_band, LEAST), marker="o", **side)
        poses.semilogy(number, np.maximum(place.by_pose, LEAST), marker="o", **side)
    for panel, what in ((bands, "frequency (Hz)"), (poses, "pose")):
        panel.axhline(1.0, color="black", lw=0.8, ls=":")
        panel.set_xlabel(what)
        panel.set_ylabel(UNIT, fontsize=8)
        panel.legend()
    poses.set_xticks(np.arange(len(names)), [plain_text(n) for n in names], rotation=60, fontsize=7)
    scale, image = LogNorm(LEAST, MOST_SHOWN), ScalarMappable()
    for panel, place, label in ((left, before, "refitted"), (right, after, "explained")):
        image = panel.imshow(np.maximum(place.by_direction, LEAST), cmap="Reds", norm=scale)
        write_values(panel, image, ".3g")
        panel.set_xticks(range(3), [f"hit {a}" for a in AXES])
        panel.set_yticks(range(3), [f"response {a}" for a in AXES])
        panel.set_title(f"by direction, {label}", fontsize=9)
    # One scale for both, so that what an explanation takes away is seen.
    figure.colorbar(
        image, ax=[left, right], label="mean square residual (1: just matters)", shrink=0.9
    )
    what = "What is left unexplained, errors of hits and sensor taken out (1: just matters)"
    figure.suptitle(f"{mark}{what}", fontsize=10)
    return figure
