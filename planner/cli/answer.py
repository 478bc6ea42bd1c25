"""How a command answers: one JSON document, or text for the engineer."""

import math
import sys
from collections.abc import Callable
from typing import Annotated, Any

import msgspec
import typer

AsJson = Annotated[bool, typer.Option("--json", help="Answer with one JSON document.")]


def respond(
    answer: dict[str, Any], as_json: bool, render: Callable[[dict[str, Any]], Any], code: int = 0
) -> int:
    """Print the answer and return the exit code. Numbers that are not finite become null."""
    if as_json:
        text = msgspec.json.format(msgspec.json.encode(plain(answer)), indent=2)
        sys.stdout.write(text.decode() + "\n")
        sys.stdout.flush()
    else:
        from rich.console import Console

        rendered = render(answer)
        if rendered is not None:
            Console().print(rendered)
    return code


def warn(sentence: str) -> None:
    """One sentence on stderr."""
    print(" ".join(sentence.split()), file=sys.stderr)


def plain(value: Any) -> Any:
    """NumPy to builtins; not-a-number to null."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, complex):
        return [plain(value.real), plain(value.imag)]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
