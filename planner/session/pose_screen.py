"""The page that the session shows at a pose: 80 × 24, to be read from two metres."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from re import split

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.campaign.events import Proposal
from planner.dataset.screened_files import when
from planner.recording.joints import JointUnits
from planner.report.text import plain_table, with_sd
from planner.robot.place_names import axes_in_the_room
from planner.session.hit_verdicts import BAD, HitVerdict
from planner.session.screen import ScreenText, fitted
from planner.words import command, counted, short_name

WIDTH, HEIGHT = 80, 22  # of the smallest terminal, less a line for work and the cursor's
LAST = 4  # verdicts that are shown whatever they are
COLOURS = {"good": "bold green", "repeat": "bold red", "late": "bold yellow",
           "elsewhere": "yellow", "unsure": "bold yellow", "unstated": "bold yellow"}  # fmt: skip


def verdict_in_words(hit: HitVerdict, whole: bool = True, again: bool = True) -> Text:
    """What is to be done about a hit, in colour; after it why, where the `whole` is said.

    A bad one is not to be hit `again` where its axis has its hits.
    """
    do, why = remedy_first(hit.text)
    if hit.kind == "repeat" and not again:
        said = f"hit {hit.number} ({hit.axis}): not used"
        return Text(f"{said}: {why or do}" if whole else said, "dim")
    text = f"{do} {why}".strip() if whole else do
    named = f"{hit.number} ({(hit.axis or 'axis not stated') + when(hit.at_s)})"
    if hit.kind == "good":
        but = Text(f"hit {named}: good, but: {text}", style=COLOURS["late"])
        return but if text else Text(f"hit {named}: good", style=COLOURS["good"])
    said = {
        "repeat": f"REPEAT HIT {named}:", "late": f"hit {named}, late?",
        "unsure": f"hit {named}, right?", "elsewhere": f"hit {named}, not from here:",
        "unstated": f"hit {hit.number}{when(hit.at_s)}, along which axis?",
    }  # fmt: skip
    return Text(f"{said[hit.kind]} {text}", style=COLOURS[hit.kind])


@dataclass(frozen=True, eq=False)
class PosePage:
    """What the page says; expected frequencies are (count,) in Hz with their sds."""

    proposal: Proposal
    number: int  # of the measurement
    joints: JointUnits
    frame: str  # whose axes the hits are along
    per_axis: int
    hits: tuple[HitVerdict, ...]
    expected_hz: tuple[float, ...]
    expected_sd_hz: tuple[float, ...]
    folder: Path
    streams: tuple[str, ...] = ()  # of records of several hits: how many, and how many are good
    # Files that are being written or cannot be read, by name, and what is said of them.
    unfinished: tuple[tuple[str, str], ...] = ()
    progress: str = ""
    keys: str = ""
    room: tuple[str, ...] = ()  # which way +x, +y and +z point, seen from the base

    @property
    def counts(self) -> Counter[str]:
        """Good hits by axis without sign."""
        return Counter(hit.axis[-1] for hit in self.hits if hit.kind == "good" and hit.axis)

    @property
    def complete(self) -> bool:
        """Whether each axis has as many good hits as wanted."""
        return all(self.counts[axis] >= self.per_axis for axis in self.proposal.hits)

    def page(self, width: int = WIDTH, height: int = HEIGHT) -> RenderableType:
        """The renderable, of as many lines at most as there is no way to say it in fewer."""
        both = Table.grid(padding=(0, 3))
        angles, hits = self._angles(), self._hits()
        both.add_row(angles, hits)
        rows = 1 + max(angles.row_count, hits.row_count)
        title = f"Measurement {self.number}: go to pose {self.proposal.pose}"
        parts = [ScreenText([Text(title, style="bold reverse")]), *self._place(), *self._verdicts()]
        parts += [ScreenText([None, Text(text)], 5) for text in self.streams[-LAST:]]
        parts += [_unfinished(*one) for one in self.unfinished[-2:]]
        forms = dict.fromkeys((self.progress.partition(". ")[0], self.progress))
        parts += [ScreenText([None, *map(Text, forms)], 6)] if self.progress else []
        path, most = command(self.folder), WIDTH - 25
        # Of one that is too long for the line the end: folders differ there.
        end = path if len(path) <= most else f"…{path[1 - most :]}"
        waits = "waiting for hits in"
        if self.complete:
            waits = "all hits are in: [a] accepts them; more may follow in"
        where = [Text(f"{waits} {one}", "dim") for one in (end, path)]
        parts.append(ScreenText([None, *where], 4))
        parts.append(ScreenText([Text(self.keys, style="reverse")]))
        lines = fitted(parts, width, height - rows)
        return Group(lines[0], both, *lines[1:])

    def _place(self) -> list[ScreenText]:
        """Where the tool is, and what is expected there."""
        x, y, z = self.proposal.position_m
        place = f"{self.frame} at x {x:.3f} m, y {y:.3f} m, z {z:.3f} m of the base"
        each = zip(self.expected_hz, self.expected_sd_hz, strict=True)
        expected = ", ".join(with_sd(hz, sd) for hz, sd in each)
        short = ", ".join(f"{hz:.2f}" for hz in self.expected_hz)
        return [
            ScreenText([None, Text(place), Text(f"{place}; {self.proposal.reason}")], 7),
            ScreenText([Text(f"expected (Hz): {text}", "bold") for text in (short, expected)], 8),
        ]

    def _verdicts(self) -> list[ScreenText]:
        """The last hits; the very last one, and those that are not good, in any case."""
        if not self.hits:
            return []
        *before, last = _alike_once(self.hits)
        asked = [hit for hit in before[: 1 - LAST] if hit.kind != "good"]
        told = [*asked, *before[1 - LAST :]]
        parts = [
            ScreenText([*([None] if hit.kind == "good" else []), *self._forms(hit)], len(told) - i)
            for i, hit in enumerate(told)
        ]
        return [*parts, ScreenText(self._forms(last))]

    def _forms(self, hit: HitVerdict) -> list[Text]:
        again = self._again(hit)
        return [verdict_in_words(hit, whole, again) for whole in (False, True)]

    def _again(self, hit: HitVerdict) -> bool:
        """Whether a bad hit is to be made again: its axis has not its hits yet."""
        return self.counts[hit.axis[-1:]] < self.per_axis if hit.axis else True

    def _angles(self) -> Table:
        slides = any(self.joints.slides)
        angles = plain_table("joint", "stands at" if slides else "angle (°)")
        for i, value in enumerate(self.proposal.joints_deg):
            text = self.joints.text(i, value, 3) if slides else f"{value:.3f}"
            angles.add_row(self.joints.names[i], Text(text, style="bold"))
        return angles

    def _hits(self) -> Table:
        made = plain_table(f"hit along, axes of {self.frame}")
        ways: dict[str, str] = dict(zip("xyz", self.room, strict=False))
        for axis in self.proposal.hits:
            count = self.counts[axis]
            done = count >= self.per_axis
            marks = "●" * count + "○" * max(0, self.per_axis - count)
            style = "bold green" if done else "bold"
            row = Text(f"{axis}  {count}/{self.per_axis}  {marks}", style=style)
            way = f"  +{axis} {ways[axis]}" if ways else ""
            made.add_row(row.append(way, style="not bold"))
        again = [hit for hit in self.hits if hit.kind == "repeat" and self._again(hit)]
        if again:
            axes = ", ".join(dict.fromkeys(hit.axis or "?" for hit in again))
            said = f"hit again along {axes}: {counted(len(again), 'hit')} bad"
            made.add_row(Text(said, style=COLOURS["repeat"]))
        for kind, said in (("unsure", "held: right?"), ("unstated", "without an axis")):
            if count := sum(hit.kind == kind for hit in self.hits):
                made.add_row(Text(f"{count} {said}", style=COLOURS[kind]))
        if self.complete:
            made.add_row(Text("all hits are in", style="bold green"))
        return made


def _alike_once(hits: Sequence[HitVerdict]) -> list[HitVerdict]:
    """Hits of which no file says the axis are told once: the same is to be done about all."""
    alike = [hit for hit in hits if hit.kind == "unstated"]
    if len(alike) < 2:
        return list(hits)
    first, *more = alike
    numbers = ", ".join(str(hit.number) for hit in more)
    told = replace(first, text=f"{first.text} The same of {numbers}.")
    return [told if hit is first else hit for hit in hits if hit not in more]


def keys_that_do(pairs: Sequence[tuple[str, str, bool]]) -> str:
    """Keys and what they do, those only that do something now; lines of 80 columns at most."""
    lines = [""]
    for key, what, now in pairs:
        one = f"[{key}] {what}"
        if now and len(lines[-1]) + len(one) + 2 > WIDTH:
            lines.append(one)
        elif now:
            lines[-1] += f"  {one}" if lines[-1] else one
    return "\n".join(lines)


def remedy_first(text: str) -> tuple[str, str]:
    """What to do, and why, of sentences that end with what to do after a semicolon."""
    every = [sentence.rpartition("; ") for sentence in split(r"(?<=\.) (?=[A-Z])", text)]
    asked = (f"{what[0].upper()}{what[1:]}" for why, _, what in every if why and what)
    do = " ".join(dict.fromkeys(asked))
    why = " ".join(f"{why}." if why else what for why, _, what in every)
    return (do, why) if do else (text, "")


def _unfinished(name: str, said: str) -> ScreenText:
    """What is the matter with a file; what to do about it, if anything, comes first."""
    do, why = remedy_first(said)
    if not why:
        return ScreenText([None, Text(f"not whole yet: {said}", "dim")], 5)
    short = f"cannot be used: {name}: {do}"
    return ScreenText([None, Text(short, "dim"), Text(f"{short} {why}", "dim")], 5)


def page_without_hits(
    campaign: Campaign, proposal: Proposal, hits_per_pose: int, folder: Path
) -> PosePage:
    """What the screen says of a pose before anything was hit there."""
    model, robot = campaign.model, campaign.cell.robot
    q = robot.joints.internal([proposal.joints_deg])
    expected = model.predict(q)
    return PosePage(
        proposal, len(model.labelled) + 1, robot.joints, robot.config.tcp_frame,
        max(1, hits_per_pose // len(proposal.hits)), (),
        tuple(expected.frequency_hz[0].tolist()), tuple(expected.frequency_sd_hz[0].tolist()),
        folder, room=axes_in_the_room(robot, q[0]),
    )  # fmt: skip


def page_with_hits(
    page: PosePage,
    verdicts: Sequence[HitVerdict],
    waiting: Sequence[tuple[Path, str]],
    can: tuple[str, str],
    auto: bool,
    progress: str,
) -> PosePage:
    """The page with the hits that wait, the files that are not whole yet, and keys that do.

    `can`: the act that can be undone, and the one that can be redone; ""s where there is none.
    """
    names = [one.path.name for one in verdicts]
    hits = tuple(_judged(one, names) for one in verdicts)
    unfinished = tuple((short_name(path), _named(path, why)) for path, why in waiting)
    streams = _streams(verdicts)
    page = replace(page, hits=hits, unfinished=unfinished, progress=progress, streams=streams)
    return replace(page, keys="" if auto else _keys(page, can))


def _judged(verdict: HitVerdict, names: Sequence[str]) -> HitVerdict:
    said = f"answers as {verdict.came} did" if verdict.alike else f"came at {verdict.came}"
    late = f"{said}: [b] from there, [h] from here"
    text = late if verdict.kind == "late" else verdict.text
    if verdict.kind == "elsewhere":
        text = f"of {verdict.came} by recordings.csv, goes there with [a]"
    if verdict.kind == "unsure":
        text = f"{text}, or [h]: it is right"
    for name in names:
        text = text.replace(name, short_name(name))
    return replace(verdict, text=text)


def _streams(verdicts: Sequence[HitVerdict]) -> tuple[str, ...]:
    """How many hits of records of several are good."""
    kinds: dict[Path, list[str]] = {}
    for verdict in verdicts:
        if verdict.at_s is not None:
            kinds.setdefault(verdict.path, []).append(verdict.kind)
    return tuple(
        f"{counted(len(own), 'hit')} in {short_name(path)}: {own.count('good')} good"
        for path, own in kinds.items()
    )


def _keys(page: PosePage, can: tuple[str, str]) -> str:
    kinds = {hit.kind for hit in page.hits}
    late = {hit.came for hit in page.hits if hit.kind == "late"}
    usable = bool(kinds & {"good", "elsewhere"})
    return keys_that_do([
        ("a", "accept" if page.complete else "accept the good hits", usable),
        ("r", "refuse bad hits", bool(kinds & {*BAD})),
        ("R", "refuse all", bool(page.hits)),
        ("b", f"late hits are from {' and '.join(sorted(late))}", "late" in kinds),
        ("h", _right_here(kinds), bool(kinds & {"late", "unsure"})),
        ("s", f"star {page.proposal.pose}", True), ("k", "skip this pose", True),
        ("u", f"undo: {can[0]}", bool(can[0])), ("U", f"redo: {can[1]}", bool(can[1])),
        ("q", "quit", True), ("?", "help", True),
    ])  # fmt: skip


def _right_here(kinds: set[str]) -> str:
    if "late" not in kinds:
        return "hits in doubt are right"
    asked = ", hits in doubt right" if "unsure" in kinds else ""
    return f"late hits are from here{asked}"


def _named(path: Path, why: str) -> str:
    """What is the matter with a file, by its name alone."""
    name = short_name(path)
    text = why.replace(str(path), name).replace(path.name, name)
    return text if name in text else f"{name} {text}"
