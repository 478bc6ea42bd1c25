"""A verdict on each hit as soon as its file is whole, before anything is imported."""

from dataclasses import dataclass
from pathlib import Path

from planner.dataset.screened_files import Source, read_one
from planner.recording.points import PointNames, StatedPoints
from planner.recording.read import hit_count
from planner.recording.records import Hit
from planner.recording.repeats import likeness_to, screen_repeats

# As like as hits of one pose are (0.98 and more on the true robots of the tests); at poses that a
# campaign proposes one after the other it is below 0.9. Chosen between.
SAME_POSE = 0.95


@dataclass(frozen=True, eq=False)
class HitVerdict:
    """One hit that waits: `kind` is "good", "repeat" (why is in `text`) or "late".

    A late one answers as the pose before did. `axis` is "" where the file does not say it.
    """

    path: Path
    axis: str
    kind: str
    text: str = ""


class Verdicts:
    """Judges files that wait at a pose: each hit by itself, and beside the others that wait."""

    def __init__(self, band_hz: tuple[float, float], points: PointNames):
        self._band = band_hz
        self._stated = StatedPoints() if points == PointNames() else StatedPoints(names=points)
        self._read: dict[tuple, list[tuple[str, str, tuple[Hit, ...]]]] = {}
        self._before: tuple[Hit, ...] = ()
        self._now: tuple[Hit, ...] = ()

    def of(self, files: list[Path], here: frozenset[Path] = frozenset()) -> tuple[HitVerdict, ...]:
        """Verdicts in the order of the files; those in `here` are said to be of this pose."""
        found = [(path, *one) for path in files for one in self._hits_of(path)]
        hits = [hit for *_, own in found for hit in own]
        repeats = dict(zip(map(id, hits), screen_repeats(tuple(hits), self._band), strict=True))
        out = []
        for path, axis, fault, own in found:
            told = [f.text for hit in own for f in repeats[id(hit)] if f.refuse]
            fault = fault or " ".join(told)
            late = path not in here and any(self._late(hit) for hit in own)
            kind = "repeat" if fault else "late" if late else "good"
            out.append(HitVerdict(path, axis, kind, fault))
        self._now = tuple(hits)
        return tuple(out)

    def moved_on(self) -> None:
        """The hits judged last were accepted; what comes next is of another pose."""
        self._before, self._now = self._now, ()

    def forget(self) -> None:
        """There is no pose before: it was taken back."""
        self._before = ()

    def _late(self, hit: Hit) -> bool:
        return likeness_to(hit, self._before, self._band) >= SAME_POSE

    def _hits_of(self, path: Path) -> list[tuple[str, str, tuple[Hit, ...]]]:
        """Axis, fault and what is usable of each hit in a file."""
        stat = path.stat()
        key = path, stat.st_size, stat.st_mtime_ns
        if key not in self._read:
            every = Source(path, path.name, stated=self._stated).parts(hit_count(path))
            judged = [read_one(source, self._band) for source in every]
            self._read[key] = [(v.axis or "", v.reason, hits) for v, hits, _ in judged]
        return self._read[key]
