"""The session's screen, one page that is drawn anew when something changed, and its keys."""

import os
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from rich.console import Console, Group, RenderableType
from rich.text import Text

from planner.report.text import UnbrokenConsole

NOTES = 4  # of the last sentences that stay on the page
BELOW = 2  # lines under page and sentences: for what is being done, and for the cursor
ENDLESS = 1000  # lines of what is no terminal

Page = Callable[[int, int], RenderableType]  # of so many columns and lines at most


class Screen:
    """On a terminal one page with the last sentences under it; elsewhere everything in turn."""

    def __init__(self, console: Console):
        self.console = console
        self._page: Page | None = None
        self._notes: deque[Text] = deque(maxlen=NOTES)
        self._shown = ""
        self._left = False  # whether something stands on the screen that is not to be wiped off
        self._rung: set[tuple[str, int]] = set()

    def show(self, page: Page | RenderableType) -> None:
        """Draw a page in the place of the one before; nothing where it is the same."""
        self._page = page if callable(page) else lambda width, height: page
        drawn = self._drawn(0)
        if drawn != self._shown:
            self._shown = drawn
            self._draw()

    def leave(self, result: RenderableType, notes: Sequence[Text]) -> None:
        """What may be higher than the screen: printed once, and left for who scrolls back.

        `notes` say the most important of it under the page that follows.
        """
        self._page, self._shown = None, ""
        if self.console.is_terminal:
            self.console.clear()
            self._notes.clear()  # what was said before the result is over
            self._notes.extend(notes)
            self._left = True
        self.console.print(result)

    def say(self, sentence: Text) -> None:
        """A sentence under the page; the last ones stay."""
        if self.console.is_terminal:
            self._notes.append(sentence)
        if self.console.is_terminal and self._page is not None:
            self._draw(asked=True)
        else:
            self.console.print(sentence)

    def ring(self, kinds: Mapping[tuple[str, int], str]) -> None:
        """Ring for new hits, by file and number, more often for bad ones; sentences go then."""
        new = {kind for hit, kind in kinds.items() if hit not in self._rung}
        self._rung |= kinds.keys()
        if new:
            self.forget()
            self.bell(3 if new - {"good"} else 1)

    def forget(self) -> None:
        """Drop the sentences: they spoke of what was before."""
        self._notes.clear()

    def bell(self, times: int = 1) -> None:
        """Ring: once for good, more often for what is to be done again."""
        for _ in range(times):
            self.console.bell()

    def working(self, what: str):
        """A context in which the screen says what is being done."""
        return self.console.status(what)

    def _draw(self, asked: bool = False) -> None:
        if not self.console.is_terminal:
            if self._page is not None:
                self.console.print(self._page(self.console.width, ENDLESS))
            return
        last = self._lines(self._notes[-1]) if self._notes else 0
        parts: list[RenderableType] = []
        if self._page is not None:
            parts.append(self._page(self.console.width, self._height - last))
        room = self._height - self._drawn(last).count("\n")
        if asked and parts and room < last <= self._height:  # the page gives way until it changes
            parts[:], room = [self._notes[-1], Text("any key: back to the page", "dim")], 0
        if self._left:  # as many lines as push it off the screen, into what can be scrolled back to
            self.console.print("\n" * (self.console.height - 1))
            self._left = False
        self.console.clear()
        fitting: list[Text] = []  # the last sentences for which there are so many lines
        for note in reversed(self._notes):
            room -= self._lines(note)
            if room < 0:
                break
            fitting.insert(0, note)
        self.console.print(Group(*parts, *fitting))

    @property
    def _height(self) -> int:
        return self.console.height - BELOW if self.console.is_terminal else ENDLESS

    def _drawn(self, kept: int) -> str:
        """The page where so many lines are kept for sentences."""
        if self._page is None:
            return ""
        with self.console.capture() as captured:
            self.console.print(self._page(self.console.width, self._height - kept))
        return captured.get()

    def _lines(self, note: Text) -> int:
        return len(self.console.render_lines(note))


_RULER = UnbrokenConsole(width=80)  # only to ask how text wraps


@dataclass(frozen=True, eq=False)
class ScreenText:
    """One thing that is said: from its shortest form to its longest, of None nothing is seen.

    All are said at one length before any is at the next, those of the lowest `rank` first.
    """

    forms: Sequence[Text | None]
    rank: int = 0


def fitted(parts: Iterable[ScreenText], width: int, height: int) -> list[Text]:
    """The longest forms, in order, that fit into so many lines; else the shortest ones."""
    parts = list(parts)
    chosen = [0] * len(parts)
    lines = [[_height(form, width) for form in part.forms] for part in parts]
    room = height - sum(own[0] for own in lines)
    order = sorted(range(len(parts)), key=lambda i: parts[i].rank)
    for k in range(1, max((len(own) for own in lines), default=0)):
        for i in (i for i in order if k < len(lines[i])):
            more = lines[i][k] - lines[i][chosen[i]]
            if more <= room:
                chosen[i], room = k, room - more
    found = (part.forms[k] for part, k in zip(parts, chosen, strict=True))
    return [form for form in found if form is not None]


def _height(form: Text | None, width: int) -> int:
    options = _RULER.options.update(width=width)
    return 0 if form is None else len(_RULER.render_lines(form, options))


Keys = Callable[[float], str | None]  # the next key, or None if none came in so many seconds


def no_keys(timeout_s: float) -> str | None:
    """Nobody is at the keyboard: never a key; takes the time all the same."""
    time.sleep(timeout_s)
    return None


def _of_terminal(timeout_s: float) -> str | None:
    """Of a POSIX terminal in cbreak mode."""
    import select

    ready, _, _ = select.select([sys.stdin], [], [], timeout_s)
    if not ready:
        return None
    return os.read(sys.stdin.fileno(), 1).decode("utf-8", "ignore") or "q"


@contextmanager
def terminal_keys() -> Iterator[Keys]:
    """Keys of this terminal, restored whatever happens; `no_keys` where there is no terminal."""
    if not sys.stdin.isatty():
        yield no_keys
        return
    try:
        import termios
        import tty
    except ImportError:  # not a POSIX system
        yield no_keys
        return
    handle = sys.stdin.fileno()
    before = termios.tcgetattr(handle)
    try:
        tty.setcbreak(handle)
        yield _of_terminal
    finally:
        termios.tcsetattr(handle, termios.TCSADRAIN, before)
