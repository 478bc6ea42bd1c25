"""Answer of `couple`: the FRFs of another tool, how sure they are, and the hit that would tell."""

from dataclasses import dataclass
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
    resonances,
    verifying_hit,
)
from planner.milling.tool import NUMBERS
from planner.report.answer import Answer, plain
from planner.report.text import remarks, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _amplified(coupled: CoupledFrf) -> dict[str, Any]:
    """How noise grows: the worst line, the limit, and the bands (Hz) in which it is exceeded."""
    values, f = coupled.amplification, coupled.frequency_hz
    worst = int(np.argmax(values))
    over = np.ma.clump_masked(np.ma.masked_greater(values, AMPLIFICATION_LIMIT))
    bands = [(float(f[part.start]), float(f[part.stop - 1])) for part in over]
    return {"worst": float(values[worst]), "at_hz": float(f[worst]), "limit": AMPLIFICATION_LIMIT,
            "above_limit_hz": bands}  # fmt: skip


def _to_mind(bands: list[tuple[float, float]]) -> str:
    """What the engineer should mind; empty where nothing is above the limit."""
    if not bands:
        return ""
    where = ", ".join(f"{low:.4g} to {high:.4g} Hz" for low, high in bands[:3])
    more = ", …" if len(bands) > 3 else ""
    return (
        f"Errors of the measured FRFs grow more than {AMPLIFICATION_LIMIT:g} times at "
        f"{where}{more}: do not rely on the coupled FRFs there."
    )


@dataclass(frozen=True, eq=False)
class CouplingReport(Answer):
    """Answer of `couple`; receptances in m/N, FRFs of `npz` in m/s²/N.

    `before` is the tip with the tested tool, whose name `reference` is.
    """

    tool: str
    reference: str | None
    pose: str
    npz: str
    before: CoupledFrf
    coupled: CoupledFrf
    contact: "dict[str, object] | msgspec.UnsetType" = msgspec.UNSET
    plots: tuple[str, ...] = ()
    rrd: str | None = None

    @property
    def simulated(self) -> bool:
        """Whether the FRFs are of simulated recordings."""
        return self.coupled.simulated

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the engineer should mind."""
        held = ", ".join(MOTIONS[k] for k in range(3) if k not in self.coupled.kept)
        none = f"Nothing was measured along the tool's own {held}: FRFs there are NaN."
        grown = _to_mind(_amplified(self.coupled)["above_limit_hz"])
        return tuple(filter(None, (*self.coupled.remarks, grown, none if held else "")))

    def to_json(self) -> dict[str, Any]:
        """With the band (Hz) of so many lines, and which motions are known."""
        made = self.coupled
        return plain({
            "tool": self.tool, "reference": self.reference, "pose": self.pose, "npz": self.npz,
            "frequency_hz": made.frequency_hz[[0, -1]], "lines": len(made.frequency_hz),
            "motions": [MOTIONS[k] for k in made.kept], "resonances": resonances(made),
            "amplification": _amplified(made), "verify": verifying_hit(made),
            "contact": self.contact, "simulated": self.simulated, "remarks": self.remarks,
            "plots": self.plots, "rrd": self.rrd,
        })  # fmt: skip

    def text(self) -> Group:
        """A table of resonances, then what to mind and what to hit."""
        made = table(
            f"{self.tool} at {self.pose}",
            *("direction", "peak (Hz)", "receptance (µm/N)", "sd (%)", "amplification"),
        )
        for peak in resonances(self.coupled):
            size = f"{1e6 * peak.receptance_m_n:.3g}"
            sd, grown = f"{peak.sd_percent:.1f}", f"{peak.amplification:.2f}"
            made.add_row(peak.direction, f"{peak.frequency_hz:.4g}", size, sd, grown)
        most = _amplified(self.coupled)
        lines = [
            Text(f"Errors grow at most {most['worst']:.3g} times, at {most['at_hz']:.4g} Hz."),
            Text(verifying_hit(self.coupled).sentence),
            Text(f"FRFs (m/s²/N) with sd: {self.npz}"),
        ]
        if isinstance(self.contact, dict):
            lines.append(Text(_contact_sentence(self.contact)))
        return Group(made, *lines, *remarks(self.remarks), *self.end)

    def drawings(self) -> "dict[str, Figure]":
        """Receptances before and after, and how errors grow."""
        from planner.report.milling_plots import coupling_figure

        before = "as measured" if self.reference is None else f"measured: {self.reference}"
        return {"coupling": coupling_figure(self.before, self.coupled, before)}


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
    return CouplingReport(tool, reference, pose, str(npz.resolve()), before, coupled)
