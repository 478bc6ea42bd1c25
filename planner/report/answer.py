"""What every command answers with: a typed value that is also one JSON document and a text."""

import dataclasses
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import msgspec

if TYPE_CHECKING:
    from rich.console import RenderableType

# Metadata of a field for what an answer was made of; None where it came from another process.
NOT_IN_JSON = {"json": False}


class Answer:
    """Base of the frozen dataclasses whose fields are the keys of a JSON answer, in its order.

    A field that is msgspec.UNSET does not appear; one with the metadata NOT_IN_JSON never does.
    """

    def to_json(self) -> dict[str, Any]:
        """Builtin values only. NumPy arrays become lists, numbers that are not finite None."""
        own = dataclasses.fields(self)  # pyrefly: ignore[bad-argument-type]
        return plain({f.name: getattr(self, f.name) for f in own if f.metadata.get("json", True)})

    def text(self) -> "RenderableType | None":
        """For the engineer, units in every column; None where there is nothing to say."""
        return None

    def _repr_html_(self) -> str:
        """What notebooks show."""
        import io

        from rich.console import Console

        console = Console(file=io.StringIO(), record=True, width=100)
        console.print(self.text() or "")
        return console.export_html(inline_styles=True, code_format="<pre>{code}</pre>")


@dataclasses.dataclass(frozen=True, eq=False)
class Done(Answer):
    """Answer of keys, which are those of its JSON, and of what the engineer is told."""

    keys: Mapping[str, Any]
    said: "RenderableType"

    def to_json(self) -> dict[str, Any]:
        """The keys alone."""
        return plain(self.keys)

    def text(self) -> "RenderableType":
        """What is said."""
        return self.said


def plain(value: Any) -> Any:
    """Builtin values of anything that an answer holds; what is UNSET in it is left out."""
    if isinstance(value, Answer):
        return value.to_json()
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        value = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
    if isinstance(value, msgspec.Struct):
        value = msgspec.to_builtins(value)
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(k): plain(item) for k, item in value.items() if item is not msgspec.UNSET}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, complex):
        return [plain(value.real), plain(value.imag)]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def encoded(answer: Answer) -> bytes:
    """The JSON document, indented."""
    return msgspec.json.format(msgspec.json.encode(answer.to_json()), indent=2)
