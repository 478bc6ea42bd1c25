"""Pictures of an identification: FRF maps and direct FRFs, before and after."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.report.frf_map import frf_map
from planner.report.frf_plots import AXES
from planner.report.plot_text import plain_text

BEFORE, AFTER = ("tab:blue", "--"), ("tab:red", "-")


@dataclass(frozen=True, eq=False)
class ShownPose:
    """A measured pose, q (dof,) in rad, and the simulation to show there."""

    name: str
    q: np.ndarray
    frf: Frf
    identified: Simulation
    held_out: bool


@dataclass(frozen=True, eq=False)
class DirectFrfs:
    """Magnitudes (n, 3, F) in m/s²/N of xx, yy, zz at n poses on lines (F,); NaN: not measured."""

    frequency_hz: np.ndarray
    measured: np.ndarray
    nominal: np.ndarray
    identified: np.ndarray

    @classmethod
    def of(
        cls, poses: Sequence[ShownPose], nominal: Simulation, band_hz: tuple[float, float]
    ) -> "DirectFrfs":
        """On the lines of the first pose."""
        lines = _inside(poses[0].frf, band_hz)
        before = np.concatenate([nominal.accelerance(p.q, lines) for p in poses])
        after = np.concatenate([p.identified.accelerance(p.q, lines) for p in poses])
        measured = np.array([_resampled(p.frf, lines) for p in poses])
        direct = [np.abs(h[:, range(3), range(3)]) for h in (measured, before, after)]
        return cls(lines, *direct)


def identification_figures(
    poses: Sequence[ShownPose],
    nominal: Simulation,
    band_hz: tuple[float, float],
    mark: str = "",
    most: int = 6,
) -> dict[str, Figure]:
    """FRF maps of every direct FRF with the nominal and the identified simulation.

    Then the direct FRFs themselves at up to `most` poses, held-out ones first.
    """
    if not poses:
        return {}
    shown = DirectFrfs.of(poses, nominal, band_hz)
    number, figures = np.arange(1.0, len(poses) + 1), {}
    for i, axis in enumerate(AXES):
        for when, simulated in (("before", shown.nominal), ("after", shown.identified)):
            figures[f"map_{axis}{axis}_{when}"] = frf_map(
                number,
                shown.measured[:, i],
                simulated[:, i],
                shown.frequency_hz,
                "pose, in recorded order",
                f"{mark}Map of H {axis}{axis}, {when} identification",
                names=[pose.name for pose in poses],
            )
    for pose in sorted(poses, key=lambda pose: not pose.held_out)[:most]:
        name = re.sub(r"[^\w.-]", "_", pose.name)
        figures[f"frf_{name}"] = direct_figure(pose, nominal, band_hz, mark)
    return figures


def direct_figure(
    pose: ShownPose, nominal: Simulation, band_hz: tuple[float, float], mark: str = ""
) -> Figure:
    """Direct FRFs xx, yy, zz of a pose: measured, nominal and identified, in m/s²/N."""
    lines = _inside(pose.frf, band_hz)
    curves = [
        (nominal.accelerance(pose.q, lines)[0], "nominal", BEFORE),
        (pose.identified.accelerance(pose.q, lines)[0], "identified", AFTER),
    ]
    measured = _resampled(pose.frf, lines)
    figure = Figure(figsize=(7.5, 7.0), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(3, 1, sharex=True)
    for i, panel in enumerate(panels):
        panel.semilogy(lines, measured[i, i], color="black", lw=1.4, label="measured")
        for h, label, (colour, style) in curves:
            panel.semilogy(lines, np.abs(h[i, i]), style, color=colour, lw=1.1, label=label)
        panel.set_ylabel(f"|H {AXES[i]}{AXES[i]}| (m/s²/N)", fontsize=8)
        panel.grid(True, which="both", alpha=0.25)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    panels[-1].set_xlabel("frequency (Hz)")
    role = "held out: identified without it" if pose.held_out else "used"
    figure.suptitle(f"{mark}Pose {plain_text(pose.name)} ({role})", fontsize=10)
    return figure


def _inside(frf: Frf, band_hz: tuple[float, float]) -> np.ndarray:
    low, high = max(band_hz[0], frf.usable_band_hz[0]), min(band_hz[1], frf.usable_band_hz[1])
    f = frf.frequency_hz
    return f[(f >= low) & (f <= high) & (f > 0)]


def _resampled(frf: Frf, lines: np.ndarray) -> np.ndarray:
    """Magnitudes (3, 3, F) on lines (F,), NaN where there are none."""
    size = np.abs(frf.accelerance)
    if np.array_equal(np.intersect1d(frf.frequency_hz, lines), lines):
        return size[..., np.searchsorted(frf.frequency_hz, lines)]
    flat = size.reshape(9, -1)
    rows = [np.interp(lines, frf.frequency_hz, row, np.nan, np.nan) for row in flat]
    return np.array(rows).reshape(3, 3, -1)
