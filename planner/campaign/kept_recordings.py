"""The recordings that a campaign keeps, as files of hits and as what they give."""

import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from planner import content_hash
from planner.campaign import store
from planner.campaign.config import ModesTable
from planner.campaign.events import HitRecord
from planner.campaign.state import Measurement
from planner.dataset.screened_files import Source
from planner.dataset.store import Store
from planner.recording.points import PointNames, StatedPoints

if TYPE_CHECKING:
    from planner.dataset.hit_columns import PoseHits
    from planner.frf.frf import Frf


@dataclass
class Remembered:
    """What a process looked at already: verified files, and FRFs by what they depend on."""

    verified: set[Path] = field(default_factory=set)
    frfs: "dict[tuple, Frf]" = field(default_factory=dict)


@dataclass(frozen=True)
class FoundWhole:
    """Files that held what was imported: size, last write and change (ns), and number on the disk.

    By name. Where all of these are the same, nobody has written the file since.
    """

    marks: dict[str, tuple[int, int, int, int]]


@dataclass(frozen=True, eq=False)
class KeptRecordings:
    """Recordings by content hash in a campaign's folder, whose robot has points of these names.

    A model carries it, so that FRFs are estimated only where they are asked for.
    """

    directory: Path
    names: PointNames
    remembered: Remembered = field(default_factory=Remembered)

    def __reduce__(self):
        return KeptRecordings, (self.directory, self.names)

    def source(self, hit: HitRecord) -> Source:
        """The kept copy of a recording; InputError where it is not what was imported."""
        path = store.recording_path(self.directory, hit.sha256, hit.suffix)
        if path not in self.remembered.verified:
            self._compare(path, hit)
        said = hit.hit_point or hit.response_points or self.names != PointNames()
        stated = StatedPoints(hit.hit_point, hit.response_points, names=self.names)
        return Source(
            path, hit.file, hit.hit, hit.repeat, stated if said else StatedPoints(), hit.part,
            hit.response, hit.from_name,
        )  # fmt: skip

    def look_through(self, measurements: Iterable[Measurement], found: Store) -> None:
        """InputError where one of the accepted recordings is not what was imported.

        Files that are unchanged since they were `found` whole are not read: 3,000 take 0.2 s.
        Whoever reads one later compares its content in any case.
        """
        key = content_hash.digest("recordings found whole", str(self.directory))
        kept = found.get(key, FoundWhole)
        before, now = kept.marks if kept else {}, {}
        there = _marks(self.directory / store.RECORDINGS)
        for hit in (hit for measurement in measurements for hit in measurement.accepted):
            path = store.recording_path(self.directory, hit.sha256, hit.suffix)
            mark = there.get(path.name)
            if path.name not in now and (mark is None or mark != before.get(path.name)):
                self._compare(path, hit)
            if mark is not None:
                now[path.name] = mark
        if now != before:
            found.put(key, FoundWhole(now))

    def _compare(self, path: Path, hit: HitRecord) -> None:
        """InputError where a kept file's content is not what was imported."""
        store.read_kept(path, hit.sha256, hit.file)
        self.remembered.verified.add(path)

    def sources(self, measurement: Measurement) -> tuple[Source, ...]:
        """Of the accepted hits of a measured pose."""
        return tuple(self.source(hit) for hit in measurement.accepted)

    def frf(self, measurement: Measurement, table: ModesTable) -> "Frf":
        """The FRF matrix of a measured pose, estimated again from its recordings if need be."""
        from planner.dataset.measure import frf_of

        key = frf_key(measurement.accepted, table)
        if key not in self.remembered.frfs:
            found = frf_of(self.sources(measurement), table.band_hz, table.window_rate_1_s)
            self.remembered.frfs[key] = found
        return self.remembered.frfs[key]

    def keep_frf(self, frf: "Frf", measurement: Measurement, table: ModesTable) -> None:
        """Keep the FRF matrix of a pose that was measured just now, for this process and others."""
        from planner.dataset.measure import keep_frf

        self.remembered.frfs[frf_key(measurement.accepted, table)] = frf
        keep_frf(frf, self.sources(measurement), table.band_hz, table.window_rate_1_s)

    def hits(self, measurement: Measurement, table: ModesTable) -> "PoseHits":
        """What the accepted hits of a measured pose say, each by itself and at all points."""
        from planner.dataset.hit_columns import hits_of

        return hits_of(self.sources(measurement), table.band_hz, table.window_rate_1_s)


def frf_key(hits: tuple[HitRecord, ...], table: ModesTable) -> tuple:
    """What an FRF depends on."""
    return (*((hit.sha256, hit.part) for hit in hits), table.band_hz, table.window_rate_1_s)


def _marks(folder: Path) -> dict[str, tuple[int, int, int, int]]:
    """Of all files of a folder, as of `FoundWhole`; taken before they are read."""
    try:
        with os.scandir(folder) as entries:
            both = [(entry.name, entry.stat()) for entry in entries]
    except OSError:
        return {}
    return {name: (s.st_size, s.st_mtime_ns, s.st_ctime_ns, s.st_ino) for name, s in both}
