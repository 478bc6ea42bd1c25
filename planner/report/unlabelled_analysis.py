"""Answer of `modes` for FRFs that state neither nodes nor directions."""

from typing import Any

from planner.dataset.frf_set import FrfSet
from planner.errors import InputError
from planner.frf.labelled import joined
from planner.modal.modes import ModalModel
from planner.modal.transfer_functions import modes_from_transfer_functions
from planner.recording.records import FrfRecord
from planner.report.modal_analysis import LONGEST_NAME, NOT_DRAWN, ModalReport
from planner.report.plot_files import Pictures
from planner.report.text import SIMULATED_TITLE


def unlabelled_report(given: FrfSet, quantity: str | None, pictures: Pictures) -> ModalReport:
    """Poles and unscaled shapes, with one entry per FRF in the order of the files.

    Raises InputError or RefusedError in one sentence.
    """
    if given.exponential_rate_1_s:
        raise InputError("--window-rate is for hits, and for FRFs that state their directions.")
    record = joined(given.records)
    modal = modes_from_transfer_functions(record, quantity, given.band_hz)
    return ModalReport.of(
        modal,
        fit_error=None,
        accepted=given.accepted,
        refused=given.refused,
        simulated=record.simulated,
        **_draw(record, modal, len(given.accepted) - 1, pictures),
    )


def _draw(record: FrfRecord, modal: ModalModel, more: int, pictures: Pictures) -> dict[str, Any]:
    """Draw what is wanted; where it is."""
    if not pictures.wanted:
        return NOT_DRAWN
    from planner.report.modal_plots import cmif_figure, mac_figure

    name = record.source.name[-LONGEST_NAME:] + (f" and {more} more" if more else "")
    mark = SIMULATED_TITLE if record.simulated else ""
    title = f"{mark}CMIF · {name}"
    figures = {
        "cmif": cmif_figure(record.frequency_hz, record.values, modal, title),
        "mac": mac_figure(modal, f"{mark}AutoMAC · {name}"),
    }
    return pictures.write(figures, name)
