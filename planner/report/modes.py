"""Answer of `modes`: modes of one pose, of any points, of responses alone, of many poses."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import UNSET
from msgspec import UnsetType as Unset
from rich.console import Group
from rich.table import Table
from rich.text import Text

from planner.campaign.events import MeasuredMode
from planner.campaign.hit_errors import HitErrorEstimate, systematic_errors
from planner.errors import RefusedFile
from planner.modal.modes import Homogeneity, Mode
from planner.recording.dof import Dof
from planner.report.answer import NOT_IN_JSON, Answer
from planner.report.predictions import ExpectedMode
from planner.report.text import ending, remarks, table, with_sd
from planner.words import counted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from planner.campaign.survey import Survey

SURE = 0.9  # probability of a label below which the text marks it as doubtful


@dataclass(frozen=True, eq=False, kw_only=True)
class ModeAnswer:
    """A mode with its sds; `probability`: that it is physical. What is not known of it is UNSET.

    `label` counts the modelled modes from 1, None: it is none of them. `shape` has an entry per
    response, in kg^-1/2 (unit modal mass) where `scaled`, else of unit length; `shape_sd` is of
    real and imaginary part each; `modal_mass_kg` belongs to the shape with largest component 1.
    `residue` is (real, imaginary, sd) in m/(N·s) of each response to each hit, row by row. Without
    reciprocity it is right · leftᵀ / (2iω_d): `left` is per hit axis or reference, `right`
    per response (else the shape), both with sds; `participation_percent` is the size of each of
    `left` over the largest. `modal_stiffness_n_m` is ω²m/φ² of each response hit where it is felt,
    None where none was. `scatter_hz`: how the frequency differs from set to set (sd).
    `sensors_lowered_percent`: what the sensors' masses had lowered the frequency by, which is given
    without them; None where the simulation has no such mode. `expected`: what the model said before
    an import.
    """

    label: int | Unset | None = UNSET
    label_probability: float | Unset | None = UNSET
    frequency_hz: float
    frequency_sd_hz: float
    damping_ratio: float
    damping_sd: float
    shape: np.ndarray
    shape_sd: np.ndarray | Unset = UNSET
    scaled: bool | Unset = UNSET
    probability: float
    mpc: float | Unset = UNSET
    mpd_deg: float | Unset = UNSET
    modal_mass_kg: float | Unset = UNSET
    modal_stiffness_n_m: np.ndarray | Unset = UNSET
    modal_stiffness_sd_n_m: np.ndarray | Unset = UNSET
    right: np.ndarray | Unset = UNSET
    right_sd: np.ndarray | Unset = UNSET
    left: np.ndarray | Unset = UNSET
    left_sd: np.ndarray | Unset = UNSET
    participation_percent: np.ndarray | Unset = UNSET
    scatter_hz: float | Unset = UNSET
    residue: np.ndarray | Unset = UNSET
    sensors_lowered_percent: float | Unset | None = UNSET
    expected: ExpectedMode | Unset | None = UNSET

    @classmethod
    def of(cls, mode: "Mode | MeasuredMode", **more: Any) -> "ModeAnswer":
        """Of a mode of any modal analysis, with other fields where they are known."""
        common = "frequency_hz", "frequency_sd_hz", "damping_ratio", "damping_sd", "probability"
        own: dict[str, Any] = {name: getattr(mode, name) for name in common}
        if isinstance(mode, Mode):
            own |= {"shape": mode.shape} | _vectors(mode)
        else:
            own["shape"] = np.array(mode.shape) @ [1, 1j]
        return cls(**(own | more))

    def cells(self, dofs: "tuple[tuple[int | str, str], ...] | Unset") -> tuple[str, ...]:
        """A row of the table: a shape of few responses, or where one of many is largest."""
        first = with_sd(self.frequency_hz, self.frequency_sd_hz, ".3f")
        physical = f"{100 * self.probability:.0f}"
        if isinstance(dofs, Unset):
            damping = with_sd(100 * self.damping_ratio, 100 * self.damping_sd)
            parts = [f"{v.real:+.2f}{v.imag:+.2f}i" for v in self.shape]
            more = f"  and {len(parts) - 3} more" if len(parts) > 4 else ""
            return first, damping, "  ".join(parts[:3] if more else parts) + more, physical
        at = " ".join(map(str, dofs[int(np.argmax(np.abs(self.shape)))])).strip()
        mass = f"{self.modal_mass_kg:.3g}" if self.scaled is True else "not scaled"
        damping = with_sd(100 * self.damping_ratio, 100 * self.damping_sd, ".3f")
        return first, damping, f"{self.mpc:.3f}", f"{self.mpd_deg:.1f}", mass, at, physical

    @property
    def short(self) -> str:
        """Frequency (Hz), marked where its label is in doubt."""
        sure = self.label_probability
        return f"{self.frequency_hz:.2f}{' ?' if isinstance(sure, float) and sure < SURE else ''}"


def _vectors(mode: Mode) -> dict[str, Any]:
    """Shape or residues, what hits drive, how points move, and how stiff a mode is there."""
    told: dict[str, Any] = {}
    if mode.shape_sd is not None:
        told |= {
            "shape_sd": mode.shape_sd, "scaled": mode.scaled, "mpc": mode.collinearity,
            "mpd_deg": mode.deviation_deg, "modal_mass_kg": mode.modal_mass_kg,
            "scatter_hz": mode.scatter_hz,
        }  # fmt: skip
    else:
        parts = mode.residue.real, mode.residue.imag, mode.residue_sd
        told["residue"] = np.stack(list(map(np.ravel, parts)), axis=-1)
    stiffness, sd = mode.modal_stiffness_n_m
    if np.any(np.isfinite(stiffness)):
        told |= {"modal_stiffness_n_m": stiffness, "modal_stiffness_sd_n_m": sd}
    if mode.vectors is not None:
        told |= {"right": mode.vectors.right, "right_sd": mode.vectors.right_sd}
    left, sd = mode.driven
    if np.any(np.abs(left) > 0):
        share = 100 * np.abs(left) / np.nanmax(np.abs(left))
        told |= {"left": left, "left_sd": sd, "participation_percent": share}
    return told


@dataclass(frozen=True)
class SurveyedPose:
    """The modes of a pose, by label, and those without."""

    pose: str
    modes: tuple[ModeAnswer, ...]
    unlabelled: tuple[ModeAnswer, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class ModesReport(Answer):
    """Answer of `modes`; what an analysis does not have is UNSET.

    `poses` of a folder with several, `modes` are then those of the first. `dofs` are [node,
    direction] of every entry of a shape, `responses` and `references` those of right and left
    vectors, `frfs` how many FRFs there were, `hits` how many were averaged per axis. `fit_error` is
    ‖H − fit‖/‖H‖ in the band, None for unscaled FRFs; `tones_hz` are a machine's, not the
    structure's.
    """

    poses: tuple[SurveyedPose, ...] | Unset = UNSET
    modes: tuple[ModeAnswer, ...]
    dofs: tuple[tuple[int | str, str], ...] | Unset = UNSET
    responses: tuple[tuple[int | str, str], ...] | Unset = UNSET
    references: tuple[tuple[int | str, str], ...] | Unset = UNSET
    frfs: int | Unset = UNSET
    scaled: bool | Unset = UNSET
    band_hz: tuple[float, float]
    tones_hz: tuple[float, ...] | Unset = UNSET
    fit_error: float | Unset | None = UNSET
    order: int | Unset = UNSET
    refused: tuple[RefusedFile, ...] = ()
    accepted: tuple[str, ...] | Unset = UNSET
    hits: tuple[int, int, int] | Unset = UNSET
    usable_band_hz: tuple[float, float] | Unset = UNSET
    remarks: tuple[str, ...] = ()
    amplitude: Homogeneity | Unset | None = UNSET
    simulated: bool
    exports: tuple[str, ...] | Unset = UNSET
    plots: tuple[str, ...] = ()
    rrd: str | None = None
    hit_errors: tuple[HitErrorEstimate, ...] | Unset = UNSET
    habits: tuple[str, ...] | Unset = UNSET
    survey: "Survey | None" = field(default=None, repr=False, metadata=NOT_IN_JSON)

    def drawings(self) -> "dict[str, Figure]":
        """Frequencies pose by pose."""
        if self.survey is None:
            return {}
        from planner.report.modal_plots import frequency_figure

        survey, tracks, expected = self.survey, self.survey.tracks, self.survey.simulated_hz
        rows = [[m.frequency_sd_hz if m else np.nan for m in row] for row in tracks.modes]
        sd = np.array(rows, dtype=float).reshape(tracks.probability.shape)
        seen = np.any(np.isfinite(tracks.frequency_hz), axis=0)
        simulated = None if expected is None else expected[:, seen]
        names = [f"mode {k + 1}" for k in np.flatnonzero(seen)]  # numbers as in the table
        known = tracks.frequency_hz[:, seen], sd[:, seen], simulated
        return {"campbell": frequency_figure(survey.poses, names, *known, "Campbell diagram")}

    def text(self) -> Group:
        """The modes as a table."""
        parts: list[Any] = [self._table() if isinstance(self.poses, Unset) else self._by_pose()]
        if isinstance(self.habits, tuple):
            parts.append(Text("  ?: the label is less than 90 % sure."))
            parts += [Text(f"  {habit}") for habit in self.habits]
        parts += remarks(self.remarks)
        if isinstance(self.exports, tuple) and self.exports:
            parts.append(Text("\n  ".join(["Files:", *self.exports])))
        return Group(*parts, *ending(vars(self)))

    def _table(self) -> Table:
        what = "Modes" if isinstance(self.tones_hz, Unset) else "Operating modes"
        title = f"{what} between {self.band_hz[0]:g} and {self.band_hz[1]:g} Hz"
        title += " (unscaled)" if self.scaled is False else ""
        if isinstance(self.frfs, int) and isinstance(self.dofs, tuple):
            points = counted(len(self.dofs), "degree of freedom", "degrees of freedom")
            title += f" from {counted(self.frfs, 'FRF')}, {points}"
        if isinstance(self.fit_error, float):
            title += f" (fit error {100 * self.fit_error:.1f} %)"
        many = "MPC", "MPD (°)", "modal mass (kg)", "largest at"
        shape = ("shape x, y, z",) if isinstance(self.dofs, Unset) else many
        columns = "mode", "frequency (Hz)", "damping (%)", *shape, "physical (%)"
        rows = ((str(k), *mode.cells(self.dofs)) for k, mode in enumerate(self.modes, 1))
        return table(title, *columns, rows=rows)

    def _by_pose(self) -> Table:
        poses = self.poses if isinstance(self.poses, tuple) else ()
        labels = sorted({m.label for p in poses for m in p.modes if isinstance(m.label, int)})
        low, high = self.band_hz
        made = table(
            f"Modes of {counted(len(poses), 'pose')} between {low:g} and {high:g} Hz",
            *("pose", *(f"mode {label} (Hz)" for label in labels), "without label (Hz)"),
        )
        for pose in poses:
            by_label = {mode.label: mode.short for mode in pose.modes}
            others = "  ".join(mode.short for mode in pose.unlabelled)
            made.add_row(pose.pose, *(by_label.get(label, "–") for label in labels), others)
        return made


def named(dof: Dof) -> tuple[int | str, str]:
    """Node (a number where it is one) and direction, as answers name a degree of freedom."""
    return (int(dof.node) if dof.node.lstrip("-").isdigit() else dof.node), dof.direction


def survey_report(found: "Survey") -> ModesReport:
    """Of the labelled modes of all poses."""
    tracks, bare, poses = found.tracks, found.bare, []
    for i, name in enumerate(found.poses):

        def answer(mode: Any, label: int | None, sure: float | None, i: int = i) -> ModeAnswer:
            known = {"label": label, "label_probability": sure}
            return ModeAnswer.of(mode, **known, sensors_lowered_percent=bare.of(i, mode))

        modes = tuple(
            answer(mode, k + 1, float(tracks.probability[i, k]))
            for k, mode in enumerate(tracks.modes[i])
            if mode is not None
        )
        others = tuple(answer(mode, None, None) for mode in tracks.unexpected[i])
        poses.append(SurveyedPose(name, modes, others))
    hits = tuple(hit for own in found.hit_errors.poses.values() for hit in own)
    return ModesReport(
        poses=tuple(poses), modes=poses[0].modes, band_hz=found.band_hz, refused=found.refused,
        remarks=found.remarks, simulated=found.simulated, hit_errors=hits,
        habits=systematic_errors(hits), survey=found,
    )  # fmt: skip
