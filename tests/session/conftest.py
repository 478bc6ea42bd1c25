"""A session with a fake analyser that writes slowly and a scripted engineer."""

import io
import time
from dataclasses import dataclass

import pytest
from rich.console import Console

from planner.campaign.campaign import Campaign
from planner.session.watch import SessionSummary, watch


class Script:
    """Keys pressed when their moment has come: a text, or a function, of the screen so far."""

    def __init__(self, console, presses):
        self.console, self.presses = console, list(presses)

    def __call__(self, timeout_s):
        time.sleep(min(timeout_s, 0.05))
        if not self.presses:
            return None
        when, text = self.presses[0][0], self.console.export_text(clear=False)
        come = when(text) if callable(when) else when in text
        return self.presses.pop(0)[1] if come else None


@dataclass(frozen=True)
class Session:
    """How a session ended and what it showed, as it was printed and without line breaks."""

    summary: SessionSummary
    text: str

    @property
    def flat(self):
        return " ".join(self.text.split())


@pytest.fixture
def session():
    """Plays a session with keys (moment, key); without any nobody answers, `until` it is over."""

    def played(campaign, inbox, *keys, hits=9, limit_s=30, quiet_s=0.05, until=(), **more):
        played.console = console = Console(
            width=100, record=True, file=io.StringIO(), force_terminal=False
        )
        summary = watch(
            campaign, inbox, console=console, auto=not keys, hits_per_pose=hits, quiet_s=quiet_s,
            keys=Script(console, keys or (until and [(until, "q")])), limit_s=limit_s, **more,
        )  # fmt: skip
        return Session(summary, console.export_text(clear=False))

    return played


@pytest.fixture
def cell(first_pose, tmp_path):
    """A campaign with a proposal, its robot's truth, and a folder to watch."""
    (tmp_path / "inbox").mkdir()
    return Campaign(first_pose.cell), first_pose.truth, tmp_path / "inbox"


@pytest.fixture
def measured(two_poses, tmp_path):
    """A campaign of two poses, the robot's truth, and a folder to watch."""
    (tmp_path / "inbox").mkdir()
    return *two_poses, tmp_path / "inbox"


@pytest.fixture
def deliver(cell, first_pose, tmp_path):
    """Exports the hits of a pose, each file in two writes, the second of which may lack."""
    inbox = cell[2]

    def delivered(proposal, number=0, torn=False):
        made = tmp_path / f"made{number}"
        folder = first_pose.at(made, proposal.pose, proposal.joints_deg, number)
        for path in sorted((folder / "data").iterdir()):
            data, target = path.read_bytes(), inbox / path.name
            target.write_bytes(data[: len(data) // 3])
            time.sleep(0.02)
            if not torn:
                target.write_bytes(data)
        return folder

    return delivered
