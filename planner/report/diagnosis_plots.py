"""Pictures of a diagnosis: FRFs before and after, FRF maps, residuals beside what matters."""

from collections.abc import Sequence

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from planner.diagnosis.diagnose import Diagnosis
from planner.diagnosis.mismatch import Residuals, simulated
from planner.recording.points import TOOL
from planner.report.frf_plots import EXPLAINED, GIVEN, REFITTED, ComparedFrfs, Side
from planner.report.plot_marks import AXES, empty, plain_text, write_values

LINES = 256  # a pose
UNIT = "mean square residual (1: just matters)"
LEAST, MOST_SHOWN = 1e-3, 1000.0  # residuals: of the scale
STYLES = {"as given": GIVEN, "refitted": REFITTED, "explained": EXPLAINED}


def diagnosis_figures(found: Diagnosis) -> dict[str, Figure]:
    """Residuals by band, pose and direction; FRF maps; direct FRFs of the worst poses.

    Of several sensors and hit points, FRFs are those of the first ones.
    """
    names, search = found.recorded.poses, found.search
    matters = search.prior.library.stiff.robot.config.diagnose.matters
    before, after = (Residuals.of(f, search.band_hz, matters) for f in (found.refitted, found.best))
    data = search.data(LINES)
    seen = data.measured
    measured = np.where(seen.used, seen.accelerance, np.nan)
    sides = (
        Side(label.replace(" ", "_"), label, style, h)
        for (label, style), h in zip(STYLES.items(), simulated(found, data), strict=True)
    )
    there = seen.layout
    place = "" if there == TOOL else f"{there.sensors[0]}, hit at {there.hits[0]}: "
    compared = ComparedFrfs(names, seen.frequency_hz, measured, tuple(sides), place=place)
    worst = np.argsort(-before.by_pose).tolist()
    return {"residuals": _residuals(before, after, names)} | compared.figures(worst)


def _residuals(before: Residuals, after: Residuals, names: Sequence[str]) -> Figure:
    what = "What is left unexplained, errors of hits and sensor taken out (1: just matters)"
    figure = empty((9.0, 6.5), what)
    (bands, poses), (left, right) = figure.subplots(2, 2)
    middle = (before.edges_hz[1:] + before.edges_hz[:-1]) / 2
    number = np.arange(len(names))
    sides = (before, "refitted", 8.0), (after, "explained", 3.5)
    for place, label, size in sides:
        style = STYLES[label] | {"label": label, "marker": "o", "ms": size}
        bands.semilogy(middle, np.maximum(place.by_band, LEAST), **style)
        poses.semilogy(number, np.maximum(place.by_pose, LEAST), **style)
    for panel, what in ((bands, "frequency (Hz)"), (poses, "pose")):
        panel.axhline(1.0, color="black", lw=0.8, ls=":")
        panel.set_xlabel(what)
        panel.set_ylabel(UNIT, fontsize=8)
        panel.legend()
    poses.set_xticks(number, [plain_text(n) for n in names], rotation=60, fontsize=7)
    scale, image = LogNorm(LEAST, MOST_SHOWN), ScalarMappable()
    for panel, (place, label, _) in zip((left, right), sides, strict=True):
        image = panel.imshow(np.maximum(place.by_direction, LEAST), cmap="Reds", norm=scale)
        write_values(panel, image, ".3g")
        panel.set_xticks(range(3), [f"hit {a}" for a in AXES])
        panel.set_yticks(range(3), [f"response {a}" for a in AXES])
        panel.set_title(f"by direction, {label}", fontsize=9)
    # One scale for both, so that what an explanation takes away is seen.
    figure.colorbar(image, ax=[left, right], label=UNIT, shrink=0.9)
    return figure
