"""Answer of `couple`: the FRFs of another tool, how sure they are, and the hit that would tell."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from rich.console import Group
from rich.text import Text

from planner.export.npz import save_coupled
from planner.milling.coupling import (
    AMPLIFICATION_LIMIT,
    MOTIONS,
    CoupledFrf,
    Resonance,
    VerifyingHit,
    resonances,
    verifying_hit,
)
from planner.milling.tool import NUMBERS
from planner.report.answer import NOT_IN_JSON, Answer
from planner.report.text import remarks, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Amplification:
    """How noise grows: the worst line, the limit, and the bands (Hz) in which it is exceeded."""

    worst: float
    at_hz: float
    limit: float
    above_limit_hz: tuple[tuple[float, float], ...]

    @classmethod
    def of(cls, frequency_hz: np.ndarray, values: np.ndarray) -> "Amplification":
        """From values (F,) line by line."""
        worst, f = int(np.argmax(values)), frequency_hz
        over = np.ma.clump_masked(np.ma.masked_greater(values, AMPLIFICATION_LIMIT))
        bands = tuple((float(f[part.start]), float(f[part.stop - 1])) for part in over)
        return cls(float(values[worst]), float(f[worst]), AMPLIFICATION_LIMIT, bands)

    @property
    def sentence(self) -> str:
        """What the engineer should mind; empty where nothing is above the limit."""
        if not self.above_limit_hz:
            return ""
        bands = [f"{low:.4g} to {high:.4g} Hz" for low, high in self.above_limit_hz[:3]]
        more = ", …" if len(self.above_limit_hz) > 3 else ""
        return (
            f"Errors of the measured FRFs grow more than {self.limit:g} times at "
            f"{', '.join(bands)}{more}: do not rely on the coupled FRFs there."
        )


@dataclass(frozen=True)
class CouplingReport(Answer):
    """Answer of `couple`; receptances in m/N, FRFs of `npz` in m/s²/N."""

    tool: str
    reference: str | None
    pose: str
    npz: str
    frequency_hz: tuple[float, float]
    lines: int
    motions: tuple[str, ...]
    resonances: tuple[Resonance, ...]
    amplification: Amplification
    verify: VerifyingHit
    contact: "dict[str, object] | msgspec.UnsetType" = msgspec.UNSET
    simulated: bool = False
    remarks: tuple[str, ...] = ()
    plots: tuple[str, ...] = ()
    rrd: str | None = None
    before: CoupledFrf | None = field(default=None, metadata=NOT_IN_JSON)
    coupled: CoupledFrf | None = field(default=None, metadata=NOT_IN_JSON)

    def text(self) -> Group:
        """A table of resonances, then what to mind and what to hit."""
        made = table(
            f"{self.tool} at {self.pose}",
            *("direction", "peak (Hz)", "receptance (µm/N)", "sd (%)", "amplification"),
        )
        for peak in self.resonances:
            size = f"{1e6 * peak.receptance_m_n:.3g}"
            sd, grown = f"{peak.sd_percent:.1f}", f"{peak.amplification:.2f}"
            made.add_row(peak.direction, f"{peak.frequency_hz:.4g}", size, sd, grown)
        worst = self.amplification
        lines = [
            Text(f"Errors grow at most {worst.worst:.3g} times, at {worst.at_hz:.4g} Hz."),
            Text(self.verify.sentence),
            Text(f"FRFs (m/s²/N) with sd: {self.npz}"),
        ]
        if isinstance(self.contact, dict):
            lines.append(Text(_contact_sentence(self.contact)))
        return Group(made, *lines, *remarks(self.remarks), *self.end)

    def drawings(self) -> "dict[str, Figure]":
        """Receptances before and after, and how errors grow."""
        if self.coupled is None:
            return {}
        from planner.report.milling_plots import coupling_figure

        title = "Receptances of the tip, before and after"
        before = "as measured" if self.reference is None else f"measured: {self.reference}"
        return {"coupling": coupling_figure(self.before, self.coupled, title, before)}


def _contact_sentence(contact: dict[str, Any]) -> str:
    numbers = [
        f"{name} = {contact[name]['value']:.4g} "
        + (
            "(not determined)"
            if contact[name]["sd_percent"] is None
            else f"± {contact[name]['sd_percent']:.2g} %"
        )
        for name in NUMBERS
    ]
    return (
        f"Contact identified: {', '.join(numbers)}; misfit {contact['misfit_before_percent']:.3g} "
        f"% as stated, {contact['misfit_percent']:.3g} % now."
    )


def coupling_report(
    before: CoupledFrf, coupled: CoupledFrf, tool: str, reference: str | None, pose: str, npz: Path
) -> CouplingReport:
    """Write the npz and say what it holds; `before` is the tested tool's tip."""
    save_coupled(npz, coupled, pose)
    amplification = Amplification.of(coupled.frequency_hz, coupled.amplification)
    said = [*coupled.remarks]
    if amplification.sentence:
        said.append(amplification.sentence)
    held = [MOTIONS[k] for k in range(3) if k not in coupled.kept]
    if held:
        said.append(
            f"Nothing was measured along the tool's own {', '.join(held)}: FRFs there are NaN."
        )
    return CouplingReport(
        tool, reference, pose, str(npz.resolve()),
        (float(coupled.frequency_hz[0]), float(coupled.frequency_hz[-1])),
        len(coupled.frequency_hz), tuple(MOTIONS[k] for k in coupled.kept),
        resonances(coupled), amplification, verifying_hit(coupled), simulated=coupled.simulated,
        remarks=tuple(said),
        before=before, coupled=coupled,
    )  # fmt: skip
