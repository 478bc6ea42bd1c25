"""Modal analysis of files that belong to no campaign (`planner modes`)."""

from pathlib import Path
from typing import Any

from planner.errors import InputError, RefusedError
from planner.modes.measure import Source, measure
from planner.modes.types import ModalModel
from planner.recording.folder import files_in

DEFAULT_BAND_HZ = (4.0, 60.0)


def analyse(
    paths: tuple[Path, ...],
    band_hz: tuple[float, float] | None,
    force: str | None,
    estimator: str = "h1",
) -> dict[str, Any]:
    """Answer of `modes`. Raises RefusedError if no file could be used."""
    if estimator not in ("h1", "h2", "hv"):
        raise InputError(f"--estimator {estimator} is not known; give h1, h2 or hv.")
    if band_hz is not None and not 0 <= band_hz[0] < band_hz[1]:
        raise InputError(f"--band-hz {band_hz[0]} {band_hz[1]}: give a lower and a higher Hz.")
    sources = _sources(paths)
    if force is not None:
        return _by_channel(sources, band_hz, force)
    measured = measure(sources, band_hz or DEFAULT_BAND_HZ, estimator)
    refused = [
        {"file": v.source.name, "reason": v.reason} for v in measured.verdicts if not v.accepted
    ]
    if measured.modal is None:
        reasons = [entry["reason"] for entry in refused] or list(measured.remarks)
        raise RefusedError(f"No modes could be identified: {reasons[0]}")
    answer = _answer(measured.modal)
    assert measured.frf is not None
    return {
        **answer,
        "refused": refused,
        "accepted": [v.source.name for v in measured.verdicts if v.accepted],
        "hits": list(measured.frf.hits),
        "usable_band_hz": list(measured.frf.usable_band_hz),
        "remarks": list(measured.remarks),
        "simulated": any(v.simulated for v in measured.verdicts),
    }


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
    sources: tuple[Source, ...], band_hz: tuple[float, float] | None, force: str
) -> dict[str, Any]:
    """Long records with unlabelled channels: the user names the force channel."""
    from planner.modes.record import modes_from_record
    from planner.recording.read import read
    from planner.recording.types import TimeRecord

    if len(sources) != 1:
        raise InputError("--force analyses one long record at a time; name one file.")
    records = [r for r in read(sources[0].path) if isinstance(r, TimeRecord)]
    if not records:
        raise InputError(f"{sources[0].name} holds no time histories; leave out --force.")
    modal = modes_from_record(records[0], force_channel=force, band_hz=band_hz)
    return {
        **_answer(modal),
        "refused": [],
        "accepted": [sources[0].name],
        "remarks": list(modal.remarks),
        "simulated": records[0].simulated,
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
