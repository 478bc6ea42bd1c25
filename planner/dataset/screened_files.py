"""The files of one pose: read, screened each by itself and beside its repeats, judged."""

from dataclasses import dataclass, field, replace
from pathlib import Path

from planner.errors import PlannerError
from planner.recording.points import StatedPoints
from planner.recording.records import FrfRecord, Hit, PoseRow, Record


@dataclass(frozen=True)
class Source:
    """One file and what the table of recordings says about it (None: nothing)."""

    path: Path
    name: str
    hit: str | None = None
    repeat: int | None = None
    stated: StatedPoints = field(default_factory=StatedPoints)

    @classmethod
    def of(cls, row: PoseRow) -> "Source":
        """The file that a row of the table names."""
        assert row.file is not None
        return cls(row.file, str(row.file), row.hit, row.repeat, row.stated)

    def read(self) -> tuple[tuple[Hit, ...], tuple[FrfRecord, ...]]:
        """Hits, or exported FRFs, that the file holds. Raises InputError or RefusedError."""
        from planner.recording.hits import hits_from, located
        from planner.recording.read import read

        records: tuple[Record, ...] = read(self.path)
        frfs = [record for record in records if isinstance(record, FrfRecord)]
        if frfs:
            return (), tuple(located(record, self.stated) for record in frfs)
        return hits_from(records, self.hit, self.stated), ()


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
class ScreenedFiles:
    """What the files of a pose hold, screened.

    `hits[i]` are the usable hits of file i, `agreeing` those of them that do not disagree with
    the repeats of their axis; `records` are exported FRFs.
    """

    verdicts: tuple[Verdict, ...]
    hits: tuple[tuple[Hit, ...], ...]
    agreeing: tuple[Hit, ...]
    records: tuple[FrfRecord, ...]


def read_files(sources: tuple[Source, ...], band_hz: tuple[float, float]) -> ScreenedFiles:
    """Read and screen the files of one pose, each hit by itself, then all beside one another."""
    verdicts: list[Verdict] = []
    hits: list[tuple[Hit, ...]] = []
    records: list[FrfRecord] = []
    for source in sources:
        verdict, found, frfs = _read_one(source, band_hz)
        verdicts.append(verdict)
        hits.append(found)
        records += frfs
    agreeing = _agreeing(hits, verdicts, band_hz)
    return ScreenedFiles(tuple(verdicts), tuple(hits), agreeing, tuple(records))


def _read_one(
    source: Source, band_hz: tuple[float, float]
) -> tuple[Verdict, tuple[Hit, ...], list[FrfRecord]]:
    from planner.recording.screening import ScreeningLimits, screen

    try:
        found, frfs = source.read()
        if frfs:
            simulated = any(record.simulated for record in frfs)
            return Verdict(source, True, "", source.hit, simulated), (), list(frfs)
    except PlannerError as error:
        return Verdict(source, False, renamed(str(error), (source,))), (), []
    limits = replace(ScreeningLimits(), band_hz=band_hz)
    faults = [fault for hit in found for fault in screen(hit, limits)]
    remarks = tuple(f.text for f in faults if not f.refuse)
    simulated, axis = any(hit.simulated for hit in found), found[0].axis
    refusing = [fault for fault in faults if fault.refuse]
    if refusing:
        text = " ".join(fault.text for fault in refusing)
        return Verdict(source, False, text, axis, simulated, remarks), (), []
    hits = tuple(replace(hit, repeat=source.repeat or hit.repeat) for hit in found)
    return Verdict(source, True, "", axis, simulated, remarks), hits, []


def renamed(text: str, sources: tuple[Source, ...]) -> str:
    """Say the names that the user gave, not those of stored copies."""
    for source in sources:
        text = text.replace(str(source.path), source.name)
    return text


def _agreeing(
    hits: list[tuple[Hit, ...]], verdicts: list[Verdict], band_hz: tuple[float, float]
) -> tuple[Hit, ...]:
    """Hits that do not disagree with the repeats of their axis; verdicts follow."""
    from planner.recording.screening import screen_repeats

    every = [(number, hit) for number, found in enumerate(hits) for hit in found]
    kept = []
    faults = screen_repeats(tuple(hit for _, hit in every), band_hz)
    for (number, hit), found in zip(every, faults, strict=True):
        refusing = [fault for fault in found if fault.refuse]
        if refusing:
            text = " ".join(fault.text for fault in refusing)
            verdicts[number] = replace(verdicts[number], accepted=False, reason=text)
        else:
            kept.append(hit)
    return tuple(kept)
