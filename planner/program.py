"""The program as another process runs it."""

import sys


def command(*arguments: str) -> list[str]:
    """What starts `planner` with these arguments, with this very interpreter."""
    return [sys.executable, "-c", "from planner.cli import main; main()", *arguments]
