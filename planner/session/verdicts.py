"""A verdict on each hit as soon as its file is whole, before anything is imported."""

from dataclasses import dataclass
from pathlib import Path

from planner.dataset.screened_files import Source, Verdict, read_one
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

    The `text` of a good one says what is to be known of it, if anything is. A late one answers as
    the pose before did. `axis` is "" where the file does not say it; `hits` is what of it can be
    used.
    """

    path: Path
    axis: str
    kind: str
    text: str = ""
    hits: tuple[Hit, ...] = ()


@dataclass(frozen=True, eq=False)
class PoseBefore:
    """The pose measured last in a session and what was hit there; "" before the first."""

    pose: str = ""
    hits: tuple[Hit, ...] = ()


class Verdicts:
    """Judges files that wait at a pose; it keeps what it read, and nothing else."""

    def __init__(self, band_hz: tuple[float, float], points: PointNames):
        self._band = band_hz
        self._stated = StatedPoints() if points == PointNames() else StatedPoints(names=points)
        self._read: dict[tuple, list[tuple[Verdict, tuple[Hit, ...]]]] = {}

    def of(
        self,
        files: list[Path],
        before: tuple[Hit, ...] = (),
        here: frozenset[Path] = frozenset(),
    ) -> tuple[HitVerdict, ...]:
        """Each hit by itself and beside the others that wait, in the order of the files.

        Hits like those of the pose `before` are late, unless their files are said to be of `here`.
        """
        found = [(path, *one) for path in files for one in self._hits_of(path)]
        hits = [hit for *_, own in found for hit in own]
        repeats = dict(zip(map(id, hits), screen_repeats(tuple(hits), self._band), strict=True))
        out = []
        for path, verdict, own in found:
            told = [f.text for hit in own for f in repeats[id(hit)] if f.refuse]
            fault = verdict.reason or " ".join(told)
            late = path not in here and any(
                likeness_to(hit, before, self._band) >= SAME_POSE for hit in own
            )
            kind = "repeat" if fault else "late" if late else "good"
            text = fault or " ".join(verdict.remarks)
            out.append(HitVerdict(path, verdict.axis or "", kind, text, own))
        return tuple(out)

    def _hits_of(self, path: Path) -> list[tuple[Verdict, tuple[Hit, ...]]]:
        """The verdict on each hit in a file by itself, and what of it is usable."""
        stat = path.stat()
        key = path, stat.st_size, stat.st_mtime_ns
        if key not in self._read:
            every = Source(path, path.name, stated=self._stated).parts(hit_count(path))
            judged = [read_one(source, self._band) for source in every]
            self._read[key] = [(verdict, hits) for verdict, hits, _ in judged]
        return self._read[key]
