"""Answer of `modes --operating`: modes from responses alone, without a scale."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Group
from rich.text import Text

from planner.errors import InputError
from planner.modal.modes import Mode
from planner.modal.operating import OperatingModes, operating_modes
from planner.recording.dof import Dof
from planner.recording.filling import lost_samples
from planner.recording.read import read
from planner.recording.records import Channel, TimeRecord
from planner.report.answer import Answer, RefusedFile
from planner.report.matrix_analysis import ModeOverPoints, named
from planner.report.modal_analysis import LONGEST_NAME, NOT_DRAWN, check_options, sources_of
from planner.report.plot_files import Pictures
from planner.report.text import SIMULATED, drawn, remarks, table, with_sd

RESPONSES = ("acceleration", "velocity", "displacement", "voltage", "unknown")
UNSCALED = (
    "UNSCALED: modes are from responses alone; their shapes have no scale and give no FRFs or "
    "modal masses."
)


@dataclass(frozen=True)
class UnscaledMode(ModeOverPoints):
    """A mode known from responses alone; `shape` is [re, im] per `dofs`, of unit length."""

    @classmethod
    def of(cls, mode: Mode) -> "UnscaledMode":
        """Of an operating mode."""
        return cls(
            mode.frequency_hz, mode.frequency_sd_hz, mode.damping_ratio, mode.damping_sd,
            tuple((float(s.real), float(s.imag)) for s in mode.shape),
            tuple(float(sd) for sd in mode.shape_sd),
            False, mode.probability, mode.collinearity, mode.deviation_deg,
        )  # fmt: skip


@dataclass(frozen=True, eq=False, kw_only=True)
class OperatingReport(Answer):
    """Answer of `modes --operating`; `tones_hz` are a machine's, not the structure's."""

    modes: tuple[UnscaledMode, ...]
    dofs: tuple[tuple[int | str, str], ...]
    scaled: bool = False
    band_hz: tuple[float, float]
    tones_hz: tuple[float, ...]
    refused: tuple[RefusedFile, ...] = ()
    accepted: tuple[str, ...]
    remarks: tuple[str, ...]
    simulated: bool
    plots: tuple[str, ...] = ()
    rrd: str | None = None

    def text(self) -> Group:
        """The modes as a table."""
        low, high = self.band_hz
        made = table(
            f"Operating modes between {low:g} and {high:g} Hz (unscaled)",
            *("mode", "frequency (Hz)", "damping (%)", "MPC", "largest at", "physical (%)"),
        )
        for k, mode in enumerate(self.modes):
            sizes = [abs(complex(*value)) for value in mode.shape]
            node, direction = self.dofs[sizes.index(max(sizes))]
            made.add_row(
                str(k + 1),
                with_sd(mode.frequency_hz, mode.frequency_sd_hz, ".3f"),
                with_sd(100 * mode.damping_ratio, 100 * mode.damping_sd),
                f"{mode.mpc:.3f}",
                f"{node} {direction}",
                f"{100 * mode.probability:.0f}",
            )
        parts: list[Any] = [made, *remarks(self.remarks), *drawn(self.plots, self.rrd)]
        return Group(*parts, SIMULATED) if self.simulated else Group(*parts, Text(""))


def operating_report(
    paths: Sequence[Path], band_hz: tuple[float, float] | None, pictures: Pictures
) -> OperatingReport:
    """Analyse the responses of one record. Raises InputError where a file holds none."""
    check_options(band_hz)
    sources = sources_of(paths)
    if len(sources) != 1:
        raise InputError("--operating analyses one record at a time; name one file.")
    record, channels = _responses(sources[0].path)
    samples = np.array([channel.samples for channel in channels])
    dofs = tuple(_dof(channel) for channel in channels)
    sign = np.array([dof.sign for dof in dofs])
    found = operating_modes(sign[:, None] * samples, record.sampling_rate_hz, band_hz)
    told = [*record.remarks, *(fault.text for fault in lost_samples(record)), UNSCALED]
    if found.tones_hz:
        tones = ", ".join(f"{hz:.4g}" for hz in found.tones_hz)
        told.append(f"Tones, not modes, at {tones} Hz: what turns or hums there was left out.")
    return OperatingReport(
        modes=tuple(UnscaledMode.of(mode) for mode in found.modes),
        dofs=tuple(named(dof.positive) for dof in dofs),
        band_hz=found.band_hz,
        tones_hz=found.tones_hz,
        accepted=(sources[0].name,),
        remarks=tuple(told),
        simulated=record.simulated,
        **_draw(pictures, found, sources[0].path.name, record.simulated),
    )


def _responses(path: Path) -> tuple[TimeRecord, list[Channel]]:
    """The record and its channels that move; those that stand still are left out."""
    records = [record for record in read(path) if isinstance(record, TimeRecord)]
    if not records:
        raise InputError(f"{path} holds no time histories; --operating needs records of responses.")
    channels = [c for c in records[0].channels if c.quantity in RESPONSES and np.ptp(c.samples) > 0]
    if not channels:
        raise InputError(f"{path} holds no response that moves; export accelerations.")
    return records[0], channels


def _dof(channel: Channel) -> Dof:
    stated = channel.node not in ("", "0")
    return Dof.of_uff(channel.node if stated else channel.name, channel.direction)


def _draw(pictures: Pictures, found: OperatingModes, name: str, simulated: bool) -> dict[str, Any]:
    if not pictures.wanted:
        return NOT_DRAWN
    from planner.report.modal_plots import mac_figure
    from planner.report.operating_plots import operating_figure

    mark = "SIMULATED recordings · " if simulated else ""
    name = name[-LONGEST_NAME:]
    figures = {
        "stabilisation": operating_figure(
            found, f"{mark}Stabilisation diagram, responses alone (unscaled) · {name}"
        ),
        "mac": mac_figure(found, f"{mark}AutoMAC, unscaled · {name}"),
    }
    note = f"{mark}Responses alone give no scale: neither FRFs nor modal masses follow."
    return pictures.write(figures, name, note)
