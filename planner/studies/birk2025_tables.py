"""Agreement of identified models with all hits, as Birk et al. 2025 tell it (Tables 4 and 5)."""

from dataclasses import dataclass

import numpy as np

from planner.dynamics.simulation import Simulation
from planner.fit.result import Identification
from planner.frf import metrics
from planner.frf.metrics import Agreement
from planner.studies.birk2025_data import PATHS, PathHits
from planner.studies.birk2025_design import Design
from planner.studies.report import Table

PAPER_FRAC = {"12P": 40.8, "24P": 70.5}  # %, ≤ 200 Hz (Table 4)
PAPER_FULL = {"12P": 22.6, "24P": 36.9}
PAPER_FROBENIUS = {"12P": 19.1, "24P": 44.9}
PAPER_PATHS = {  # FRAC and Frobenius similarity (Table 5)
    "12P": ((41.8, 19.6), (46.7, 22.3), (33.9, 15.6)),
    "24P": ((75.0, 48.9), (70.1, 44.2), (66.2, 41.7)),
}
BANDS = "≤ 200 Hz", "≤ 800 Hz"


@dataclass(frozen=True, eq=False)
class IdentifiedModel:
    """An identified simulation and its agreement with all poses, in each band.

    `above`: share of the direct FRFs' squared magnitudes that lies above the lower band.
    """

    simulation: Simulation
    found: Identification
    limited: Agreement
    full: Agreement
    above: float


def percent(agreement: Agreement) -> tuple[float, float]:
    """FRAC and Frobenius similarity in %, means over the direct FRFs."""
    return (
        100 * metrics.direct_mean(agreement.global_frac),
        100 * metrics.direct_mean(agreement.frobenius),
    )


def table_4(models: dict[str, IdentifiedModel]) -> Table:
    """All points, both bands."""
    rows = []
    for name, model in models.items():
        limited, full, nan = percent(model.limited), percent(model.full), float("nan")
        rows.append(
            (name, *limited, *full, PAPER_FRAC.get(name, nan), PAPER_FROBENIUS.get(name, nan),
             PAPER_FULL.get(name, nan))
        )  # fmt: skip
    columns = ("model", "FRAC ≤ 200 Hz, %", "Frobenius", "FRAC ≤ 800 Hz, %", "Frobenius",
               "paper: FRAC ≤ 200", "Frobenius", "FRAC ≤ 800")  # fmt: skip
    return Table("birk2025_table_4", "Table 4: all points", columns, tuple(rows))


def table_5(hits: PathHits, models: dict[str, IdentifiedModel]) -> Table:
    """Path by path below 200 Hz."""
    rows = []
    for name, model in models.items():
        for i, path in enumerate(PATHS):
            agreed = percent(model.limited[hits.path == path])
            paper = PAPER_PATHS.get(name, ((float("nan"),) * 2,) * 3)[i]
            rows.append((f"{name}, {path}", *agreed, *paper))
    columns = "model, path", "FRAC, %", "Frobenius, %", "paper: FRAC, %", "Frobenius, %"
    return Table("birk2025_table_5", "Table 5: by path, ≤ 200 Hz", columns, tuple(rows))


def direction_table(hits: PathHits, models: dict[str, IdentifiedModel]) -> Table:
    """Model, path, band and direction of the direct FRFs (Figure A1 has part of it)."""
    rows = []
    for name, model in models.items():
        for band, agreement in zip(BANDS, (model.limited, model.full), strict=True):
            for path in ("all", *PATHS):
                kept = np.ones(len(hits.path), bool) if path == "all" else hits.path == path
                some = agreement[kept]
                frac = 100 * np.diagonal(some.global_frac)
                frobenius = 100 * np.diagonal(some.frobenius)
                rows.append((f"{name}, {path}, {band}", *map(float, (*frac, *frobenius))))
    columns = "model, path, band", "FRAC x, %", "y", "z", "Frobenius x, %", "y", "z"
    return Table("birk2025_directions", "By path, direction and band", columns, tuple(rows))


def design_table(hits: PathHits, designs: list[Design]) -> Table:
    """Which points determine how many parameters, and how well a fit to them predicts."""
    names = hits.names
    rows = [
        (d.name, float(len(d.rows)), float(d.determined), d.frac,
         " ".join(names[i] for i in d.rows))
        for d in designs
    ]  # fmt: skip
    columns = ("points", "count", "parameters determined", "FRAC at all others, %", "which")
    return Table("birk2025_where", "Where to measure for 24P: which poses determine what, ≤ 200 Hz",
                 columns, tuple(rows))  # fmt: skip
