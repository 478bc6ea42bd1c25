"""Modal analysis of files that belong to no campaign (`planner modes`)."""

from pathlib import Path
from typing import Any

import msgspec

from planner.campaign.log_conversion import from_homogeneity
from planner.dataset.measure import measure
from planner.dataset.screened_files import Source
from planner.errors import InputError, PlannerError, RefusedError
from planner.frf.frf import Frf
from planner.frf.quantities import DERIVATIVE
from planner.modal.estimate_modes import identification
from planner.modal.modes import ModalModel
from planner.modal.pole_identification import Identification
from planner.recording.folder import TABLE, files_in
from planner.recording.records import FrfRecord
from planner.report.plot_files import Pictures

DEFAULT_BAND_HZ = (4.0, 60.0)
LONGEST_NAME = 40  # characters of a file's name in a title
NONE = Pictures()


def several_poses(paths: list[Path]) -> bool:
    """Whether a single folder with recordings.csv is named."""
    return len(paths) == 1 and (paths[0] / TABLE).is_file()


def check(
    band_hz: tuple[float, float] | None,
    estimator: str,
    quantity: str | None,
    window_rate_1_s: float,
) -> None:
    """InputError for options that make no sense."""
    if estimator not in ("h1", "h2", "hv"):
        raise InputError(f"--estimator {estimator} is not known; give h1, h2 or hv.")
    if quantity is not None and quantity not in DERIVATIVE:
        raise InputError(f"--quantity {quantity} is not known; give {', '.join(DERIVATIVE)}.")
    if not 0 <= window_rate_1_s < 1e3:
        raise InputError(f"--window-rate {window_rate_1_s:g}: give a rate in 1/s, 0 for none.")
    if band_hz is not None and not 0 <= band_hz[0] < band_hz[1]:
        raise InputError(f"--band-hz {band_hz[0]} {band_hz[1]}: give a lower and a higher Hz.")


def analyse(
    paths: tuple[Path, ...],
    band_hz: tuple[float, float] | None,
    force: str | None,
    estimator: str = "h1",
    pictures: Pictures = NONE,
    quantity: str | None = None,
    window_rate_1_s: float = 0.0,
) -> dict[str, Any]:
    """Answer of `modes`. Raises RefusedError if no file could be used."""
    check(band_hz, estimator, quantity, window_rate_1_s)
    sources = _sources(paths)
    if force is not None:
        return _by_channel(sources, band_hz, force, pictures)
    unlabelled = _unlabelled(sources, quantity)
    if unlabelled is not None:
        return _by_transfer(unlabelled, band_hz, quantity, pictures)
    band = band_hz or DEFAULT_BAND_HZ
    measured = measure(sources, band, estimator, window_rate_1_s)
    refused = [
        {"file": v.source.name, "reason": v.reason} for v in measured.verdicts if not v.accepted
    ]
    if measured.modal is None:
        reasons = [entry["reason"] for entry in refused] or list(measured.remarks)
        raise RefusedError(f"No modes could be identified: {reasons[0]}")
    answer = _answer(measured.modal)
    assert measured.frf is not None
    simulated = any(v.simulated for v in measured.verdicts)
    accepted = [v.source.name for v in measured.verdicts if v.accepted]
    found = identification(measured.frf, band) if pictures.wanted else None
    return {
        **answer,
        "refused": refused,
        "accepted": accepted,
        "hits": list(measured.frf.hits),
        "usable_band_hz": list(measured.frf.usable_band_hz),
        "remarks": list(measured.remarks),
        "amplitude": msgspec.to_builtins(from_homogeneity(measured.homogeneity)),
        "simulated": simulated,
        **_draw(pictures, measured.frf, found, measured.modal, accepted, simulated),
    }


def _draw(
    pictures: Pictures,
    frf: Frf | None,
    found: Identification | None,
    modal: ModalModel,
    accepted: list[str],
    simulated: bool,
) -> dict[str, Any]:
    """Draw what is wanted; part of the answer."""
    if found is None or not pictures.wanted:
        return {"plots": [], "rrd": None}
    from planner.report.modal_plots import modal_figures

    more = f" and {len(accepted) - 1} more" if len(accepted) > 1 else ""
    name = f"{Path(accepted[0]).name[-LONGEST_NAME:]}{more}"
    return pictures.write(modal_figures(frf, found, modal, name, simulated), name)


def _sources(paths: tuple[Path, ...]) -> tuple[Source, ...]:
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            found += files_in(path)
        elif path.is_file():
            found.append(path)
        else:
            raise InputError(f"{path} does not exist; name the recordings of one pose.")
    return tuple(Source(path, str(path)) for path in found)


def _by_channel(
    sources: tuple[Source, ...],
    band_hz: tuple[float, float] | None,
    force: str,
    pictures: Pictures,
) -> dict[str, Any]:
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
    return {
        **_answer(modal),
        "refused": [],
        "accepted": [sources[0].name],
        "remarks": list(modal.remarks),
        "simulated": records[0].simulated,
        **_draw(pictures, None, found, modal, [sources[0].name], records[0].simulated),
    }


def _unlabelled(sources: tuple[Source, ...], quantity: str | None) -> FrfRecord | None:
    """The FRFs of a single file that states no directions."""
    from planner.recording.read import read

    if len(sources) != 1:
        return None
    try:
        records = read(sources[0].path)
    except PlannerError:
        return None  # said again, with the file's name, where it is read in earnest
    frfs = [r for r in records if isinstance(r, FrfRecord) and not any(r.response_direction)]
    return frfs[0] if frfs else None


def _by_transfer(
    record: FrfRecord,
    band_hz: tuple[float, float] | None,
    quantity: str | None,
    pictures: Pictures,
) -> dict[str, Any]:
    """FRFs without directions: poles and unscaled shapes."""
    from planner.modal.transfer_functions import modes_from_transfer_functions

    modal = modes_from_transfer_functions(record, quantity, band_hz)
    drawn: dict[str, Any] = {"plots": [], "rrd": None}
    if pictures.wanted:
        from planner.report.modal_plots import cmif_figure, mac_figure

        name = record.source.name[-LONGEST_NAME:]
        figures = {
            "cmif": cmif_figure(record.frequency_hz, record.values, modal, f"CMIF · {name}"),
            "mac": mac_figure(modal, f"AutoMAC · {name}"),
        }
        drawn = pictures.write(figures, name)
    return {
        **_answer(modal),
        "fit_error": None,
        "refused": [],
        "accepted": [str(record.source)],
        "remarks": list(modal.remarks),
        "simulated": record.simulated,
        **drawn,
    }


def _answer(modal: ModalModel) -> dict[str, Any]:
    return {
        "modes": [
            {
                "frequency_hz": m.frequency_hz,
                "frequency_sd_hz": m.frequency_sd_hz,
                "damping_ratio": m.damping_ratio,
                "damping_sd": m.damping_sd,
                "shape": [[s.real, s.imag] for s in m.shape],
                "probability": m.probability,
            }
            for m in modal.modes
        ],
        "band_hz": list(modal.band_hz),
        "fit_error": modal.fit_error,
        "order": modal.order,
    }
