"""Answer of `stability` at one pose: to which depth a cut is stable at each spindle speed."""

from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np
from rich.console import Group
from rich.text import Text

from planner.campaign.cut_source import Asked, structure_of
from planner.milling.cut import Cut, load_cut
from planner.milling.lobes import Loss, losses
from planner.milling.machine import multiplier
from planner.milling.structure import Structure, beyond, doubts
from planner.milling.uncertainty import PROBABILITY, SampledLimits, sampled_limits
from planner.progress import Tell, quietly, within
from planner.report.answer import Answer
from planner.report.plot_files import Pictures
from planner.report.text import SIMULATED, SIMULATED_TITLE, number, table

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
        lines = [text for kind, text in KINDS.items() if kind in self.kind] + list(self.remarks)
        if self.multiplier is not msgspec.UNSET:
            verdict = "stable" if self.multiplier < 1 else "not stable"
            lines.append(f"At the point |µ| = {self.multiplier:.6f}: {verdict}.")
        if self.plots is not msgspec.UNSET and self.plots:
            lines += ["Pictures:", *(f"  {plot}" for plot in self.plots)]
        said = Group(made, Text("\n".join(lines)))
        return Group(said, SIMULATED) if self.simulated else said


KINDS = {
    "hopf": "hopf: chatter at a frequency of its own, beside multiples of the tooth passing.",
    "flip": "flip: chatter at odd multiples of half the tooth-passing frequency.",
}
LOBES = "Where a line has a gap every depth that was asked for is stable."
LOBES_SHARE = 0.2  # of the time, where samples follow


def stability_of(
    asked: Asked, pictures: Pictures | None = None, tell: Tell = quietly
) -> StabilityReport:
    """Raises InputError where source, cut or point are wrong."""
    cut = load_cut(asked.cut)
    point = asked.wanted
    structure = structure_of(asked, cut)
    machine, samples = structure.machine(cut), structure.samples(cut, asked.samples)
    found = losses(machine, within(tell, 0.0, LOBES_SHARE if samples else 1.0))
    drawn = None
    if samples:
        drawn = sampled_limits(samples, found, within(tell, LOBES_SHARE, 1.0))
    answer = _answer(cut, structure, found, drawn)
    if point is not None:
        there = multiplier(machine, *point)
        answer = replace(answer, multiplier=there.size, multiplier_error=there.error)
    if pictures is not None and pictures.wanted:
        from planner.report.stability_plot import lobes_figure

        mark = SIMULATED_TITLE if answer.simulated else ""
        figure = lobes_figure(cut, found, drawn, point, mark)
        written = pictures.write({"stability": figure}, asked.source.name, mark + LOBES)
        answer = replace(answer, **written)
    return answer


def _answer(
    cut: Cut, structure: Structure, found: tuple[Loss, ...], drawn: SampledLimits | None
) -> StabilityReport:
    depth = np.array([loss.depth_m for loss in found])
    robust, remarks = depth, list(structure.remarks)
    outside = beyond(structure, np.array([loss.chatter_hz for loss in found]))
    remarks += [outside] if outside else []
    if drawn is not None:
        robust = drawn.robust()
        robust = np.where(np.isfinite(robust), robust, np.nan)
        off = drawn.robust_sd()
        off = off[np.isfinite(off)]
        if off.size:
            remarks.append(
                f"Depths at {100 * PROBABILITY:.0f} % are from {len(drawn.depth_m)} samples, known "
                f"to ± {100 * np.median(off):.1f} % (median over speeds)."
            )
        remarks += doubts(structure, cut, depth, ~drawn.open(depth))
    return StabilityReport(
        spindle_rpm=cut.speeds_rpm,
        depth_limit_m=depth,
        kind=tuple(loss.kind for loss in found),
        chatter_hz=np.array([loss.chatter_hz for loss in found]),
        depth_limit_m_at_95=robust,
        method=cut.method,
        depth_error=np.array([loss.error for loss in found]),
        remarks=tuple(remarks),
        simulated=structure.frf is not None and structure.frf.simulated,
    )
