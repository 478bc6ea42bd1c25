"""The files of one pose: read, screened each by itself and beside its repeats, judged."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path

from planner.errors import AxisNotStatedError, InputError, PlannerError
from planner.recording.channel_faults import by_good_sensors
from planner.recording.hits import hits_from, located, with_axes
from planner.recording.points import StatedPoints
from planner.recording.read import hits_in, placed_by_name, read_hits
from planner.recording.records import NOTICED, Fault, FrfRecord, Hit, PoseRow, Record
from planner.recording.repeats import screen_repeats
from planner.recording.sampling import recorded_otherwise
from planner.recording.screening import driving_point, screen
from planner.words import counted


@dataclass(frozen=True)
class Source:
    """One file and what the table of recordings says about it (None: nothing).

    `part` is which of the file's hits it is, from 1; 0: all that the file holds. `response` is the
    signed axis of an FRF's response; `from_name`: what FRFs do not say of their places, the file's
    name does. `at_s` is when, in a record of several hits; `hits` are the axes that the table lists
    for a file of several, which says itself which is which.
    """

    path: Path
    name: str
    hit: str | None = None
    repeat: int | None = None
    stated: StatedPoints = field(default_factory=StatedPoints)
    part: int = 0
    response: str | None = None
    from_name: bool = False
    at_s: float | None = None
    hits: tuple[str, ...] = ()

    @classmethod
    def of(cls, row: PoseRow) -> "Source":
        """The file that a row of the table names."""
        own = row.file, str(row.file), row.hit, row.repeat, row.stated
        return cls(*own, response=row.response, hits=row.hits)

    def read(self) -> tuple[tuple[Hit, ...], tuple[FrfRecord, ...]]:
        """Hits, or exported FRFs, that the file holds. Raises InputError or RefusedError."""
        records: Sequence[Record] = read_hits(self.path)
        frfs = [record for record in records if isinstance(record, FrfRecord)]
        if frfs and not self.part:
            given = tuple(located(self.placed(record), self.stated) for record in frfs)
            struck = {abs(hit.direction) for record in given for _, hit in record.places}
            self._check_hits({axis for k, axis in enumerate("xyz", 1) if k in struck})
            return (), given
        if self.hits:
            every = hits_from(records, None, self.stated)
            self._check_hits({hit.axis[1] for hit in every})
        if self.part:
            records = [r for r in records if not isinstance(r, FrfRecord)][self.part - 1 :][:1]
        return hits_from(records, self.hit, self.stated), ()

    def _check_hits(self, found: set[str]) -> None:
        """Raise InputError where a file was not hit along the axes that the table lists for it."""
        if self.hits and found != {axis[1] for axis in self.hits}:
            raise InputError(
                f"{self.name} was hit along {', '.join(sorted(found))}, the table lists "
                f"{', '.join(self.hits)}; correct the one that is wrong."
            )

    def placed(self, record: FrfRecord) -> FrfRecord:
        """FRFs with the places that they do not state themselves."""
        named = placed_by_name(record, self.name) if self.from_name else record
        return with_axes(named, self.hit, self.response)

    @property
    def whole_name(self) -> str:
        """The file's name, without which of its hits is meant."""
        return self.name.rpartition(" (hit ")[0] if self.part else self.name

    def parts(self) -> "tuple[Source, ...]":
        """Each of the file's hits by itself, where there are several; the file must be readable."""
        if self.part:
            return (self,)
        return tuple(
            replace(self, name=f"{self.name} (hit {k}{when(at_s)})", part=k, at_s=at_s)
            for k, at_s in enumerate(hits_in(self.path), 1)
        ) or (self,)


def in_parts(sources: tuple[Source, ...]) -> tuple[Source, ...]:
    """Sources of which each is a single hit; exported FRFs and what cannot be read as they are."""
    return tuple(part for source in sources for part in source.parts())


def when(at_s: float | None) -> str:
    """When in its record a hit was, to follow its name; nothing where it has one of its own."""
    return "" if at_s is None else f" at {at_s:.2f} s"


@dataclass(frozen=True)
class FileVerdict:
    """What became of one file: accepted, or refused for a stated reason.

    `refused_hits` are, of an accepted file of several hits, names and reasons of those refused.
    """

    source: Source
    accepted: bool
    reason: str = ""
    axis: str | None = None
    simulated: bool = False
    remarks: tuple[str, ...] = ()
    axis_missing: bool = False  # good but for that nothing says along which axis it was made
    refused_hits: tuple[tuple[str, str], ...] = ()

    @property
    def refused(self) -> tuple[tuple[str, str], ...]:
        """Name and reason of all that was refused."""
        return self.refused_hits if self.accepted else ((self.source.name, self.reason),)


@dataclass(frozen=True, eq=False)
class ScreenedFiles:
    """What the files of a pose hold, screened.

    `hits[i]` are the usable hits of file i, `agreeing` those of them that do not disagree with
    the repeats of their axis; `records` are exported FRFs.
    """

    verdicts: tuple[FileVerdict, ...]
    hits: tuple[tuple[Hit, ...], ...]
    agreeing: tuple[Hit, ...]
    records: tuple[FrfRecord, ...]


