"""Small words that every sentence needs: counts, standard deviations, times."""

import math
import shlex
from collections.abc import Iterable, Sequence
from datetime import datetime
from pathlib import Path


def counted(count: int, one: str, more: str = "") -> str:
    """A number with its noun: "1 pose", "2 poses"; `more` is an unusual plural."""
    return f"{count} {one if count == 1 else more or f'{one}s'}"


def listed(told: Sequence[str]) -> str:
    """ "a", "a and b", "a, b and c"."""
    *before, last = told
    return f"{', '.join(before)} and {last}" if before else last


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


def with_sd(value: float, sd: float | None) -> str:
    """A number and its sd of two digits, with one power of ten: "1.206e7 ± 0.024e7".

    Four digits of one whose sd is not known.
    """
    if not (math.isfinite(value) and value):
        return f"{value:.3g}"
    power = math.floor(math.log10(abs(value)))
    known = sd is not None and math.isfinite(sd) and sd > 0
    last = math.floor(math.log10(sd)) - 1 if known else power - 3
    power = power if abs(power) > 3 else 0
    digits, ten = max(0, min(8, power - last)), f"e{power}" if power else ""
    each = (value, sd) if known else (value,)
    return " ± ".join(f"{one / 10**power:.{digits}f}{ten}" for one in each)


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


def by_reason(told: Iterable[tuple[str, str]]) -> list[str]:
    """Files and what is said of each: a sentence each, or one of all of which the same is said."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for file, why in told:
        same = why.replace(file, "the file").replace(Path(file).name, "the file")
        groups.setdefault(same, []).append((file, why))
    said = []
    for same, group in groups.items():
        (first, why), *others = sorted(group)
        names = [first, *(Path(file).name for file, _ in others[: 1 if len(others) > 2 else 2])]
        more = [f"{len(group) - len(names)} more"] if len(group) > len(names) else []
        many = f"{len(group)} files ({listed([*names, *more])}): {same}"
        said.append(many if others else f"{first}: {why}")
    return said


def command(*words: object) -> str:
    """A command line as a shell takes it: words with blanks in them quoted."""
    return shlex.join(map(str, words))


def local_time(utc: str) -> str:
    """A time of the log (UTC, ISO 8601) as clocks here show it, with its zone."""
    return f"{datetime.fromisoformat(utc).astimezone():%Y-%m-%d %H:%M:%S %Z}" if utc else ""
