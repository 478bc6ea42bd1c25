"""The study of Birk et al. 2025: 12 and 24 parameters, identified at nine poses of three paths.

The paper's models (`campaigns/kr10_birk2025`) are fitted to hits on a robot of another class
(`birk2025_data`), with the bounds of its Tables 1 and 2 for a prior, by this program's least
squares instead of the paper's genetic algorithm, which takes days; figures are the paper's, Global
FRAC and Frobenius similarity of magnitudes (appendix B). Beside them 24P as this program identifies
it: inertias within 8 %, what hits and chain leave open integrated out, what 24 parameters do not
explain looked for. The paper's outlook asks where to measure: D-optimal points answer.
"""

import numpy as np
from matplotlib.figure import Figure

from planner.demo import shipped
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import CAD_INERTIAS
from planner.fit.identify import identify
from planner.frf import metrics
from planner.frf.metrics import Agreement
from planner.measurement.nuisances import EXACT_HITS
from planner.progress import Tell, within
from planner.robot.robot import Robot
from planner.studies import drawing
from planner.studies.birk2025_bounds import paper_priors
from planner.studies.birk2025_data import BAND_HZ, FULL_HZ, PATHS, PathHits, load
from planner.studies.birk2025_design import Design, Informative
from planner.studies.birk2025_findings import findings
from planner.studies.birk2025_tables import (
    IdentifiedModel,
    design_table,
    direction_table,
    percent,
    table_4,
    table_5,
)
from planner.studies.report import Report, Table

FILES = {"12P": "robot_12p.toml", "24P": "robot_24p.toml", "24P, ours": "robot_24p.toml"}
FEW = 3  # points, of which it is asked how far they suffice


def study(progress: Tell, small: bool = False) -> Report:
    """FRAC and Frobenius similarity by path, direction and band, and which poses suffice."""
    hits = load(small, within(progress, 0.0, 0.25))
    nine = hits.ends_and_middles
    models: dict[str, IdentifiedModel] = {}
    for i, name in enumerate(FILES):
        progress(f"{name}: identification from nine poses", 0.25 + 0.15 * i)
        models[name] = _model(hits, nine, name)
    progress("where to measure", 0.7)
    designs = _designs(hits, models["24P"], within(progress, 0.7, 0.95))
    whole, paths, directions = table_4(models), table_5(hits, models), direction_table(hits, models)
    where = design_table(hits, designs)
    return Report(
        "birk2025",
        f"SIMULATED: a KR10 in MuJoCo on three paths, {len(hits.path)} points, nine hits each with "
        "everyday errors; its links bend, its gears stiffen in steps and rub, its table gives way, "
        "stated stiffnesses are off by ± 40 %, inertias by 12 %: no parameters of 12P or 24P are "
        "its own.",
        (whole, paths, directions, where),
        findings(models, paths, designs, nine),
        {
            "birk2025_campbell": _campbell(hits, models),
            "birk2025_directions": _directions_figure(directions),
        },
    )


def _simulation(name: str) -> Simulation:
    return Simulation(Robot.load(shipped("kr10_birk2025") / "robot" / FILES[name]))


def _model(hits: PathHits, which: np.ndarray, name: str) -> IdentifiedModel:
    nominal, ours = _simulation(name), name.endswith("ours")
    frfs = hits.struck.frfs
    found = identify(
        [frfs[i] for i in which],
        hits.struck.q[which],
        nominal,
        CAD_INERTIAS if ours else paper_priors(nominal),
        band_hz=BAND_HZ,
        tolerances=None if ours else EXACT_HITS,
        extend=ours,
    ).identified
    limited, full = (_agreement(hits, found.simulation, band) for band in (BAND_HZ, FULL_HZ))
    return IdentifiedModel(found.simulation, found, limited, full, _above(hits))


def _agreement(hits: PathHits, simulation: Simulation, band_hz: tuple[float, float]) -> Agreement:
    """Of all poses, each on its own lines in the band."""
    parts = []
    for q, frf in zip(hits.struck.q, hits.struck.frfs, strict=True):
        lines = (frf.frequency_hz >= band_hz[0]) & (frf.frequency_hz <= band_hz[1])
        simulated = simulation.accelerance(q[None], frf.frequency_hz[lines])
        parts.append(metrics.agreement(frf.accelerance[None][..., lines], simulated))
    return metrics.stack(parts)


