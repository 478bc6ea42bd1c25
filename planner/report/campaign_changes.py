"""Answers of the acts on a campaign: `new`, `undo`, `withdraw`, `skip`, `confirm`."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Group
from rich.table import Table
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.campaign.events import Entry
from planner.campaign.from_urdf import Guess, Guessed
from planner.campaign.undo import in_words
from planner.report.answer import Done
from planner.report.text import command_line, table
from planner.words import command


def begun(started: Campaign, guessed: Guessed | None = None) -> Done:
    """Answer of `new`: a campaign that was just started, from a URDF alone where `guessed`.

    "findings" are what a check of the robot warns of and the campaign itself does not, "guessed"
    is all that was, "told" what to know of that.
    """
    cell, config, folder = started.cell, started.cell.config, started.directory
    joints, guesses = cell.robot.joints, guessed.guesses if guessed else ()
    warned = (r for r in cell.examined.remarks if r.severity == "warning")
    findings = [r for r in warned if r.what not in cell.remarks]
    told = guessed.remarks if guessed else ()
    keys = {
        "campaign": str(folder), "robot": cell.robot.name, "joints": joints.names,
        "modes": config.modes.count, "acquisition": config.acquisition.name,
        "remarks": cell.remarks, "findings": findings, "guessed": guesses, "told": told,
        "joint_units": joints.declared,
    }  # fmt: skip
    said = (
        f"Campaign in {folder}: robot {cell.robot.name}, {config.modes.count} modes, chosen by "
        f"{config.acquisition.name}."
    )
    lines = [said, *(f"Check: {one.sentence}" for one in findings), *cell.remarks, *told]
    parts = [_guesses(guesses)] if guesses else []
    then = command_line("Next: ", "planner", "next", folder)
    return Done(keys, Group(*parts, Text("\n".join(lines).rstrip()), then))


def _guesses(guessed: tuple[Guess, ...]) -> Table:
    """What was guessed; dampers follow their springs, and stand in the JSON alone."""
    made = table("guessed", "what", "value", "known to (1 sd)")
    for guess in guessed:
        if guess.what.startswith("damping"):
            continue
        value, known = str(guess.value), "–"
        if isinstance(guess.value, int | float):
            value = f"{guess.value:.4g} {guess.unit}".strip()
            if guess.sd is not None and guess.what.startswith("stiffness"):
                # By a factor, as their priors are of logarithms.
                known = f"a factor of {1 + guess.sd / guess.value:.2g}"
            elif guess.sd is not None:
                known = f"± {guess.sd:.3g}"
        made.add_row(guess.what, Text(value), known)
    return made


def example(folder: str, robot: str, campaign: str, files: Sequence[str]) -> Done:
    """Answer of `new --example`: the folder, and the files in it to begin with."""
    cell = f"{folder}/cell"
    said = (
        f"An example of one's own to change is in {folder}: robot/robot.toml, "
        f"robot/robot.urdf and campaign.toml, with comments; ask_tell.py is a script."
    )
    new = "planner", "new", cell, "--robot", robot, "--campaign", campaign
    commands = ("planner", "check", robot), new, ("planner", "next", cell)
    keys = {"example": folder, "robot": robot, "campaign": campaign, "files": files}
    return Done(keys, Group(Text(said), *(command_line("  ", *words) for words in commands)))


def taken_back(entries: Sequence[Entry], what: str) -> Done:
    """Answer of `undo` and `redo` (`what`: "undone", "redone"): the log's entry that was taken back
    or holds again, and those that went with it.
    """
    entry, *others = entries
    said, words = in_words(entry), [in_words(other) for other in others]
    follow = f"; with it: {', '.join(words)}" if words else ""
    keys = {what: entry.seq, "event": entry.event.kind, "what": said, "with_it": words}
    return Done(keys, f"{what.capitalize()}: {said}{follow} (entry {entry.seq} of the log).")


def withdrawn(directory: Path, pose: str, reason: str, held: bool) -> Done:
    """Answer of `withdraw`, of a measured pose or of hits that were `held`."""
    keys = {"withdrawn": pose, "reason": reason}
    if held:
        return Done(
            keys,
            f"The hits of {pose} that were held are set aside; their recordings are kept. Hit it "
            f"again, or import corrected files: "
            f"{command('planner', 'import', directory, 'FOLDER', '--pose', pose)}.",
        )
    again = command("planner", "confirm", directory, pose)
    anew = command("planner", "import", directory, "FOLDER", "--pose", f"{pose}b")
    return Done(
        keys,
        f"Pose {pose} is set aside; its recordings are kept. To use them again: {again}. Corrected "
        f"or new ones take another name: {anew}.",
    )
