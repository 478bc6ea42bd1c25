"""Tables and pictures of Birk et al. 2025: Tables 4 and 5, directions, designs, Figures 8 and 9."""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from planner.frf.metrics import Agreement
from planner.report.plot_marks import name_axes, panels
from planner.studies import drawing
from planner.studies.report import Table

from .data import BAND_HZ, PATHS, PathHits
from .fits import SEARCHED, Design, IdentifiedModel, percent

BOTH, MAIN = ("12P", "24P"), ("12P", "24P", "24P, ours")
ORDER = (*MAIN, *SEARCHED)
BANDS = "≤ 200 Hz", "≤ 800 Hz"
NAN = float("nan")
PAPER_4 = {"12P": (40.8, 19.1, 22.6), "24P": (70.5, 44.9, 36.9)}  # Table 4, %
PAPER_5 = {  # FRAC and Frobenius similarity by path (Table 5), %
    "12P": ((41.8, 19.6), (46.7, 22.3), (33.9, 15.6)),
    "24P": ((75.0, 48.9), (70.1, 44.2), (66.2, 41.7)),
}


@dataclass(frozen=True, eq=False)
class Run:
    """Hits on one robot, the models identified from nine points, and designs."""

    hits: PathHits
    models: dict[str, IdentifiedModel]
    designs: list[Design]


def on_path(run: Run, name: str, path: str) -> Agreement:
    """A model's agreement with one path up to 200 Hz."""
    return run.models[name].limited[run.hits.path == path]


def table_4(run: Run) -> Table:
    """All points, both bands."""
    rows = []
    for name in ORDER:
        model, theirs = run.models[name], PAPER_4.get(name, (NAN,) * 3)
        rows.append((name, *percent(model.limited), *percent(model.full), *theirs))
    columns = ("model", "FRAC ≤ 200 Hz, %", "Frobenius", "FRAC ≤ 800 Hz, %", "Frobenius",
               "paper: FRAC ≤ 200", "Frobenius", "FRAC ≤ 800")  # fmt: skip
    return Table("birk2025_table_4", "Table 4: all points", columns, tuple(rows))


def table_5(run: Run) -> Table:
    """Path by path below 200 Hz."""
    rows = []
    for name in ORDER:
        for path, theirs in zip(PATHS, PAPER_5.get(name, ((NAN, NAN),) * 3), strict=True):
            agreed = percent(on_path(run, name, path))
            rows.append((f"{name}, {path}", *agreed, *theirs))
    columns = "model, path", "FRAC, %", "Frobenius, %", "paper: FRAC, %", "Frobenius, %"
    return Table("birk2025_table_5", "Table 5: by path, ≤ 200 Hz", columns, tuple(rows))


def direction_table(run: Run) -> Table:
    """Model, path, band and direction of the direct FRFs (Figure A1 has part of it)."""
    rows = []
    for name in MAIN:
        model = run.models[name]
        for band, agreement in zip(BANDS, (model.limited, model.full), strict=True):
            for path in ("all", *PATHS):
                some = agreement[(run.hits.path == path) | (path == "all")]
                values = np.r_[np.diagonal(some.global_frac), np.diagonal(some.frobenius)]
                rows.append((f"{name}, {path}, {band}", *map(float, 100 * values)))
    columns = "model, path, band", "FRAC x, %", "y", "z", "Frobenius x, %", "y", "z"
    return Table("birk2025_directions", "By path, direction and band", columns, tuple(rows))


def design_table(run: Run) -> Table:
    """Which points determine how many parameters, and how well a fit to them predicts."""
    names = run.hits.names
    rows = [
        (d.name, float(len(d.rows)), float(d.determined), d.frac,
         " ".join(names[i] for i in d.rows))
        for d in run.designs
    ]  # fmt: skip
    columns = ("points", "count", "parameters determined", "FRAC at all others, %", "which")
    return Table("birk2025_where", "Where to measure for 24P: which poses determine what, ≤ 200 Hz",
                 columns, tuple(rows))  # fmt: skip


def campbell(run: Run) -> Figure:
    """Figures 8 and 9: S1, hit and response y, over frequency and place along the path."""
    rows = np.flatnonzero(run.hits.path == PATHS[0])
    lines, struck = np.linspace(*BAND_HZ, 240), run.hits.hit_poses
    measured = [
        np.interp(lines, struck.frfs[i].frequency_hz, np.abs(struck.frfs[i].accelerance[1, 1]))
        for i in rows
    ]
    maps = {"measured (simulated)": np.array(measured)}
    for name in MAIN:
        maps[name] = np.abs(run.models[name].simulation.accelerance(struck.q[rows], lines)[:, 1, 1])
    title = "Figures 8 and 9: path S1, hit and response y"
    figure, grid = panels((12.0, 4.2), title, 1, len(maps), sharey=True)
    number = np.arange(len(rows)) + 1
    drawing.maps(figure, grid[0], {n: (number, lines, m.T) for n, m in maps.items()}, 45)
    name_axes(figure, grid, "point of the path", "frequency (Hz)")
    return figure


def directions_figure(table: Table) -> Figure:
    """The means over all paths as bars."""
    figure, grid = panels((9.0, 4.4), "Global FRAC by direction and band")
    rows = [row for row in table.rows if ", all, " in str(row[0])]
    values = np.array([row[1:4] for row in rows], dtype=float)
    panel = grid[0, 0]
    drawing.bars(panel, [str(r[0]).replace(", all, ", "\n") for r in rows], ("x", "y", "z"),
                 values, "Global FRAC (%)")  # fmt: skip
    panel.set_ylim(0, 100)
    name_axes(figure, grid)
    return figure
