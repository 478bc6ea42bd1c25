"""Answer of `couple`: the FRFs of another tool, how sure they are, and the hit that would tell."""

from pathlib import Path
from typing import Any

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
from planner.report.answer import Done
from planner.report.pictures import Pictures
from planner.report.text import ending, remarks, table


def _amplified(coupled: CoupledFrf) -> dict[str, Any]:
    """How noise grows: the worst line, the limit, and the bands (Hz) in which it is exceeded."""
    values, f = coupled.amplification, coupled.frequency_hz
    worst = int(np.argmax(values))
    over = np.ma.clump_masked(np.ma.masked_greater(values, AMPLIFICATION_LIMIT))
    bands = [(float(f[part.start]), float(f[part.stop - 1])) for part in over]
    return {"worst": float(values[worst]), "at_hz": float(f[worst]), "limit": AMPLIFICATION_LIMIT,
            "above_limit_hz": bands}  # fmt: skip


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
    both: tuple[CoupledFrf, CoupledFrf], names: tuple[str | None, str], pose: str, npz: Path,
    contact: dict[str, Any] | msgspec.UnsetType, pictures: Pictures,
) -> Done:  # fmt: skip
    """Answer of `couple`, once the npz is written; receptances in m/N, FRFs of `npz` in m/s²/N.

    `both` are the tip with the tested tool and with the one put on, `names` those of the tools;
    None: none was stated to be on. "frequency_hz" is the band of so many "lines", "motions" are
    those that are known.
    """
    (before, coupled), (reference, tool) = both, names
    save_coupled(npz, coupled, pose)
    peaks, verify, grown = resonances(coupled), verifying_hit(coupled), _amplified(coupled)
    told = _remarks(coupled, grown["above_limit_hz"])

    def draw():
        from planner.report.milling_plots import coupling_figure

        said = "as measured" if reference is None else f"measured: {reference}"
        return {"coupling": coupling_figure(before, coupled, said)}

    keys = {
        "tool": tool, "reference": reference, "pose": pose, "npz": str(npz.resolve()),
        "frequency_hz": coupled.frequency_hz[[0, -1]], "lines": len(coupled.frequency_hz),
        "motions": [MOTIONS[k] for k in coupled.kept], "resonances": peaks,
        "amplification": grown, "verify": verify, "contact": contact,
        "simulated": coupled.simulated, "remarks": told,
        **pictures.write(draw, f"{tool} at {pose}", simulated=coupled.simulated),
    }  # fmt: skip
    columns = "direction", "peak (Hz)", "receptance (µm/N)", "sd (%)", "amplification"
    rows = [
        (p.direction, f"{p.frequency_hz:.4g}", f"{1e6 * p.receptance_m_n:.3g}",
         f"{p.sd_percent:.1f}", f"{p.amplification:.2f}")
        for p in peaks
    ]  # fmt: skip
    lines = [
        f"Errors grow at most {grown['worst']:.3g} times, at {grown['at_hz']:.4g} Hz.",
        verify.sentence,
        f"FRFs (m/s²/N) with sd: {keys['npz']}",
        *([_contact_sentence(contact)] if isinstance(contact, dict) else []),
    ]
    made = table(f"{tool} at {pose}", *columns, rows=rows)
    return Done(keys, Group(made, *map(Text, lines), *remarks(told), *ending(keys)))


def _remarks(coupled: CoupledFrf, bands: list[tuple[float, float]]) -> list[str]:
    """What the engineer should mind; `bands` (Hz) are those above the limit."""
    told = list(coupled.remarks)
    if bands:
        where = ", ".join(f"{low:.4g} to {high:.4g} Hz" for low, high in bands[:3])
        told.append(
            f"Errors of the measured FRFs grow more than {AMPLIFICATION_LIMIT:g} times at "
            f"{where}{', …' if len(bands) > 3 else ''}: do not rely on the coupled FRFs there."
        )
    held = ", ".join(MOTIONS[k] for k in range(3) if k not in coupled.kept)
    if held:
        told.append(f"Nothing was measured along the tool's own {held}: FRFs there are NaN.")
    return told
