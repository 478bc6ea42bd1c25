"""Maps of Busch et al. 2022 over the plane of its 35 positions: figures 2 to 6, A1 and A3."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from planner.campaign.mode_motion import simulated_shapes
from planner.dynamics.simulation import Simulation
from planner.recording.points import TOOL
from planner.report.plot_marks import empty, magnitude, name_axes, panels
from planner.robot.link_bodies import skeleton

from .data import WIDE_HZ, AnalysedPoses, split
from .pictures import PAIRS, synthesised

FIRST = 0  # mode
AXES = "xyz"
DIRECT, CROSS = ((0, 0), (1, 1)), ((0, 1), (1, 0))  # (response, hit)
TRAINED = 3, 5, 7, 10, 15  # of figure 5
SHAPES, MOVED = 4, 0.25  # modes; share of the arm's height by which what moves most is drawn


def maps(seen: AnalysedPoses, simulation: Simulation, pose: str) -> dict[str, Figure]:
    """By file name; `pose` is the point x_T of the paper."""
    modes, at = seen.modes, seen.poses.index(pose)
    first = {
        "ω₁ (Hz)": modes.frequency_hz[:, FIRST],
        "ξ₁ (%)": 100 * modes.damping_ratio[:, FIRST],
    }
    cross = "Figure A1: cross residues of mode 1, as identified (m/(N·s))"
    return {
        "busch2022_figure_2": _positions(seen),
        "busch2022_figure_3": _synthesised(seen, at),
        "busch2022_figure_4": _figure(
            seen, first | _parts(seen, DIRECT), "Figure 4: mode 1, as identified from hits"
        ),
        "busch2022_figure_5": _designs(seen),
        "busch2022_figure_6": _beside_simulation(seen),
        "busch2022_figure_a1": _figure(seen, _parts(seen, CROSS), cross),
        "busch2022_figure_a3": _shapes(simulation, seen.q[at]),
    }


def _parts(seen: AnalysedPoses, pairs: tuple[tuple[int, int], ...]) -> dict[str, np.ndarray]:
    found = {}
    for i, j in pairs:
        residue = seen.modes.residue[:, FIRST, i, j]
        name = f"R₁,{AXES[i]}{AXES[j]} (m/(N·s))"
        found |= {f"Im {name}": residue.imag, f"Re {name}": residue.real}
    return found


def _positions(seen: AnalysedPoses) -> Figure:
    figure, grid = panels((6.0, 4.6), "Figure 2: measured positions, tool downwards")
    panel, (x, y) = grid[0, 0], seen.plane_m.T
    panel.plot(x, y, "o", color="tab:blue")
    for name, at in zip(seen.poses, seen.plane_m, strict=True):
        panel.annotate(name, at, xytext=(4, 4), textcoords="offset points", fontsize=7)
    panel.set(xlabel="x (m)", ylabel="y (m)")
    panel.margins(x=0.1)
    panel.grid(True, alpha=0.25)
    return figure


def _synthesised(seen: AnalysedPoses, at: int) -> Figure:
    title = f"Figure 3: FRFs at {seen.poses[at]}, measured (simulated) and put together from modes"
    figure, grid = panels((10.0, 6.4), title, 2, 2)
    frf = seen.frfs[at].within(WIDE_HZ)
    h = synthesised(seen.every, at, frf.frequency_hz)
    for i, j in PAIRS:
        panel = grid[i, j]
        magnitude(panel, frf.frequency_hz, frf.accelerance[i, j], color="black", label="measured")
        magnitude(panel, frf.frequency_hz, h[i, j], color="tab:red", label="its modes (LSCF)")
        panel.set_title(f"response {AXES[i]}, hit {AXES[j]}", fontsize=10)
    name_axes(figure, grid, "frequency (Hz)", "|H| (m/s²/N)")
    return figure


def _figure(seen: AnalysedPoses, values: Mapping[str, np.ndarray], title: str) -> Figure:
    figure, grid = panels((9.6, 1.0 + 2.7 * len(values) / 2), title, len(values) // 2, 2)
    for panel, (name, value) in zip(grid.flat, values.items(), strict=True):
        _map(figure, panel, seen, value, name)
    name_axes(figure, grid, "x (m)", "y (m)")
    return figure


def _map(figure: Figure, panel: Axes, seen: AnalysedPoses, value: np.ndarray, name: str) -> None:
    """Between the positions as planes; where a mode was not found there is no point."""
    known = np.isfinite(value)
    (x, y), value = seen.plane_m[known].T, value[known]
    image = panel.tripcolor(x, y, value, shading="gouraud", cmap="viridis")
    panel.plot(x, y, "k.", ms=3)
    panel.set_title(name, fontsize=10)
    figure.colorbar(image, ax=panel)


def _designs(seen: AnalysedPoses) -> Figure:
    title = "Figure 5: poses trained with and predicted, of one split"
    figure, grid = panels((3.0 * len(TRAINED), 3.6), title, 1, len(TRAINED), sharey=True)
    train, test = split(seen.x, 0)
    for panel, count in zip(grid[0], TRAINED, strict=True):
        for rows, style, label in (
            (test, {"color": "0.6", "marker": "o"}, "predicted"),
            (train[count:], {"color": "tab:blue", "marker": "x"}, "not used"),
            (train[:count], {"color": "tab:red", "marker": "s"}, "trained with"),
        ):
            panel.scatter(*seen.plane_m[rows].T, s=22, label=label, **style)
        panel.set_title(f"B{count}" + (" = A" if count == TRAINED[-1] else ""), fontsize=10)
    name_axes(figure, grid, "x (m)", "y (m)")
    return figure


def _beside_simulation(seen: AnalysedPoses) -> Figure:
    title = "Figure 6: frequency of mode 1, measured and simulated"
    figure = empty((13.0, 4.0), title)
    left, middle, right = figure.subplots(1, 3)
    high, low = (m[:, FIRST] for m in (seen.modes.frequency_hz, seen.modes.simulated.frequency_hz))
    for panel, value, name in ((left, high, "measured (Hz)"), (middle, low, "simulated (Hz)")):
        _map(figure, panel, seen, value, name)
        panel.set(xlabel="x (m)", ylabel="y (m)")
    known = np.isfinite(high) & np.isfinite(low)
    line = np.polynomial.Polynomial.fit(low[known], high[known], 1)
    ends = np.array([low[known].min(), low[known].max()])
    right.plot(low, high, "o", ms=4)
    right.plot(ends, line(ends), "k--", lw=0.9, label="straight line")
    right.set(xlabel="simulated (Hz)", ylabel="measured (Hz)", title="one over the other")
    right.legend()
    right.grid(True, alpha=0.25)
    return figure


def _shapes(simulation: Simulation, q: np.ndarray) -> Figure:
    """The lowest modes of the simulation, as far out as they go on either side."""
    drawn = skeleton(simulation.robot, q)
    shapes, _ = simulated_shapes(simulation, q, drawn, TOOL, SHAPES)
    hertz = simulation.frequencies(q[None], SHAPES).frequency_hz[0]
    size = MOVED * float(np.ptp(drawn.place_m[:, 2]))
    figure = empty((4.0 * SHAPES, 4.6), "Figure A3: mode shapes, simulated (not to scale)")
    for k in range(SHAPES):
        panel = figure.add_subplot(1, SHAPES, k + 1, projection="3d")
        for way, colour, label in ((0, "0.6", "at rest"), (1, "tab:red", ""), (-1, "tab:blue", "")):
            place = drawn.place_m + way * size * np.real(shapes.motion[k])
            for a, b in drawn.lines:
                panel.plot(*place[[a, b]].T, color=colour, lw=2, label=label)
        panel.set(title=f"mode {k + 1}: {hertz[k]:.1f} Hz", aspect="equal",
                  xlabel="x (m)", ylabel="y (m)", zlabel="z (m)")  # fmt: skip
        panel.tick_params(labelsize=6)
    return figure
