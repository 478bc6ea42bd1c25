"""Small words that every sentence needs: counts, standard deviations, times."""

import math
import shlex
from collections.abc import Iterable
from datetime import datetime
from pathlib import Path


def counted(count: int, one: str, more: str = "") -> str:
    """A number with its noun: "1 pose", "2 poses"; `more` is an unusual plural."""
    return f"{count} {one if count == 1 else more or f'{one}s'}"


def small(value: float, form: str = ".2f") -> str:
    """A number of fixed decimals (".2f"); one above 0 that rounds to 0 is below the last digit."""
    said = format(value, form)
    if value > 0 and said.strip("0.") == "":
        return f"<{10.0 ** -int(form[1:-1]):{form}}"
    return said


def significant(value: float, digits: int = 2) -> str:
    """A number with so many digits, in no power of ten."""
    if value == 0 or not math.isfinite(value):
        return f"{value:.0f}"
    rounded = float(f"{value:.{digits}g}")
    return f"{rounded:.{max(0, digits - 1 - math.floor(math.log10(abs(rounded))))}f}"


def probable(probability: float) -> str:
    """A probability in %, with as many digits as still say something: "98 %", "above 99.9 %"."""
    if not 1e-3 <= probability <= 0.999:
        return "below 0.1 %" if probability < 0.5 else "above 99.9 %"
    percent = 100 * probability
    return f"{percent:.{int(not 1 <= percent <= 99)}f} %"


def short_name(path: str | Path, most: int = 24) -> str:
    """The name of a file; of a long one its beginning and, as names differ there, more of its end.

    So that what is said of the file has room on the line, too.
    """
    name = Path(path).name
    begin = most // 3
    return name if len(name) <= most else f"{name[:begin]}…{name[begin + 1 - most :]}"


def by_reason(files: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """Of files and reasons: the first file of each reason with how many more have it."""
    named: dict[str, list[str]] = {}
    for file, reason in files:
        named.setdefault(reason, []).append(file)
    more = ((n, f" and {len(n) - 1} more" if len(n) > 1 else "") for n in named.values())
    return [(f"{n[0]}{text}", why) for why, (n, text) in zip(named, more, strict=True)]


def command(*words: object) -> str:
    """A command line as a shell takes it: words with blanks in them quoted."""
    return shlex.join(map(str, words))


def local_time(utc: str) -> str:
    """A time of the log (UTC, ISO 8601) as clocks here show it, with its zone."""
    return f"{datetime.fromisoformat(utc).astimezone():%Y-%m-%d %H:%M:%S %Z}" if utc else ""
