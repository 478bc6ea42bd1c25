"""A verdict on each hit as soon as its file is whole, before anything is imported."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from planner.dataset.screened_files import FileVerdict, Source, not_averaged, read_one, when
from planner.recording.force_levels import far_below
from planner.recording.points import PointNames, StatedPoints
from planner.recording.read import version
from planner.recording.records import Hit
from planner.recording.repeats import Doubt, answered_as, doubts, other_size, screen_repeats
from planner.recording.sampling import recorded_otherwise
from planner.recording.screening import driving_point
from planner.session.inbox import FolderTable
from planner.words import significant

BAD = ("repeat", "unsure", "unstated")  # kinds of verdicts on which something is to be done
Part = tuple[Path, int]  # which of a file's hits, from 1


@dataclass(frozen=True, eq=False)
class HitVerdict:
    """One hit that waits: `kind` is "good", "repeat", "unstated", "late", "elsewhere" or "unsure".

    Of one to be repeated `text` says why; nothing says along which axis an unstated one is. The
    `text` of a good one says what is to be known of it, if anything is. A late one answers as
    another pose did, the one before as a rule, or was shown there: `came` names that pose. One
    from elsewhere is of that pose by its table, and imported there. An
    unsure one contradicts others, and nothing tells which is right. `axis`
    is "" where the file does not say it; `hits` is what of it can be used. `number` counts hits as
    they came to the pose. `weak`: it is to be repeated only because it is; an import would take it.
    """

    path: Path
    axis: str
    kind: str
    text: str = ""
    hits: tuple[Hit, ...] = ()
    number: int = 0
    weak: bool = False
    at_s: float | None = None
    came: str = ""
    alike: bool = False  # a late one answers as what was hit there before

    @property
    def name(self) -> str:
        """As other verdicts speak of it."""
        return f"hit {self.number} ({self.path.name}{when(self.at_s)})"


Before = Mapping[str, tuple[Hit, ...]]  # hits of the pose hit last before this one, if any


class Verdicts:
    """Judges files that wait at a pose; it keeps what it read, and nothing else."""

    def __init__(self, band_hz: tuple[float, float], points: PointNames, table: FolderTable):
        self._band = band_hz
        self._stated = StatedPoints(names=points)
        self.table = table
        self._read: dict[tuple, list[tuple[FileVerdict, tuple[Hit, ...]]]] = {}

    def unfit(self, path: Path) -> str:
        """Why no hit can be made of a file that reads; empty: it can."""
        return " ".join(v.reason for v, _ in self._hits_of(path) if not (v.accepted or v.axis))

    def numbered(self, files: Sequence[Path], numbers: Mapping[Part, int]) -> dict[Part, int]:
        """Numbers of the hits in files: those they have, and further ones as they came."""
        known = dict(numbers)
        for path in files:
            for part in range(1, len(self._hits_of(path)) + 1):
                known.setdefault((path, part), len(known) + 1)
        return known

    def of(
        self,
        files: Sequence[Path],
        before: Before,
        here: frozenset[Path],
        numbers: Mapping[Part, int],
        shown: Mapping[Path, str],
        pose: str,
    ) -> tuple[HitVerdict, ...]:
        """Each hit by itself and beside the others that wait, by number.

        Files that were `shown` at another pose than this one are late, and new ones with hits like
        those of the pose `before`, or like late ones. Hits that contradict others are unsure unless
        their files are said to be right, of `here`. What is late stands beside no other hit.
        """
        found = [
            (_alone(path, *one, numbers[path, part]), len(parts))
            for path in files for parts in (self._hits_of(path),)
            for part, one in enumerate(parts, 1)
        ]  # fmt: skip
        found.sort(key=lambda one: one[0].number)
        late = self._late([verdict for verdict, _ in found], before, shown, pose)
        found = [one for one in found if one[0].path not in {v.path for v in late}]
        judged = self._beside_repeats([verdict for verdict, _ in found])
        usable = [hit for verdict in judged if verdict.kind == "good" for hit in verdict.hits]
        others = [hit for hits in before.values() for hit in hits]
        judged = [
            _weak(verdict, [*usable, *others]) if count == 1 else verdict
            for verdict, (_, count) in zip(judged, found, strict=True)
        ]
        asked = self._unsure(judged, here)
        told = [*(asked.get(verdict.number, verdict) for verdict in judged), *late]
        return tuple(sorted(told, key=lambda verdict: verdict.number))

    def _beside_repeats(self, judged: list[HitVerdict]) -> list[HitVerdict]:
        """With which do not go with the others, and what a vote among three and more says."""
        hits = [hit for verdict in judged for hit in verdict.hits]
        rates = dict(zip(map(id, hits), recorded_otherwise(hits), strict=True))
        repeats = dict(zip(map(id, hits), screen_repeats(tuple(hits), self._band), strict=True))
        out = []
        for verdict in judged:
            otherwise = dict.fromkeys(text for hit in verdict.hits if (text := rates[id(hit)]))
            told = [not_averaged(verdict.path.name, text) for text in otherwise]
            told += [f.text for hit in verdict.hits for f in repeats[id(hit)] if f.refuse]
            told = told if verdict.kind == "good" else []
            out.append(replace(verdict, kind="repeat", text=" ".join(told)) if told else verdict)
        return out

    def _late(
        self, every: list[HitVerdict], before: Before, shown: Mapping[Path, str], pose: str
    ) -> list[HitVerdict]:
        """The hits in files that are of another pose: shown there, or, where new, answered so."""
        came = {path: at for path, at in shown.items() if at != pose}
        waiting = dict(before)
        for verdict in every:
            if at := came.get(verdict.path):
                waiting[at] = (*waiting.get(at, ()), *verdict.hits)
        for verdict in every:
            own = tuple(h for v in every if v.path not in (verdict.path, *came) for h in v.hits)
            if verdict.path not in shown and (at := self._alike(verdict, waiting, own)):
                came[verdict.path] = at
        late = [(v, at) for v in every if (at := came.get(v.path))]
        alike = [bool(self._alike(v, {at: before.get(at, ())}, ())) for v, at in late]
        kinds = ["elsewhere" if self.table.row(v.path) else "late" for v, _ in late]
        return [
            replace(v, kind=kind, text="", came=at, alike=like)
            for (v, at), kind, like in zip(late, kinds, alike, strict=True)
        ]

    def _alike(
        self, verdict: HitVerdict, hits: Mapping[str, tuple[Hit, ...]], own: tuple[Hit, ...]
    ) -> str:
        """The pose of which hits are answered like one of these, and not like `own`; "": none."""
        for pose, theirs in hits.items():
            # Of one pose it is 0.98 and more on the true robots of the tests; of poses that a
            # campaign proposes one after the other below 0.9.
            if any(answered_as(hit, theirs, own, self._band) for hit in verdict.hits):
                return pose
        return ""

    def _unsure(self, judged: Sequence[HitVerdict], here: frozenset[Path]) -> dict[int, HitVerdict]:
        """By number, good hits that contradict others or are answered against their direction."""
        good = [(v, hit) for v in judged if v.kind == "good" for hit in v.hits]
        found = doubts(tuple(hit for _, hit in good), self._band) if len(good) > 1 else ()
        asked = {}
        for (verdict, hit), doubt in zip(good, found, strict=False):
            if verdict.path in here:
                continue
            if doubt is not None:
                others = " and ".join(good[j][0].name for j in doubt.others)
                text = _asked(hit, doubt, others)
            else:
                text = self._turned(hit, good)
            if text:
                asked[verdict.number] = replace(verdict, kind="unsure", text=text)
        return asked

    def _turned(self, hit: Hit, good: Sequence[tuple[HitVerdict, Hit]]) -> str:
        """What is said of the one hit along an axis that is answered against its direction."""
        if not driving_point(hit, self._band):
            return ""
        same = [one for one, own in good if own.axis_index == hit.axis_index]
        right = [one for one, own in good if not driving_point(own, self._band)]
        if len(same) > 1 or not right:
            return ""
        return (
            f"the tool answers it against its direction, and {right[0].name} not: hit along "
            f"{hit.axis[-1]} once more"
        )

    def _hits_of(self, path: Path) -> list[tuple[FileVerdict, tuple[Hit, ...]]]:
        """The verdict on each hit in a file by itself, and what of it is usable."""
        row = self.table.row(path)
        key = path, version(path), str(row)
        if key not in self._read:
            source = Source(path, path.name, stated=self._stated)
            if row is not None:
                source = replace(Source.of(row), path=path, name=path.name)
            judged = [read_one(one, self._band) for one in source.parts()]
            self._read[key] = [(verdict, hits) for verdict, hits, _ in judged]
        return self._read[key]


def _alone(path: Path, found: FileVerdict, own: tuple[Hit, ...], number: int) -> HitVerdict:
    kind = "unstated" if found.axis_missing else "repeat" if found.reason else "good"
    text = found.reason or " ".join(found.remarks)
    return HitVerdict(path, found.axis or "", kind, text, own, number, at_s=found.source.at_s)


def _weak(verdict: HitVerdict, usable: list[Hit]) -> HitVerdict:
    """The verdict on a good hit, where it is far weaker than the others of its axis."""
    if verdict.kind != "good" or not verdict.hits:
        return verdict
    own = verdict.hits[0]
    usual = far_below(own, [hit for hit in usable if hit is not own])
    if usual is None:
        return verdict
    text = (
        f"{significant(own.pulse.peak_n, 3)} N, others {significant(usual, 3)} N (median) along "
        f"{own.axis[-1]}; hit harder, or as softly once more if a level of its own is meant."
    )
    return replace(verdict, kind="repeat", text=text, weak=True)


def _asked(hit: Hit, doubt: Doubt, others: str) -> str:
    again = f"hit along {hit.axis[-1]} once more, that tells which is right"
    if doubt.size:
        return f"{other_size(doubt.size, others)} {again.capitalize()}"
    if doubt.along:
        return f"answers as {others} along {doubt.along} did: {again}"
    return f"disagrees with {others} (correlation {doubt.likeness:.2f}): {again}"
