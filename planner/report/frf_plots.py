"""Pictures of FRFs: measured and simulated ones over each other, and maps of them along poses."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from planner.report.frf_map import frf_map
from planner.report.plot_marks import AXES, empty, magnitude

# Dashes over wide lines: where two agree, both are seen.
SEEN = {"label": "measured", "color": "0.25", "lw": 4.5}
GIVEN = {"color": "tab:blue", "ls": ":", "lw": 1.1, "zorder": 3.0}
REFITTED = {"color": "tab:orange", "ls": "-", "lw": 2.6}
EXPLAINED = {"color": "tab:red", "ls": "--", "lw": 1.0}
IDENTIFIED = {"color": "tab:red", "ls": "-", "lw": 1.2}
MOST = 6  # poses whose FRFs are shown


@dataclass(frozen=True, eq=False)
class Side:
    """One simulation's FRFs (n, 3, 3, F) in m/s²/N; its `key` in files' names, how it is drawn."""

    key: str
    label: str
    style: Mapping[str, Any]
    h: np.ndarray


@dataclass(frozen=True, eq=False)
class ComparedFrfs:
    """FRFs of n named poses on lines (n, F): measured (n, 3, 3, F) in m/s²/N, and as simulated.

    NaN where nothing was measured.
    """

    names: tuple[str, ...]
    frequency_hz: np.ndarray
    measured: np.ndarray
    sides: tuple[Side, ...]
    roles: tuple[str, ...] = ()  # of the poses
    place: str = ""  # before titles, where it is not the tool

    def figures(self, first: Sequence[int]) -> dict[str, Figure]:
        """Maps of every direct FRF, then the direct FRFs of so many of the `first` poses."""
        number, figures = np.arange(1.0, len(self.names) + 1), {}
        for i, axis in enumerate(AXES):
            measured = self._aligned(self.measured[:, i, i])
            for side in self.sides:
                figures[f"map_{axis}{axis}_{side.key}"] = frf_map(
                    number, measured, self._aligned(side.h[:, i, i]), self.frequency_hz[0],
                    "pose, in recorded order",
                    f"{self.place}Map of H {axis}{axis}, simulation {side.label}", names=self.names,
                )  # fmt: skip
        for k in first[:MOST]:
            name = re.sub(r"[^\w.-]", "_", str(self.names[k]))
            figures[f"frf_{name}"] = self.overlay(k)
        return figures

    def _aligned(self, h: np.ndarray) -> np.ndarray:
        """|H| (n, F) on the lines of the first pose."""
        first, rows = self.frequency_hz[0], zip(self.frequency_hz, np.abs(h), strict=True)
        return np.array([np.interp(first, hz, row, np.nan, np.nan) for hz, row in rows])

    def overlay(self, k: int) -> Figure:
        """Direct FRFs xx, yy, zz of the k-th pose."""
        role = f" ({self.roles[k]})" if self.roles else ""
        figure = empty((7.5, 7.0), f"{self.place}Pose {self.names[k]}{role}")
        panels, hz = figure.subplots(3, 1, sharex=True), self.frequency_hz[k]
        for i, panel in enumerate(panels):
            magnitude(panel, hz, self.measured[k, i, i], **SEEN)
            for side in self.sides:
                magnitude(panel, hz, side.h[k, i, i], label=side.label, **side.style)
            panel.set_ylabel(f"|H {AXES[i]}{AXES[i]}| (m/s²/N)", fontsize=8)
            panel.grid(True, which="both", alpha=0.25)
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
        panels[-1].set_xlabel("frequency (Hz)")
        return figure

    def overlays(self) -> Iterator[Figure]:
        """Of all poses, one after the other."""
        return map(self.overlay, range(len(self.names)))
