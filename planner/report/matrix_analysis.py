"""Answer of `modes` for a matrix of FRFs between any points."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Group
from rich.text import Text

from planner.dataset.frf_set import FrfSet
from planner.frf.matrix import FrfMatrix
from planner.modal.matrix_modes import MatrixMode, MatrixModes, modes_of_matrix, with_normal_modes
from planner.recording.dof import Dof
from planner.recording.geometry import Geometry, read_geometry
from planner.report.answer import Answer, RefusedFile
from planner.report.modal_analysis import LONGEST_NAME, NOT_DRAWN
from planner.report.plot_files import Pictures
from planner.report.text import SIMULATED, SIMULATED_TITLE, drawn, remarks, table, with_sd
from planner.words import counted


@dataclass(frozen=True)
class ModeOverPoints:
    """A mode over many points; `shape` is [re, im] per degree of freedom, in their order.

    In kg^-1/2 (unit modal mass) where `scaled`, else of unit length; `shape_sd` is of real and
    imaginary part each.
    """

    frequency_hz: float
    frequency_sd_hz: float
    damping_ratio: float
    damping_sd: float
    shape: tuple[tuple[float, float], ...]
    shape_sd: tuple[float, ...]
    scaled: bool
    probability: float
    mpc: float
    mpd_deg: float


@dataclass(frozen=True)
class MatrixShape(ModeOverPoints):
    """A mode of a matrix of FRFs.

    `modal_mass_kg` belongs to the shape with largest component 1, `scatter_hz` is how the frequency
    differs from set to set (sd).
    """

    modal_mass_kg: float
    scatter_hz: float

    @classmethod
    def of(cls, mode: MatrixMode) -> "MatrixShape":
        """Of a mode over all points."""
        return cls(
            mode.frequency_hz, mode.frequency_sd_hz, mode.damping_ratio, mode.damping_sd,
            tuple((float(s.real), float(s.imag)) for s in mode.shape),
            tuple(float(sd) for sd in mode.shape_sd),
            mode.scaled, mode.probability, mode.collinearity, mode.deviation_deg,
            mode.modal_mass_kg, mode.scatter_hz,
        )  # fmt: skip


@dataclass(frozen=True, eq=False, kw_only=True)
class MatrixReport(Answer):
    """Answer of `modes` of a matrix; `dofs` are [node, direction] of every entry of a shape.

    `fit_error` is ‖H − fit‖/‖H‖ in the band, `frfs` how many FRFs there were.
    """

    modes: tuple[MatrixShape, ...]
    dofs: tuple[tuple[int | str, str], ...]
    references: tuple[tuple[int | str, str], ...]
    frfs: int
    band_hz: tuple[float, float]
    fit_error: float
    order: int
    refused: tuple[RefusedFile, ...]
    accepted: tuple[str, ...]
    remarks: tuple[str, ...]
    simulated: bool
    exports: tuple[str, ...] = ()
    plots: tuple[str, ...] = ()
    rrd: str | None = None

    def text(self) -> Group:
        """The modes as a table."""
        low, high = self.band_hz
        made = table(
            f"Modes between {low:g} and {high:g} Hz from {counted(self.frfs, 'FRF')}, "
            f"{counted(len(self.dofs), 'degree of freedom', 'degrees of freedom')} "
            f"(fit error {100 * self.fit_error:.1f} %)",
            *("mode", "frequency (Hz)", "damping (%)", "MPC", "MPD (°)", "modal mass (kg)"),
            *("largest at", "physical (%)"),
        )
        for k, mode in enumerate(self.modes):
            made.add_row(str(k + 1), *self._cells(mode))
        parts = [made, *remarks(self.remarks), *drawn(self.plots, self.rrd)]
        parts += [Text("\n  ".join(["Files:", *self.exports]))] if self.exports else []
        return Group(*parts, SIMULATED) if self.simulated else Group(*parts)

    def _cells(self, mode: MatrixShape) -> tuple[str, ...]:
        sizes = [abs(complex(*value)) for value in mode.shape]
        node, direction = self.dofs[sizes.index(max(sizes))]
        return (
            with_sd(mode.frequency_hz, mode.frequency_sd_hz, ".3f"),
            with_sd(100 * mode.damping_ratio, 100 * mode.damping_sd, ".3f"),
            f"{mode.mpc:.3f}",
            f"{mode.mpd_deg:.1f}",
            f"{mode.modal_mass_kg:.3g}" if mode.scaled else "not scaled",
            f"{node} {direction}".strip(),
            f"{100 * mode.probability:.0f}",
        )


def matrix_report(
    given: FrfSet,
    quantity: str | None,
    pictures: Pictures,
    real: bool = False,
    files_to: Path | None = None,
) -> MatrixReport:
    """Analyse FRFs between any points.

    With `real` the shapes are the real normal modes behind the complex ones; `files_to` is a folder
    for universal files and tables. Raises InputError or RefusedError in one sentence.
    """
    files = given.files
    matrix = given.matrix(quantity)
    geometry = read_geometry(files)
    found = modes_of_matrix(matrix, given.band_hz, geometry)
    if real:
        found = with_normal_modes(found)
    return MatrixReport(
        modes=tuple(MatrixShape.of(mode) for mode in found.modes),
        dofs=tuple(named(dof) for dof in found.dofs),
        references=tuple(named(dof) for dof in matrix.references),
        frfs=matrix.count,
        band_hz=found.band_hz,
        fit_error=found.found.fit_error,
        order=found.found.order,
        refused=given.refused,
        accepted=given.accepted,
        remarks=(*given.remarks, *found.remarks),
        simulated=matrix.simulated,
        exports=_export(matrix, found, geometry, real, files_to),
        **_draw(pictures, matrix, found, geometry, files),
    )


def named(dof: Dof) -> tuple[int | str, str]:
    """Node (a number where it is one) and direction, as answers name a degree of freedom."""
    return (int(dof.node) if dof.node.lstrip("-").isdigit() else dof.node), dof.direction


def _export(
    matrix: FrfMatrix,
    found: MatrixModes,
    geometry: Geometry | None,
    real: bool,
    folder: Path | None,
) -> tuple[str, ...]:
    """Write files for other programs, where wanted; where they are."""
    if folder is None:
        return ()
    from planner.export.matrix_files import Exported, export

    what = Exported(matrix, found, geometry, real)
    return tuple(str(path) for path in export(what, folder.absolute()))


def _draw(
    pictures: Pictures,
    matrix: FrfMatrix,
    found: MatrixModes,
    geometry: Geometry | None,
    files: Sequence[Path],
) -> dict[str, Any]:
    """Draw what is wanted; where it is."""
    if not pictures.wanted:
        return NOT_DRAWN
    from planner.report.matrix_plots import matrix_figures
    from planner.report.shape_motion import animate

    name = files[0].name[-LONGEST_NAME:] + (f" and {len(files) - 1} more" if files[1:] else "")

    def record(rrd: Path) -> None:
        from planner.report.rerun_matrix import record_matrix

        record_matrix(matrix, found, geometry, name, rrd)

    drawn = pictures.write(matrix_figures(matrix, found, geometry, name), name, record)
    if geometry is not None and pictures.folder is not None:
        mark = SIMULATED_TITLE if matrix.simulated else ""
        moving = animate(found, geometry, pictures.folder.absolute(), mark)
        drawn["plots"] = [*drawn["plots"], *map(str, moving)]
    return drawn
