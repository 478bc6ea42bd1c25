"""Answer of `modes` for the recordings of one pose, which belong to no campaign."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from rich.console import Group

from planner.campaign.events import Amplitude
from planner.campaign.log_conversion import from_homogeneity
from planner.dataset.measure import DEFAULT_BAND_HZ, measure
from planner.dataset.screened_files import Source, in_parts, told_of_files
from planner.errors import InputError, RefusedError
from planner.frf.frf import Frf
from planner.frf.quantities import DERIVATIVE
from planner.modal.estimate_modes import identification
from planner.modal.modes import ModalModel, Mode
from planner.modal.pole_identification import PoleIdentification
from planner.recording.folder import CHANNELS, TABLE, files_in, joint_columns, read_recordings
from planner.recording.points import ANYWHERE, PointNames
from planner.recording.read import READERS
from planner.report.answer import Answer, RefusedFile
from planner.report.plot_files import Pictures
from planner.report.text import SIMULATED, drawn, remarks, table, with_sd

ESTIMATORS = ("h1", "h2", "hv")
LONGEST_NAME = 40  # characters of a file's name in a title
NO_PICTURES = Pictures()
NOT_DRAWN: dict[str, Any] = {"plots": (), "rrd": None}
UNSET = msgspec.UNSET


@dataclass(frozen=True)
class IdentifiedMode:
    """A mode with its sds; `shape` is [re, im] per response, `probability` that it is physical.

    `residue` is [re, im, sd] in m/(N·s) of each response to each hit, row by row.
    """

    frequency_hz: float
    frequency_sd_hz: float
    damping_ratio: float
    damping_sd: float
    shape: tuple[tuple[float, float], ...]
    probability: float
    residue: tuple[tuple[float, float, float], ...]

    @classmethod
    def of(cls, mode: Mode) -> "IdentifiedMode":
        """Of a mode of a modal model."""
        shape = tuple((float(s.real), float(s.imag)) for s in mode.shape)
        both = zip(np.ravel(mode.residue), np.ravel(mode.residue_sd), strict=True)
        residue = tuple((float(r.real), float(r.imag), float(sd)) for r, sd in both)
        return cls(
            mode.frequency_hz, mode.frequency_sd_hz, mode.damping_ratio, mode.damping_sd, shape,
            mode.probability, residue,
        )  # fmt: skip

    @property
    def cells(self) -> tuple[str, ...]:
        """A row of the table."""
        parts = [f"{re:+.2f}{im:+.2f}i" for re, im in self.shape]
        more = f"  and {len(parts) - 3} more" if len(parts) > 4 else ""
        return (
            with_sd(self.frequency_hz, self.frequency_sd_hz, ".3f"),
            with_sd(100 * self.damping_ratio, 100 * self.damping_sd),
            "  ".join(parts[:3] if more else parts) + more,
            f"{100 * self.probability:.0f}",
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class ModalReport(Answer):
    """Answer of `modes`; `hits` are how many were averaged per axis.

    `fit_error` is ‖H − fit‖/‖H‖, None where the modes were fitted to unscaled FRFs.
    """

    modes: tuple[IdentifiedMode, ...]
    band_hz: tuple[float, float]
    fit_error: float | None
    order: int
    refused: tuple[RefusedFile, ...]
    accepted: tuple[str, ...]
    hits: tuple[int, int, int] | msgspec.UnsetType = UNSET
    usable_band_hz: tuple[float, float] | msgspec.UnsetType = UNSET
    remarks: tuple[str, ...]
    amplitude: Amplitude | msgspec.UnsetType | None = UNSET
    simulated: bool
    plots: tuple[str, ...] = ()
    rrd: str | None = None

    @classmethod
    def of(cls, modal: ModalModel, **others: Any) -> "ModalReport":
        """Of a modal model and the other fields."""
        own = {
            "band_hz": modal.band_hz,
            "fit_error": modal.fit_error,
            "order": modal.order,
            "refused": (),
            "remarks": modal.remarks,
        }
        return cls(modes=tuple(map(IdentifiedMode.of, modal.modes)), **(own | others))

    def text(self) -> Group:
        """The modes as a table."""
        low, high = self.band_hz
        error = self.fit_error
        fitted = "" if error is None else f" (fit error {100 * error:.1f} %)"
        made = table(
            f"Modes between {low:g} and {high:g} Hz{fitted}",
            *("mode", "frequency (Hz)", "damping (%)", "shape x, y, z", "physical (%)"),
        )
        for k, mode in enumerate(self.modes):
            made.add_row(str(k + 1), *mode.cells)
        parts = [made, *remarks(self.remarks), *drawn(self.plots, self.rrd)]
        return Group(*parts, SIMULATED) if self.simulated else Group(*parts)


def check_options(
    band_hz: tuple[float, float] | None = None,
    estimator: str = "h1",
    quantity: str | None = None,
    window_rate_1_s: float = 0.0,
) -> None:
    """InputError for options that make no sense."""
    if estimator not in ESTIMATORS:
        raise InputError(f"--estimator {estimator} is not known; give h1, h2 or hv.")
    if quantity is not None and quantity not in DERIVATIVE:
        raise InputError(f"--quantity {quantity} is not known; give {', '.join(DERIVATIVE)}.")
    if not 0 <= window_rate_1_s < 1e3:
        raise InputError(f"--window-rate {window_rate_1_s:g}: give a rate in 1/s, 0 for none.")
    if band_hz is not None and not 0 <= band_hz[0] < band_hz[1]:
        raise InputError(f"--band-hz {band_hz[0]} {band_hz[1]}: give a lower and a higher Hz.")


def modal_report(
    sources: tuple[Source, ...],
    band_hz: tuple[float, float] | None = None,
    force: str | None = None,
    estimator: str = "h1",
    pictures: Pictures = NO_PICTURES,
    window_rate_1_s: float = 0.0,
) -> ModalReport:
    """Analyse files of one pose.

    `force` names the force channel of a long record whose channels are not labelled. Raises
    RefusedError if no file could be used.
    """
    if force is not None:
        return _by_channel(sources, band_hz, force, pictures)
    band = band_hz or DEFAULT_BAND_HZ
    measured = measure(in_parts(sources), band, estimator, window_rate_1_s)
    refused = [RefusedFile(v.source.name, v.reason) for v in measured.verdicts if not v.accepted]
    if measured.modal is None:
        reasons = [file.reason for file in refused] or list(measured.remarks)
        raise RefusedError(f"No modes could be identified: {reasons[0]}")
    assert measured.frf is not None
    simulated = any(v.simulated for v in measured.verdicts)
    accepted = tuple(v.source.name for v in measured.verdicts if v.accepted)
    found = identification(measured.frf, band) if pictures.wanted else None
    return ModalReport.of(
        measured.modal,
        refused=tuple(refused),
        accepted=accepted,
        hits=measured.frf.hits,
        usable_band_hz=measured.frf.usable_band_hz,
        remarks=(*told_of_files(measured.verdicts), *measured.remarks),
        amplitude=from_homogeneity(measured.homogeneity),
        simulated=simulated,
        **_draw(pictures, measured.frf, found, measured.modal, accepted, simulated),
    )


def sources_of(paths: Sequence[Path], from_names: bool = False) -> tuple[Source, ...]:
    """All recordings that files and folders hold; InputError for what does not exist.

    With `from_names` FRFs have what they do not state of their places from the files' names.
    """
    found: list[Source] = []
    for path in paths:
        if (path / TABLE).is_file():
            table = read_recordings(path, joint_columns(path), ANYWHERE, bare=True)
            found += [_of_no_robot(Source.of(row)) for row in table.rows]
        elif path.is_dir():
            found += [Source(file, str(file)) for file in files_in(path, READERS)]
        elif path.is_file():
            found += [Source(path, str(path))] if path.name != CHANNELS else []
        else:
            raise InputError(f"{path} does not exist; name the recordings of one pose.")
    return tuple(replace(source, from_name=from_names) for source in found)


def _of_no_robot(source: Source) -> Source:
    """Without names of points, but those that the table says."""
    return replace(source, stated=replace(source.stated, names=PointNames()))


def _draw(
    pictures: Pictures,
    frf: Frf | None,
    found: PoleIdentification | None,
    modal: ModalModel,
    accepted: Sequence[str],
    simulated: bool,
) -> dict[str, Any]:
    """Draw what is wanted; where it is."""
    if found is None or not pictures.wanted:
        return NOT_DRAWN
    from planner.report.modal_plots import modal_figures

    more = f" and {len(accepted) - 1} more" if len(accepted) > 1 else ""
    name = f"{Path(accepted[0]).name[-LONGEST_NAME:]}{more}"

    def record(rrd: Path) -> None:
        from planner.report.rerun_modal import record_modes

        record_modes(frf, found, modal, name, simulated, rrd)

    return pictures.write(modal_figures(frf, found, modal, name, simulated), name, record)


def _by_channel(
    sources: tuple[Source, ...],
    band_hz: tuple[float, float] | None,
    force: str,
    pictures: Pictures,
) -> ModalReport:
    """Long records with unlabelled channels: the user names the force channel."""
    from planner.modal.free_decays import analyse_record
    from planner.recording.read import read
    from planner.recording.records import TimeRecord

    if len(sources) != 1:
        raise InputError("--force analyses one long record at a time; name one file.")
    records = [r for r in read(sources[0].path) if isinstance(r, TimeRecord)]
    if not records:
        raise InputError(f"{sources[0].name} holds no time histories; leave out --force.")
    modal, found = analyse_record(records[0], force_channel=force, band_hz=band_hz)
    accepted, simulated = (sources[0].name,), records[0].simulated
    plots = _draw(pictures, None, found, modal, accepted, simulated)
    return ModalReport.of(modal, accepted=accepted, simulated=simulated, **plots)
