"""What any engine of concealed cases hands over: recordings on disk, and what only the answer says.

An engine is a module with `SINGLES` and `OUTSIDERS`, the kinds of cases that it draws beside "null"
and "pair", and with `make(kind, seed, folder, laboratory)`, which writes folder/robot/robot.toml
and folder/recordings and answers a `Made`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from planner.proof.refit import Question


class NothingShowsError(Exception):
    """A seed of which nothing comes, as noise hides whatever was drawn; take another one."""


@dataclass(frozen=True)
class Concealed:
    """An effect and its place as a diagnosis states them; true parameters in SI.

    `question` answers what tells of it; it is asked once the recordings have been written.
    """

    effect: str
    at: str | None
    parameters: Mapping[str, Any]
    question: Callable[[], Question]


@dataclass(frozen=True)
class Made:
    """A case; `imperfections` are places that a diagnosis may name, too small to be asked for.

    `held_out`: names of poses, frequencies (F,) in Hz and true FRFs (real and imaginary parts;
    pose, response, hit, F), where the engine knows them.
    """

    robot: str
    concealed: Sequence[Concealed]
    imperfections: Sequence[tuple[str, str]] = ()
    held_out: Mapping[str, Any] = field(default_factory=dict)