def _above(hits: PathHits) -> float:
    """Share of the direct FRFs' squared magnitudes that lies above the lower band."""
    above = whole = 0.0
    for frf in hits.struck.frfs:
        size = np.abs(np.einsum("iif->if", frf.accelerance)) ** 2
        above += float(size[:, frf.frequency_hz > BAND_HZ[1]].sum())
        whole += float(size.sum())
    return above / whole


def _designs(hits: PathHits, model: IdentifiedModel, progress: Tell) -> list[Design]:
    """The paper's nine points, as many of the planner's, fewer of these, and one path's.

    Without identification also the nine with hits along one axis.
    """
    simulation, frfs, q = _simulation("24P"), hits.struck.frfs, hits.struck.q
    nine = hits.ends_and_middles
    informative = Informative.of(
        simulation, paper_priors(simulation), frfs, q, model.found.misfit, BAND_HZ
    )
    chosen = informative.best(len(nine))
    first = np.flatnonzero(hits.path == PATHS[0])[:: max(1, sum(hits.path == PATHS[0]) // FEW)]
    wanted = {
        "ends and middles (the paper's)": nine,
        "D-optimal": chosen,
        f"D-optimal, the first {FEW}": chosen[:FEW],
        f"{FEW} of path S1": first[:FEW],
    }
    designs = []
    for i, (name, rows) in enumerate(wanted.items()):
        progress(name, i / len(wanted))
        fitted = model if rows is nine else _model(hits, rows, "24P")
        others = np.setdiff1d(np.arange(len(q)), rows)
        frac, _ = percent(fitted.limited[others])
        designs.append(Design(name, rows, informative.determined(rows), frac))
    for axis, letter in enumerate("xyz"):
        told = informative.determined(nine, [axis])
        designs.append(Design(f"the paper's, hit along {letter} only", nine, told, float("nan")))
    return designs


def _campbell(hits: PathHits, models: dict[str, IdentifiedModel]) -> Figure:
    """Figures 8 and 9: S1, hit and response y, over frequency and place along the path."""
    rows = np.flatnonzero(hits.path == PATHS[0])
    lines = np.linspace(BAND_HZ[0], BAND_HZ[1], 240)
    shown = {"measured (simulated)": []}
    for i in rows:
        frf = hits.struck.frfs[i]
        size = np.abs(frf.accelerance[1, 1])
        shown["measured (simulated)"].append(np.interp(lines, frf.frequency_hz, size))
    for name, model in models.items():
        shown[name] = list(
            np.abs(model.simulation.accelerance(hits.struck.q[rows], lines)[:, 1, 1])
        )
    figure = drawing.new((12.0, 4.2), "Figures 8 and 9: path S1, hit and response y")
    panels = figure.subplots(1, len(shown), sharey=True)
    top = 20 * np.log10(np.max(shown["measured (simulated)"]))
    for panel, (name, each) in zip(panels, shown.items(), strict=True):
        level = 20 * np.log10(np.maximum(np.array(each).T, 1e-9))
        image = panel.pcolormesh(
            np.arange(len(rows)) + 1, lines, level, vmin=top - 45, vmax=top, cmap="viridis",
            rasterized=True,
        )  # fmt: skip
        panel.set_title(name, fontsize=9)
        panel.set_xlabel("point of the path")
        if panel is panels[-1]:
            figure.colorbar(image, ax=list(panels), label="dB re 1 m/s²/N", pad=0.01)
    panels[0].set_ylabel("frequency (Hz)")
    return figure


def _directions_figure(table: Table) -> Figure:
    figure = drawing.new((9.0, 4.4), "Global FRAC by direction and band")
    rows = [row for row in table.rows if ", all, " in str(row[0])]
    values = np.array([row[1:4] for row in rows], dtype=float)
    panel = figure.subplots()
    drawing.bars(panel, [str(r[0]).replace(", all, ", "\n") for r in rows], ("x", "y", "z"),
                 values, "Global FRAC (%)")  # fmt: skip
    panel.set_ylim(0, 100)
    panel.legend(fontsize=9)
    return figure
