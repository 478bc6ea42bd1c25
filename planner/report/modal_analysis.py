"""From recordings to the answer of `modes`: one pose, any points, unlabelled FRFs, responses."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import UNSET

from planner.campaign.imported_files import sort_paths
from planner.dataset.frf_set import FrfSet
from planner.dataset.measure import DEFAULT_BAND_HZ, measure
from planner.dataset.screened_files import Source, in_parts, told_of_files
from planner.diagnosis.exponential_window import screen_window
from planner.errors import InputError, RefusedError, RefusedFile
from planner.frf.frf import Frf
from planner.frf.matrix import FrfMatrix, joined
from planner.frf.synthesis import DERIVATIVE
from planner.modal.estimate_modes import PoleIdentification, identification
from planner.modal.matrix_modes import modes_of_matrix, with_normal_modes
from planner.modal.modes import ModalModel
from planner.modal.operating import operating_modes
from planner.modal.transfer_functions import modes_from_transfer_functions
from planner.recording.channel_faults import lost_samples
from planner.recording.folder import TABLE
from planner.recording.hits import without_unit
from planner.recording.points import Dof, PointNames
from planner.recording.read import read
from planner.recording.records import TimeRecord
from planner.recording.uff import read_geometry
from planner.report.answer import Done
from planner.report.modes import mode_keys, modes_answer, named
from planner.report.pictures import Pictures

ESTIMATORS = ("h1", "h2", "hv")
LONGEST_NAME = 40  # characters of a file's name in a title
RESPONSES = ("acceleration", "velocity", "displacement", "voltage", "unknown")
UNSCALED = (
    "UNSCALED: modes are from responses alone; their shapes have no scale and give no FRFs or "
    "modal masses."
)


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


def sources_of(paths: Sequence[Path], from_names: bool = False) -> tuple[Source, ...]:
    """All recordings that files and folders hold; InputError for what does not exist.

    A file is what the table beside it says, if that lists it. With `from_names` FRFs have what they
    do not state of their places from the files' names.
    """
    # A table among files says what these are; points are those that it names, of no robot.
    given = tuple(path for path in paths if path.name != TABLE or len(paths) == 1)
    deliveries = sort_paths(given, None, None, None)
    poses = list(dict.fromkeys(one.pose for one in deliveries if one.row))
    if len(poses) > 1:
        raise InputError(
            f"{paths[0]}: what is named is of several poses ({', '.join(poses[:4])}); name the "
            f"recordings of one, or one folder whose {TABLE} lists all."
        )
    every = (s for one in deliveries for s in one.sources)
    named = ((s, replace(s.stated, names=PointNames())) for s in every)
    return tuple(replace(s, stated=stated, from_name=from_names) for s, stated in named)


def _titled(files: Sequence[str]) -> str:
    """The files' name in titles."""
    others = f" and {len(files) - 1} more" if len(files) > 1 else ""
    return f"{Path(files[0]).name[-LONGEST_NAME:]}{others}"


def _of_model(modal: ModalModel, **others: Any) -> Done:
    own = {name: getattr(modal, name) for name in ("band_hz", "fit_error", "order", "remarks")}
    return modes_answer(modes=list(map(mode_keys, modal.modes)), **(own | others))


def modal_report(
    sources: tuple[Source, ...], band_hz: tuple[float, float] | None, force: str | None,
    estimator: str, pictures: Pictures, window_rate_1_s: float,
) -> Done:  # fmt: skip
    """Of files of one pose; `force` names the channel of a long record that is not labelled.

    Raises RefusedError if no file could be used.
    """
    if force is not None:
        return _by_channel(sources, band_hz, force, pictures)
    band = band_hz or DEFAULT_BAND_HZ
    measured = measure(in_parts(sources), band, estimator, window_rate_1_s)
    verdicts, modal, frf = measured.verdicts, measured.modal, measured.frf
    refused = tuple(RefusedFile(v.source.name, v.reason) for v in verdicts if not v.accepted)
    if modal is None:
        reasons = [file.reason for file in refused] or list(measured.remarks)
        raise RefusedError(f"No modes could be identified: {reasons[0]}")
    assert frf is not None
    hits = [hit for own in measured.files.hits for hit in own]
    window = None if window_rate_1_s else screen_window(hits)
    accepted = tuple(v.source.name for v in verdicts if v.accepted)
    simulated = any(v.simulated for v in verdicts)
    return _of_model(
        modal,
        refused=refused,
        accepted=accepted,
        hits=frf.hits,
        usable_band_hz=frf.usable_band_hz,
        remarks=(*told_of_files(verdicts), *measured.remarks, *([window.text] if window else [])),
        amplitude=measured.homogeneity,
        simulated=simulated,
        **_drawn(pictures, frf, lambda: identification(frf, band), modal, accepted, simulated),
    )


def _drawn(
    pictures: Pictures, frf: Frf | None, found: Callable[[], PoleIdentification | None],
    modal: ModalModel, files: tuple[str, ...], simulated: bool,
) -> dict[str, Any]:  # fmt: skip
    def draw():
        from planner.report.modal_plots import modal_figures

        poles = found()
        return modal_figures(frf, poles, modal) if poles else {}

    return pictures.write(draw, _titled(files), simulated=simulated)


