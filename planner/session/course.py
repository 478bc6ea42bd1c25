"""What a session knows beside the campaign, as values: each act gives the next one."""

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from planner.campaign.events import Proposal
from planner.campaign.model import Model
from planner.campaign.state import CampaignState
from planner.session import session_text
from planner.session.hit_verdicts import HitVerdict, Part, PoseBefore
from planner.session.pose_screen import PosePage
from planner.words import significant

BAD = ("repeat", "unsure", "unstated")


@dataclass(frozen=True, eq=False)
class PoseInProgress:
    """A pose while the robot stands there: what is on the page, and which files wait.

    `since` is when (monotonic, s) the files were last seen to change; `asked` is the key that was
    pressed and acts only when pressed once more, until another is or files change. `numbers` are
    those of its hits, as they came; `typed` is the reason for a skip as far as it is typed, None
    where none is asked for; `before` is the pose measured last.
    """

    proposal: Proposal
    page: PosePage
    since: float
    before: PoseBefore = field(default_factory=PoseBefore)
    whole: tuple[Path, ...] = ()
    verdicts: tuple[HitVerdict, ...] = ()
    shown: tuple | None = None
    asked: str = ""
    numbers: dict[Part, int] = field(default_factory=dict)
    typed: str | None = None

    def paths(self, *kinds: str) -> frozenset[Path]:
        """Files of which every hit is of one of these kinds."""
        others = {verdict.path for verdict in self.verdicts if verdict.kind not in kinds}
        return frozenset(verdict.path for verdict in self.verdicts) - others

    def any_of(self, *kinds: str) -> frozenset[Path]:
        """Files with a hit of one of these kinds."""
        return frozenset(verdict.path for verdict in self.verdicts if verdict.kind in kinds)

    def reasons(self, files: Collection[Path]) -> dict[Path, str]:
        """What is wrong with the hits in these files, where something is."""
        return {
            path: " ".join(v.text for v in self.verdicts if v.path == path and v.kind in BAD)
            for path in files
        }

    @property
    def late_by_pose(self) -> dict[str, tuple[Path, ...]]:
        """Files that are of another pose, until the engineer says otherwise, by that pose."""
        late = [verdict for verdict in self.verdicts if verdict.kind == "late"]
        return {
            pose: tuple(dict.fromkeys(v.path for v in late if v.came == pose))
            for pose in dict.fromkeys(v.came for v in late)
        }


@dataclass(frozen=True, eq=False)
class Course:
    """How far a session is. All else is the campaign's, so that it may end anywhere.

    `asking` is the pose whose question is on the page; `here` are files that looked unsure and are
    right; `left` is the pose where the robot was before; `aside`, by content and row, what could
    not be imported without the engineer; `history` the overall sd (%) after each measurement;
    `announced`: the target was.
    """

    visit: PoseInProgress | None = None
    asking: str = ""
    left: str = ""
    here: frozenset[Path] = frozenset()
    aside: frozenset[tuple[str, str]] = frozenset()
    measured: tuple[str, ...] = ()
    history: tuple[float, ...] = ()
    progress: str = ""
    announced: bool = False
    stop: str = ""
    ended: str = ""

    def undone(self, state: CampaignState) -> "Course":
        """After an act was taken back: what was measured may be gone with it."""
        kept = [k for k, pose in enumerate(self.measured) if pose in state.measurements]
        measured = tuple(self.measured[k] for k in kept)
        history = tuple(self.history[k] for k in kept)
        return replace(
            self, measured=measured, history=history, progress="", here=frozenset()
        )  # fmt: skip

    def after(
        self, pose: str, model: Model, state: CampaignState, seconds: float, auto: bool
    ) -> "Course":
        """After one more measurement, `seconds` into the session."""
        stop = model.cell.config.stop
        measured = (*self.measured, pose)
        overall = float(np.sqrt(np.mean(model.frequency_sd_percent**2)))
        history = (*self.history, overall)
        earlier = max(0, len(state.used) - len(history))  # by sessions before this one
        left = session_text.progress_line(
            list(history), stop.frequency_sd_percent, seconds / len(measured),
            stop.measurements_min - earlier,
        )  # fmt: skip
        ends = self.stop
        if model.done and not self.announced:
            ends = "target reached" if auto else ""
        if len(state.used) >= stop.measurements_max:
            ends = "as many measurements as campaign.toml allows"
        return replace(
            self, measured=measured, history=history, announced=self.announced or model.done,
            progress=f"frequencies known to ±{significant(overall)} %; {left}", stop=ends,
        )  # fmt: skip
