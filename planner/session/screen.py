"""The session's screen: one page that is drawn anew when something changed, and a bell."""

from collections import deque
from collections.abc import Mapping

from rich.console import Console, Group, RenderableType
from rich.text import Text

NOTES = 4  # of the last sentences that stay on the page


class Screen:
    """On a terminal one page with the last sentences under it; elsewhere everything in turn."""

    def __init__(self, console: Console):
        self.console = console
        self._page: RenderableType | None = None
        self._notes: deque[Text] = deque(maxlen=NOTES)
        self._shown = ""
        self._rung: set[tuple[str, int]] = set()

    def show(self, page: RenderableType) -> None:
        """Draw a page in the place of the one before; nothing where it is the same."""
        self._page = page
        with self.console.capture() as captured:
            self.console.print(page)
        if captured.get() != self._shown:
            self._shown = captured.get()
            self._draw()

    def say(self, sentence: Text) -> None:
        """A sentence under the page; the last ones stay."""
        if self.console.is_terminal:
            self._notes.append(sentence)
            self._draw()
        else:
            self.console.print(sentence)

    def ring(self, kinds: Mapping[tuple[str, int], str]) -> None:
        """Ring for hits, by file and number, that were not rung for: more often for bad ones.

        Sentences under the page are dropped then.
        """
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

    def _draw(self) -> None:
        parts: list[RenderableType] = [] if self._page is None else [self._page]
        if not self.console.is_terminal:
            self.console.print(Group(*parts))
            return
        self.console.clear()
        self.console.print(Group(*parts, *self._that_fit()))

    def _that_fit(self) -> list[Text]:
        """The last sentences for which there is room under the page, and one line for work."""
        room = self.console.height - self._shown.count("\n") - 2
        fitting: list[Text] = []
        for note in reversed(self._notes):
            room -= len(note.wrap(self.console, self.console.width))
            if room < 0:
                break
            fitting.insert(0, note)
        return fitting
