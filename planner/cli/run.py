"""Running a command so that every failure is one sentence and an exit code."""

import os
import sys
import traceback

import typer
from typer.exceptions import TyperException

from planner.errors import PlannerError

STOPPED = 130


def run(arguments: list[str]) -> int:
    """Run the command line; returns the exit code, never raises on bad usage or input."""
    from planner.cli.app import app

    try:
        code = app(arguments, standalone_mode=False)
        # Typer makes an exit code of Ctrl-C.
        if code == STOPPED:
            raise KeyboardInterrupt
        return code if isinstance(code, int) else 0
    except PlannerError as error:
        return _say(str(error), error.exit_code)
    except typer.Exit as error:
        return error.exit_code
    except (typer.Abort, KeyboardInterrupt):
        return _say("Stopped; everything imported or finished so far is kept.", STOPPED)
    except TyperException as error:
        return _usage(error)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        return _no_access(error)
    except MemoryError:
        return _say("The input needs more memory than this machine has; give a smaller one.", 2)
    except Exception as error:
        return _internal(error)


def _say(sentence: str, code: int) -> int:
    # A sentence is one line, whatever the file names or library texts inside it hold.
    print(" ".join(sentence.split()), file=sys.stderr)
    return code


def _usage(error: TyperException) -> int:
    text = error.format_message() if hasattr(error, "format_message") else str(error)
    if not text:  # no command was given: the help has been printed
        return 2
    context = getattr(error, "ctx", None)
    # What is wrong below a command is explained by that command's own help.
    name = context.info_name if context is not None and context.parent is not None else ""
    command = f"planner {name}".strip()
    return _say(f"{text.rstrip('.')}; see {command} --help.", 2)


def _no_access(error: OSError) -> int:
    """A full disk, a folder that may not be written, a share that is gone."""
    if os.environ.get("PLANNER_DEBUG"):
        traceback.print_exc()
    what = f"{error.filename} cannot be read or written" if error.filename else "A file failed"
    why = error.strerror or type(error).__name__
    return _say(
        f"{what} ({why}); free the disk or allow it, and repeat: everything imported so far is "
        f"kept.",
        2,
    )


def _internal(error: Exception) -> int:
    if os.environ.get("PLANNER_DEBUG"):
        traceback.print_exc()
    where = traceback.extract_tb(error.__traceback__)[-1]
    return _say(
        f"planner failed inside ({type(error).__name__}: {error}, at {where.name}); nothing "
        f"imported is lost; set PLANNER_DEBUG=1 to see where and report it.",
        1,
    )