def hits_of_files(verdicts: Sequence[FileVerdict]) -> tuple[str, ...]:
    """How many hits of a file are good, where a record was cut into hits or not all are."""
    told = []
    for name, group in groupby(verdicts, key=lambda verdict: verdict.source.whole_name):
        own = list(group)
        good = sum(verdict.accepted for verdict in own)
        if any(v.source.at_s is not None for v in own) or (own[0].source.part and good < len(own)):
            told.append(f"{counted(len(own), 'hit')} in {name}: {good} good.")
    return tuple(told)


def told_of_files(verdicts: Sequence[FileVerdict]) -> tuple[str, ...]:
    """The same, and the remarks on what is good."""
    remarks = (f"{v.source.name}: {text}" for v in verdicts if v.accepted for text in v.remarks)
    return (*hits_of_files(verdicts), *remarks)


def read_files(sources: tuple[Source, ...], band_hz: tuple[float, float]) -> ScreenedFiles:
    """Read and screen the files of one pose, each hit by itself, then all beside one another."""
    each = [read_one(source, band_hz) for source in sources]
    verdicts, hits = [verdict for verdict, *_ in each], [found for _, found, _ in each]
    records = tuple(record for *_, frfs in each for record in frfs)
    if any(hits):
        _refuse_others(verdicts, hits)
        records = ()
    agreeing = _agreeing(hits, verdicts, band_hz)
    return ScreenedFiles(tuple(verdicts), tuple(hits), agreeing, records)


def _refuse_others(verdicts: list[FileVerdict], hits: list[tuple[Hit, ...]]) -> None:
    """Refuse what cannot be averaged with most hits of the pose: FRFs, and other sampling rates."""
    own = [number for number, found in enumerate(hits) for _ in found]
    said = recorded_otherwise([hit for found in hits for hit in found])
    other = {number: text for number, text in zip(own, said, strict=True) if text}
    for number, (verdict, found) in enumerate(zip(verdicts, hits, strict=True)):
        text = other.get(number, "")
        if verdict.accepted and not found:
            text = "it holds FRFs, the pose's other files time histories"
        if text:
            reason = not_averaged(verdict.source.name, text)
            verdicts[number] = replace(verdict, accepted=False, reason=reason)
            hits[number] = ()


def not_averaged(name: str, why: str) -> str:
    """What is said of a file that does not go with the others of its pose."""
    return f"{name} cannot be averaged: {why}; export all alike."


def read_one(
    source: Source, band_hz: tuple[float, float]
) -> tuple[FileVerdict, tuple[Hit, ...], list[FrfRecord]]:
    """One file, judged by itself: the verdict, its usable hits, its FRFs."""
    try:
        found, frfs = source.read()
        if frfs:
            simulated = any(record.simulated for record in frfs)
            return FileVerdict(source, True, "", source.hit, simulated), (), list(frfs)
    except PlannerError as error:
        missing = isinstance(error, AxisNotStatedError)
        text = renamed(str(error), (source,))
        return FileVerdict(source, False, text, axis_missing=missing), (), []
    heard = [by_good_sensors(hit) for hit in found]
    judged = [
        (hit, (*told, *screen(hit, band_hz), *driving_point(hit, band_hz))) for hit, told in heard
    ]
    told = tuple(f.text for _, faults in judged for f in faults if not f.refuse)
    simulated, axis = any(hit.simulated for hit in found), found[0].axis
    reasons = [_why_refused(faults) for _, faults in judged]
    if all(reasons):
        return FileVerdict(source, False, " ".join(reasons), axis, simulated, told), (), []
    hits = tuple(hit for (hit, _), reason in zip(judged, reasons, strict=True) if not reason)
    names = [part.name for part in source.parts()] if any(reasons) else reasons
    refused = tuple(one for one in zip(names, reasons, strict=True) if one[1])
    return FileVerdict(source, True, "", axis, simulated, told, False, refused), hits, []


def _why_refused(faults: Sequence[Fault]) -> str:
    """Why a hit is refused, with what its reader noticed; "" where it is good."""
    noticed = [f.text for f in faults if f.kind == NOTICED]
    reasons = [f.text for f in faults if f.refuse]
    return " ".join((*reasons, *noticed)) if reasons else ""


def renamed(text: str, sources: tuple[Source, ...]) -> str:
    """Say the names that the user gave, not those of stored copies."""
    for source in sources:
        text = text.replace(str(source.path), source.name)
    return text


def _agreeing(
    hits: list[tuple[Hit, ...]], verdicts: list[FileVerdict], band_hz: tuple[float, float]
) -> tuple[Hit, ...]:
    """Hits that do not disagree with the repeats of their axis; verdicts follow."""
    every = [(number, hit) for number, found in enumerate(hits) for hit in found]
    kept = []
    faults = screen_repeats(tuple(hit for _, hit in every), band_hz)
    for (number, hit), found in zip(every, faults, strict=True):
        verdict = verdicts[number]
        if not (text := " ".join(fault.text for fault in found if fault.refuse)):
            kept.append(hit)
        elif len(hits[number]) > 1:
            refused = *verdict.refused_hits, (verdict.source.name, text)
            verdicts[number] = replace(verdict, refused_hits=refused)
        else:
            verdicts[number] = replace(verdict, accepted=False, reason=text)
    return tuple(kept)
