"""Answer of `stability`: to which depth a cut is stable at each spindle speed."""

from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
from rich.console import Group
from rich.text import Text

from planner.report.answer import Answer
from planner.report.text import SIMULATED, number, table

MOST_ROWS = 24  # of speeds that the text shows


@dataclass(frozen=True, eq=False)
class StabilityReport(Answer):
    """Answer of `stability`, per speed (n,).

    `depth_limit_m` is the smallest depth that chatters, null where none up to the largest depth
    does. `depth_error` is its relative change when more points per period are computed.
    `multiplier` is the largest |µ| at the asked point, `multiplier_error` its numerical error.
    """

    spindle_rpm: np.ndarray
    depth_limit_m: np.ndarray
    kind: tuple[str | None, ...]
    chatter_hz: np.ndarray
    depth_limit_m_at_95: np.ndarray
    method: str
    depth_error: np.ndarray
    multiplier: Any = msgspec.UNSET
    multiplier_error: Any = msgspec.UNSET
    remarks: tuple[str, ...] = ()
    simulated: bool = False
    plots: Any = msgspec.UNSET
    rrd: Any = msgspec.UNSET

    def text(self) -> Group:
        """A table of speeds, at most so many, then what else there is to say."""
        made = table(
            f"First loss of stability, {self.method.replace('_', ' ')}",
            *("spindle (rpm)", "depth limit (mm)", "at 95 % (mm)", "chatter (Hz)", "kind"),
        )
        step = max(1, -(-len(self.spindle_rpm) // MOST_ROWS))
        for i in range(0, len(self.spindle_rpm), step):
            made.add_row(
                f"{self.spindle_rpm[i]:.0f}",
                number(1e3 * self.depth_limit_m[i], ".4f"),
                number(1e3 * self.depth_limit_m_at_95[i], ".4f"),
                number(self.chatter_hz[i], ".1f"),
                self.kind[i] or "stable",
            )
        lines = list(self.remarks)
        if self.multiplier is not msgspec.UNSET:
            verdict = "stable" if self.multiplier < 1 else "not stable"
            lines.append(f"At the point |µ| = {self.multiplier:.6f}: {verdict}.")
        if self.plots is not msgspec.UNSET and self.plots:
            lines += ["Pictures:", *(f"  {plot}" for plot in self.plots)]
        said = Group(made, Text("\n".join(lines)))
        return Group(said, SIMULATED) if self.simulated else said