def _by_channel(
    sources: tuple[Source, ...], band_hz: tuple[float, float] | None, force: str, pictures: Pictures
) -> Done:
    """Long records with unlabelled channels: the user names the force channel."""
    from planner.modal.free_decays import analyse_record

    if len(sources) != 1:
        raise InputError("--force analyses one long record at a time; name one file.")
    records = [r for r in read(sources[0].path) if isinstance(r, TimeRecord)]
    if not records:
        raise InputError(f"{sources[0].name} holds no time histories; leave out --force.")
    modal, found = analyse_record(records[0], force, band_hz)
    accepted, simulated = (sources[0].name,), records[0].simulated
    written = _drawn(pictures, None, lambda: found, modal, accepted, simulated)
    return _of_model(modal, accepted=accepted, simulated=simulated, **written)


def unlabelled_report(given: FrfSet, quantity: str | None, pictures: Pictures) -> Done:
    """Of FRFs without nodes and directions: poles and unscaled shapes, an entry per FRF.

    In the order of the files. Raises InputError or RefusedError in one sentence.
    """
    record = joined(given.records)
    modal = modes_from_transfer_functions(record, quantity, given.band_hz)

    def draw():
        from planner.report.modal_plots import unlabelled_figures

        return unlabelled_figures(record, modal)

    name = _titled((record.source.name, *given.accepted[1:]))
    return _of_model(
        modal, fit_error=None, accepted=given.accepted, refused=given.refused,
        simulated=record.simulated, **pictures.write(draw, name, simulated=record.simulated),
    )  # fmt: skip


def matrix_report(
    given: FrfSet, matrix: FrfMatrix, pictures: Pictures, real: bool, files_to: Path | None
) -> Done:
    """Of the matrix of FRFs between any points.

    With `real` the shapes are the real normal modes behind the complex ones; `files_to` is a folder
    for universal files and tables. Raises InputError or RefusedError in one sentence.
    """
    geometry = read_geometry(given.files)
    found = modes_of_matrix(matrix, given.band_hz, geometry)
    found = with_normal_modes(found) if real else found
    exports: tuple[str, ...] = ()
    if files_to is not None:
        from planner.export.matrix_files import Exported, export

        paths = export(Exported(matrix, found, geometry, real), files_to.absolute())
        exports = tuple(map(str, paths))

    name, note, more = _titled([file.name for file in given.files]), "", None
    if geometry is not None and pictures.rrd is not None:
        from planner.report.rerun.modes import moving_shapes

        more = moving_shapes(found, geometry)
        note = "On the timeline shapes move, exaggerated; grey: at rest."

    def draw():
        from planner.report.matrix_plots import matrix_figures

        return matrix_figures(matrix, found, geometry)

    written = pictures.write(draw, name, note, more, matrix.simulated)
    if geometry is not None and pictures.folder is not None:
        from planner.report.matrix_plots import animate

        moving = animate(found, geometry, pictures.folder.absolute(), matrix.simulated)
        written["plots"] = (*written["plots"], *map(str, moving))
    return modes_answer(
        modes=list(map(mode_keys, found.modes)),
        dofs=tuple(map(named, found.dofs)),
        responses=tuple(map(named, matrix.responses)),
        references=tuple(map(named, matrix.references)),
        frfs=matrix.count,
        band_hz=found.band_hz,
        fit_error=found.found.fit_error,
        order=found.found.diagram.order,
        refused=given.refused,
        accepted=given.accepted,
        remarks=(*given.remarks, *found.remarks),
        simulated=matrix.simulated,
        exports=exports,
        **written,
    )


def operating_report(
    paths: Sequence[Path], band_hz: tuple[float, float] | None, pictures: Pictures
) -> Done:
    """Analyse the responses of one record. Raises InputError where a file holds none."""
    check_options(band_hz)
    sources = sources_of(paths)
    if len(sources) != 1:
        raise InputError("--operating analyses one record at a time; name one file.")
    path = sources[0].path
    records = [record for record in read(path) if isinstance(record, TimeRecord)]
    if not records:
        raise InputError(f"{path} holds no time histories; --operating needs records of responses.")
    record = records[0]  # channels that stand still are left out
    channels = [c for c in record.channels if c.quantity in RESPONSES and np.ptp(c.samples) > 0]
    if not channels:
        raise InputError(f"{path} holds no response that moves; export accelerations.")
    samples = np.array([channel.samples for channel in channels])
    dofs = tuple(
        Dof.of_uff(c.name if c.node in ("", "0") else c.node, c.direction) for c in channels
    )
    sign = np.array([dof.sign for dof in dofs])
    found = operating_modes(sign[:, None] * samples, record.sampling_rate_hz, band_hz)
    faults = (*record.faults, *lost_samples(record))
    told = [*record.remarks, *(fault.text for fault in faults), UNSCALED]
    if unlabelled := without_unit(record):
        told.append(f"Of no known unit: {unlabelled}.")
    if found.tones_hz:
        tones = ", ".join(f"{hz:.4g}" for hz in found.tones_hz)
        told.append(f"Tones, not modes, at {tones} Hz: what turns or hums there was left out.")

    def draw():
        from planner.report.modal_plots import operating_figures

        return operating_figures(found)

    note = "Responses alone give no scale: neither FRFs nor modal masses follow."
    return modes_answer(
        modes=[mode_keys(m, modal_mass_kg=UNSET, scatter_hz=UNSET) for m in found.modes],
        dofs=tuple(named(dof.positive) for dof in dofs),
        scaled=False,
        band_hz=found.band_hz,
        tones_hz=found.tones_hz,
        accepted=(sources[0].name,),
        remarks=tuple(told),
        simulated=record.simulated,
        **pictures.write(draw, _titled([path.name]), note, simulated=record.simulated),
    )
