"""The recordings that a campaign keeps, as files of hits and as what they give."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from planner import content_hash, file_content
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


@dataclass(frozen=True, eq=False)
class KeptRecordings:
    """Recordings by content hash in a campaign's folder, whose robot has points of these names.

    A model carries it, so that FRFs are estimated only where they are asked for.
    """

    directory: Path
    names: PointNames

    def source(self, hit: HitRecord) -> Source:
        """The kept copy of a recording; InputError where it is not what was imported."""
        path = self._checked(hit)
        said = hit.hit_point or hit.response_points or self.names != PointNames()
        stated = StatedPoints(hit.hit_point, hit.response_points, names=self.names)
        return Source(
            path, hit.file, hit.hit, hit.repeat, stated if said else StatedPoints(), hit.part,
            hit.response, hit.from_name,
        )  # fmt: skip

    def _checked(self, hit: HitRecord) -> Path:
        path = store.recording_path(self.directory, hit.sha256, hit.suffix)
        store.check_kept(path, hit.sha256, hit.file)
        return path

    def look_through(self, measurements: Iterable[Measurement], found: Store) -> None:
        """InputError where one of the accepted recordings is not what was imported.

        Files that nobody has written since they were `found` whole are not read again.
        """
        key = content_hash.digest("recordings found whole", str(self.directory))
        before: dict[Path, file_content.Mark] = found.get(key, dict) or {}
        for path, mark in before.items():
            file_content.remember(path, mark, path.name[:64])
        hits = (hit for measurement in measurements for hit in measurement.accepted)
        now = {path: file_content.mark(path) for path in dict.fromkeys(map(self._checked, hits))}
        if now != before:
            found.put(key, now)

    def sources(self, measurement: Measurement) -> tuple[Source, ...]:
        """Of the accepted hits of a measured pose."""
        return tuple(self.source(hit) for hit in measurement.accepted)

    def frf(self, measurement: Measurement, table: ModesTable) -> "Frf":
        """The FRF matrix of a measured pose, estimated again from its recordings if need be."""
        from planner.dataset.measure import frf_of

        return frf_of(self.sources(measurement), table.band_hz, table.window_rate_1_s)

    def keep_frf(self, frf: "Frf", measurement: Measurement, table: ModesTable) -> None:
        """Keep the FRF matrix of a pose that was measured just now."""
        from planner.dataset.measure import keep_frf

        keep_frf(frf, self.sources(measurement), table.band_hz, table.window_rate_1_s)

    def hits(self, measurement: Measurement, table: ModesTable) -> "PoseHits":
        """What the accepted hits of a measured pose say, each by itself and at all points."""
        from planner.dataset.hit_columns import hits_of

        return hits_of(self.sources(measurement), table.band_hz, table.window_rate_1_s)
