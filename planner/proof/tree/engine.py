"""Cases of robots that are drawn at random, as `planner.proof.engine` wants them."""

from functools import partial
from pathlib import Path

from planner.proof.engine import Concealed, Made
from planner.proof.tree.case import make_case, write_case
from planner.proof.tree.deck import OUTSIDE, SINGLE
from planner.proof.tree.questions import question

SINGLES, OUTSIDERS = tuple(SINGLE), tuple(OUTSIDE)


def make(kind: str, seed: int, folder: Path, laboratory: bool = False) -> Made:
    """Write folder/robot and folder/recordings of a kind of case; hits miss in any world."""
    case = make_case(seed, "none" if kind == "null" else kind)
    write_case(case, folder)
    concealed = [
        Concealed(e.effect, e.at, e.parameters, partial(question, case, e)) for e in case.effects
    ]
    return Made(case.robot.name, concealed)
