"""The page that the session shows at a pose: 80 × 24, to be read from two metres."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from planner.campaign.events import Proposal
from planner.recording.joints import JointUnits

WIDTH = 80  # columns of the smallest terminal
LAST = 4  # verdicts that are shown
COLOURS = {"good": "bold green", "repeat": "bold red", "late": "bold yellow"}


@dataclass(frozen=True)
class JudgedHit:
    """A hit that waits: its number at this pose, axis, kind ("good", "repeat", "late"), why."""

    number: int
    axis: str
    kind: str
    text: str

    @property
    def line(self) -> Text:
        """One line, in colour."""
        axis = self.axis or "axis not stated"
        if self.kind == "good":
            style = COLOURS["late"] if self.text else COLOURS["good"]
            but = f", but – {self.text}" if self.text else ""
            return Text(f"hit {self.number} ({axis}): good{but}", style=style)
        said = "late?" if self.kind == "late" else f"REPEAT HIT {self.number}"
        return Text(f"hit {self.number} ({axis}): {said} – {self.text}", style=COLOURS[self.kind])


@dataclass(frozen=True, eq=False)
class PosePage:
    """What the page says; expected frequencies are (count,) in Hz with their sds."""

    proposal: Proposal
    number: int  # of the measurement
    joints: JointUnits
    frame: str  # whose axes the hits are along
    per_axis: int
    hits: tuple[JudgedHit, ...]
    expected_hz: tuple[float, ...]
    expected_sd_hz: tuple[float, ...]
    folder: Path
    unfinished: tuple[str, ...] = ()  # files that are being written or cannot be read, why
    progress: str = ""
    keys: str = ""
    pose_before: str = ""

    @property
    def counts(self) -> Counter[str]:
        """Good hits by axis without sign."""
        return Counter(hit.axis[-1] for hit in self.hits if hit.kind == "good" and hit.axis)

    @property
    def complete(self) -> bool:
        """Whether each axis has as many good hits as wanted."""
        return all(self.counts[axis] >= self.per_axis for axis in self.proposal.hits)

    def page(self) -> RenderableType:
        """The renderable."""
        both = Table.grid(padding=(0, 3))
        both.add_row(self._angles(), self._hits())
        each = zip(self.expected_hz, self.expected_sd_hz, strict=True)
        expected = ", ".join(f"{hz:.2f} ± {sd:.2f}" for hz, sd in each)
        x, y, z = self.proposal.position_m
        title = f"Measurement {self.number}: go to pose {self.proposal.pose}"
        parts: list[RenderableType] = [Text(title, style="bold reverse"), both]
        parts.append(_cut(f"tool at x {x:.3f} m, y {y:.3f} m, z {z:.3f} m; {self.proposal.reason}"))
        parts.append(_cut(f"expected (Hz): {expected}", "bold"))
        parts += [_cropped(hit.line) for hit in self.hits[-LAST:-1]]
        parts += [hit.line for hit in self.hits[-1:]]  # in full: it ends with what to do
        parts += [_cut(f"not whole yet: {why}", "dim") for why in self.unfinished[-2:]]
        if self.progress:
            parts.append(_cut(self.progress))
        parts.append(_cut(f"waiting for hits in {_end(str(self.folder))}", "dim"))
        parts.append(Text(self.keys, style="reverse"))
        return Group(*parts)

    def _angles(self) -> Table:
        angles = Table(box=None, header_style="bold", pad_edge=False)
        angles.add_column("joint")
        slides = any(self.joints.slides)
        angles.add_column("stands at" if slides else "angle (°)", justify="right")
        for i, value in enumerate(self.proposal.joints_deg):
            text = self.joints.text(i, value, 3) if slides else f"{value:.3f}"
            angles.add_row(self.joints.names[i], Text(text, style="bold"))
        return angles

    def _hits(self) -> Table:
        made = Table(box=None, header_style="bold", pad_edge=False)
        made.add_column(f"hit along, axes of {self.frame}")
        for axis in self.proposal.hits:
            count = self.counts[axis]
            done = count >= self.per_axis
            marks = "●" * count + "○" * max(0, self.per_axis - count)
            style = "bold green" if done else "bold"
            made.add_row(Text(f"{axis}  {count}/{self.per_axis}  {marks}", style=style))
        again = [hit for hit in self.hits if hit.kind == "repeat"]
        if again:
            axes = ", ".join(dict.fromkeys(hit.axis or "?" for hit in again))
            made.add_row(Text(f"{len(again)} to be repeated ({axes})", style=COLOURS["repeat"]))
        if self.complete:
            made.add_row(Text("all hits are in", style="bold green"))
        return made


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


def _end(path: str) -> str:
    """The end of a path that is too long for the line: folders differ there."""
    most = WIDTH - 25
    return path if len(path) <= most else f"…{path[1 - most :]}"


def _cut(text: str, style: str = "") -> Text:
    return _cropped(Text(text, style=style))


def _cropped(text: Text) -> Text:
    text.no_wrap, text.overflow = True, "ellipsis"
    return text
