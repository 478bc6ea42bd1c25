"""Answers of the acts on a campaign: `new`, `undo`, `withdraw`, `skip`, `confirm`."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
from rich.console import Group
from rich.table import Table
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.campaign.events import Entry
from planner.campaign.from_urdf import Guess, Guessed
from planner.campaign.undo import in_words
from planner.check.description import CheckRemark
from planner.report.answer import Answer, Done
from planner.report.text import command_line, table
from planner.words import command


@dataclass(frozen=True)
class NewCampaign(Answer):
    """Answer of `new`: `campaign` is the folder, `modes` how many of them are modelled.

    `findings` are what a check of the robot warns of. Of one begun from a URDF alone `guessed` is
    all that was guessed, and `told` what to know of that.
    """

    campaign: str
    robot: str
    joints: tuple[str, ...]
    modes: int
    acquisition: str
    remarks: tuple[str, ...]
    findings: tuple[CheckRemark, ...] = ()
    joint_units: Any = msgspec.UNSET
    guessed: tuple[Guess, ...] = ()
    told: tuple[str, ...] = ()

    @classmethod
    def of(cls, campaign: Campaign, guessed: Guessed | None = None) -> "NewCampaign":
        """Of a campaign that was just started, from a URDF alone where it was `guessed`."""
        cell = campaign.cell
        config, robot, said = cell.config, cell.robot, tuple(cell.remarks)
        warned = (r for r in cell.examined.remarks if r.severity == "warning")
        return cls(
            str(campaign.directory), robot.name, tuple(robot.joint_names), config.modes.count,
            config.acquisition.name, said, tuple(r for r in warned if r.what not in said),
            robot.joints.declared, guessed.guesses if guessed else (),
            guessed.remarks if guessed else (),
        )  # fmt: skip

    def text(self) -> Group:
        """What was started, and how it goes on."""
        warned = (f"Check: {finding.sentence}" for finding in self.findings)
        remarks = "".join(f"{remark}\n" for remark in (*warned, *self.remarks, *self.told))
        said = (
            f"Campaign in {self.campaign}: robot {self.robot}, "
            f"{self.modes} modes, chosen by {self.acquisition}.\n"
            f"{remarks}".rstrip()
        )
        parts = [Text(said), command_line("Next: ", "planner", "next", self.campaign)]
        return Group(*([_guesses(self.guessed)] if self.guessed else []), *parts)


def _guesses(guessed: tuple[Guess, ...]) -> Table:
    """What was guessed; dampers follow their springs, and stand in the JSON alone."""
    made = table("guessed", "what", "value", "known to (1 sd)")
    for guess in guessed:
        if not guess.what.startswith("damping"):
            known = isinstance(guess.value, int | float)
            value = f"{guess.value:.4g} {guess.unit}" if known else str(guess.value)
            made.add_row(guess.what, Text(value.strip()), _known_to(guess))
    return made


def _known_to(guess: Guess) -> str:
    """How well a guess is known: springs by a factor, as their priors are of logarithms."""
    if guess.sd is None or not isinstance(guess.value, int | float):
        return "–"
    if guess.what.startswith("stiffness"):
        return f"a factor of {1 + guess.sd / guess.value:.2g}"
    return f"± {guess.sd:.3g}"


@dataclass(frozen=True)
class ExampleFolder(Answer):
    """Answer of `new --example`: the folder, and the files in it to begin with."""

    example: str
    robot: str
    campaign: str
    files: tuple[str, ...]

    def text(self) -> Group:
        """What to do with it."""
        toml, folder = self.robot, self.example
        cell = f"{folder}/cell"
        said = (
            f"An example of one's own to change is in {folder}: robot/robot.toml, "
            f"robot/robot.urdf and campaign.toml, with comments; ask_tell.py is a script."
        )
        new = "planner", "new", cell, "--robot", toml, "--campaign", self.campaign
        commands = ("planner", "check", toml), new, ("planner", "next", cell)
        return Group(Text(said), *(command_line("  ", *words) for words in commands))


def undone(entries: Sequence[Entry]) -> Done:
    """Answer of `undo`: the log's entry that was taken back, and those that went with it."""
    keys, words = _told(entries, "undone")
    return Done(keys, f"Took back entry {keys['undone']} of the log ({words}).")


def redone(entries: Sequence[Entry]) -> Done:
    """Answer of `redo`: the log's entry that holds again, and those that came with it."""
    keys, words = _told(entries, "redone")
    return Done(keys, f"Entry {keys['redone']} of the log holds again ({words}).")


def _told(entries: Sequence[Entry], what: str) -> tuple[dict[str, Any], str]:
    """Number, kind and words of the first entry, the others' words; and all words in one."""
    entry, *others = entries
    kind, said = msgspec.to_builtins(entry.event)["kind"], [in_words(other) for other in others]
    follow = f"; with it: {', '.join(said)}" if said else ""
    keys = {what: entry.seq, "event": kind, "what": in_words(entry), "with_it": said}
    return keys, f"{in_words(entry)}{follow}"


def withdrawn(directory: Path, pose: str, reason: str) -> Done:
    """Answer of `withdraw`."""
    again = command("planner", "confirm", directory, pose)
    anew = command("planner", "import", directory, "FOLDER", "--pose", f"{pose}b")
    return Done(
        {"withdrawn": pose, "reason": reason},
        f"Pose {pose} is set aside; its recordings are kept. To use them again: {again}. Corrected "
        f"or new ones take another name: {anew}.",
    )
