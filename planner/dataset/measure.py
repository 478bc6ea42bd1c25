"""From the files of one pose to its modes: read, screen, average, identify."""

from dataclasses import dataclass, replace
from pathlib import Path

from planner.errors import InputError, PlannerError, RefusedError
from planner.frf.frf import Frf
from planner.modal.homogeneity import Homogeneity, homogeneity
from planner.modal.modes import ModalModel
from planner.recording.records import FrfRecord, Hit, Record


@dataclass(frozen=True)
class Source:
    """One file and what the table of recordings says about it (None: nothing)."""

    path: Path
    name: str
    hit: str | None = None
    repeat: int | None = None


@dataclass(frozen=True)
class Verdict:
    """What became of one file: accepted, or refused for a stated reason."""

    source: Source
    accepted: bool
    reason: str = ""
    axis: str | None = None
    simulated: bool = False
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class MeasuredPose:
    """All that one pose's files gave; `frf` and `modal` are None where nothing could be used."""

    verdicts: tuple[Verdict, ...]
    hits: tuple[Hit, ...]
    frf: Frf | None
    modal: ModalModel | None
    remarks: tuple[str, ...] = ()
    homogeneity: Homogeneity | None = None  # None: one force level only


def measure(
    sources: tuple[Source, ...],
    band_hz: tuple[float, float],
    estimator: str = "h1",
    window_rate_1_s: float = 0.0,
) -> MeasuredPose:
    """Read and screen every file, estimate the FRF from the good hits and the modes from it.

    A file that cannot be used is refused with its reason, never dropped in silence.
    `window_rate_1_s` is that of an exponential window e^(−rate·t) that the analyser has laid over
    all channels: it is part of what is fitted, so that damping comes out without it.
    """
    from planner.modal.estimate_modes import estimate_modes

    averaged = average(sources, band_hz, estimator, window_rate_1_s)
    if averaged.frf is None:
        return averaged
    hits, remarks = averaged.hits, averaged.remarks
    try:
        modal = estimate_modes(averaged.frf, band_hz)
    except RefusedError as error:
        return replace(averaged, remarks=(*remarks, str(error)))
    levels = homogeneity(hits, modal, band_hz, window_rate_1_s) if hits else None
    told = (levels.remark,) if levels is not None and levels.remark else ()
    remarks = (*remarks, *modal.remarks, *told)
    return replace(averaged, modal=modal, remarks=remarks, homogeneity=levels)


def average(
    sources: tuple[Source, ...],
    band_hz: tuple[float, float],
    estimator: str = "h1",
    window_rate_1_s: float = 0.0,
) -> MeasuredPose:
    """As `measure`, up to the FRF: no modes are estimated."""
    verdicts: list[Verdict] = []
    hits: list[tuple[int, Hit]] = []
    frfs: list[FrfRecord] = []
    for source in sources:
        verdict, found, records = _read_one(source, band_hz)
        hits += [(len(verdicts), hit) for hit in found]
        frfs += records
        verdicts.append(verdict)
    hits = _drop_inconsistent(hits, verdicts, band_hz)
    used = tuple(hit for _, hit in hits)
    frf, remarks = _averaged(used, frfs, band_hz, estimator)
    if frf is not None:
        frf = replace(frf, exponential_rate_1_s=window_rate_1_s)
    return MeasuredPose(tuple(verdicts), used, frf, None, remarks)


def frf_of(
    sources: tuple[Source, ...], band_hz: tuple[float, float], window_rate_1_s: float = 0.0
) -> Frf:
    """The FRF of files that were accepted before: the one that `measure` gave then."""
    from planner.frf.estimator import estimate, from_records
    from planner.recording.hits import hits_from
    from planner.recording.read import read

    hits, frfs = [], []
    for source in sources:
        records = read(source.path)
        found = [record for record in records if isinstance(record, FrfRecord)]
        frfs += found
        hits += () if found else hits_from(records, axis=source.hit)
    frf = estimate(tuple(hits), band_hz) if hits else from_records(tuple(frfs))
    return replace(frf, exponential_rate_1_s=window_rate_1_s)


def _read_one(
    source: Source, band_hz: tuple[float, float]
) -> tuple[Verdict, list[Hit], list[FrfRecord]]:
    from planner.recording.hits import hits_from
    from planner.recording.read import read
    from planner.recording.screening import ScreeningLimits, screen

    try:
        records: tuple[Record, ...] = read(source.path)
        frfs = [record for record in records if isinstance(record, FrfRecord)]
        if frfs:
            simulated = any(record.simulated for record in frfs)
            return Verdict(source, True, "", source.hit, simulated), [], frfs
        found = hits_from(records, axis=source.hit)
    except PlannerError as error:
        return Verdict(source, False, _rename(str(error), source)), [], []
    limits = replace(ScreeningLimits(), band_hz=band_hz)
    faults = [fault for hit in found for fault in screen(hit, limits)]
    remarks = tuple(f.text for f in faults if not f.refuse)
    simulated = any(hit.simulated for hit in found)
    axis = found[0].axis
    refusing = [fault for fault in faults if fault.refuse]
    if refusing:
        text = " ".join(fault.text for fault in refusing)
        return Verdict(source, False, text, axis, simulated, remarks), [], []
    hits = [replace(hit, repeat=source.repeat or hit.repeat) for hit in found]
    return Verdict(source, True, "", axis, simulated, remarks), hits, []


def _rename(text: str, source: Source) -> str:
    """Say the name that the user gave, not that of the stored copy."""
    return text.replace(str(source.path), source.name)


def _drop_inconsistent(
    hits: list[tuple[int, Hit]], verdicts: list[Verdict], band_hz: tuple[float, float]
) -> list[tuple[int, Hit]]:
    from planner.recording.screening import screen_repeats

    if not hits:
        return hits
    kept = []
    faults = screen_repeats(tuple(hit for _, hit in hits), band_hz)
    for (index, hit), found in zip(hits, faults, strict=True):
        refusing = [fault for fault in found if fault.refuse]
        if refusing:
            text = " ".join(fault.text for fault in refusing)
            verdicts[index] = replace(verdicts[index], accepted=False, reason=text)
        else:
            kept.append((index, hit))
    return kept


def _averaged(
    hits: tuple[Hit, ...], frfs: list[FrfRecord], band_hz: tuple[float, float], estimator: str
) -> tuple[Frf | None, tuple[str, ...]]:
    from planner.frf.estimator import estimate, from_records

    if not hits and not frfs:
        return None, ("No usable hit: nothing was estimated.",)
    if hits and frfs:
        raise InputError(
            "The files of this pose mix time histories and exported FRFs; import one kind only."
        )
    try:
        frf = estimate(hits, band_hz, estimator) if hits else from_records(tuple(frfs))
    except RefusedError as error:
        return None, (str(error),)
    return frf, frf.remarks
