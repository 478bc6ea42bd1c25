"""What a check finds: how bad it is, what, where, and what to do about it."""

from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = "error", "warning", "note"  # worst first


@dataclass(frozen=True)
class CheckRemark:
    """An error stops a campaign, a warning is most likely a mistake, a note is for information.

    `what` is a whole sentence, `where` a file and entry, `remedy` what to do, a sentence too.
    """

    severity: Severity
    what: str
    where: str
    remedy: str = ""

    @property
    def sentence(self) -> str:
        """All of it in one line."""
        return f"{self.where}: {self.what} {self.remedy}".rstrip()


def worst_first(remarks: list[CheckRemark]) -> tuple[CheckRemark, ...]:
    """Errors, warnings, notes, each in the order found."""
    return tuple(sorted(remarks, key=lambda r: SEVERITIES.index(r.severity)))
