"""Answer of `modes`: modes of one pose, of any points, of responses alone, of many poses."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text

from planner.campaign.events import MeasuredMode
from planner.modal.modes import Mode
from planner.recording.points import Dof
from planner.report.answer import Done
from planner.report.pictures import Pictures
from planner.report.text import ending, remarks, table, with_sd
from planner.words import counted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from planner.campaign.survey import Survey

SURE = 0.9  # probability of a label below which the text marks it as doubtful


def mode_keys(mode: Mode | MeasuredMode, **more: Any) -> dict[str, Any]:
    """A mode of any modal analysis in JSON; what is not known of it has no key.

    "probability": that it is physical. "label" counts the modelled modes from 1, None: it is none
    of them. "shape" has an entry per response, in kg^-1/2 (unit modal mass) where "scaled", else of
    unit length; "shape_sd" is of real and imaginary part each; "modal_mass_kg" belongs to the shape
    with largest component 1. "residue" is (real, imaginary, sd) in m/(N·s) of each response to each
    hit, row by row. Without reciprocity it is right · leftᵀ / (2iω_d): "left" is per hit axis or
    reference, "right" per response (else the shape), both with sds; "participation_percent" is the
    size of each of "left" over the largest. "modal_stiffness_n_m" is ω²m/φ² of each response hit
    where it is felt, None where none was. "scatter_hz": how the frequency differs from set to set
    (sd). "sensors_lowered_percent": what the sensors' masses had lowered the frequency by, which is
    given without them; None where the simulation has no such mode. "expected": what the model said
    before an import.
    """
    common = "frequency_hz", "frequency_sd_hz", "damping_ratio", "damping_sd", "probability"
    own = {name: getattr(mode, name) for name in common}
    if isinstance(mode, Mode):
        own |= {"shape": mode.shape} | _vectors(mode)
    else:
        own["shape"] = np.array(mode.shape) @ [1, 1j]
    return own | more


def _cells(
    mode: Mapping[str, Any], dofs: Sequence[tuple[int | str, str]] | None
) -> tuple[str, ...]:
    """A row of the table: a shape of few responses, or where one of many is largest."""
    first = with_sd(mode["frequency_hz"], mode["frequency_sd_hz"], ".3f")
    physical, percent = f"{100 * mode['probability']:.0f}", 100 * mode["damping_ratio"]
    if dofs is None:
        damping = with_sd(percent, 100 * mode["damping_sd"])
        parts = [f"{v.real:+.2f}{v.imag:+.2f}i" for v in mode["shape"]]
        more = f"  and {len(parts) - 3} more" if len(parts) > 4 else ""
        return first, damping, "  ".join(parts[:3] if more else parts) + more, physical
    at = " ".join(map(str, dofs[int(np.argmax(np.abs(mode["shape"])))])).strip()
    mass = f"{mode['modal_mass_kg']:.3g}" if mode.get("scaled") is True else "not scaled"
    damping = with_sd(percent, 100 * mode["damping_sd"], ".3f")
    return first, damping, f"{mode['mpc']:.3f}", f"{mode['mpd_deg']:.1f}", mass, at, physical


def _short(mode: Mapping[str, Any]) -> str:
    """Frequency (Hz), marked where its label is in doubt."""
    sure = mode["label_probability"]
    return f"{mode['frequency_hz']:.2f}{' ?' if sure is not None and sure < SURE else ''}"


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


def modes_answer(**keys: Any) -> Done:
    """Answer of `modes`, of such keys of its JSON; what an analysis does not have has no key.

    "poses" of a folder with several, "modes" are then those of the first. "dofs" are [node,
    direction] of every entry of a shape, "responses" and "references" those of right and left
    vectors, "frfs" how many FRFs there were, "hits" how many were averaged per axis. "fit_error" is
    ‖H − fit‖/‖H‖ in the band, None for unscaled FRFs; "tones_hz" are a machine's, not the
    structure's.
    """
    keys = {"refused": (), "remarks": ()} | keys
    parts: list[Any] = [_by_pose(keys) if "poses" in keys else _table(keys)]
    if "habits" in keys:
        parts.append(Text("  ?: the label is less than 90 % sure."))
        parts += [Text(f"  {habit}") for habit in keys["habits"]]
    parts += remarks(keys["remarks"])
    if keys.get("exports"):
        parts.append(Text("\n  ".join(["Files:", *keys["exports"]])))
    return Done(keys, Group(*parts, *ending(keys)))


def _table(keys: Mapping[str, Any]) -> Table:
    what, dofs = "Operating modes" if "tones_hz" in keys else "Modes", keys.get("dofs")
    title = f"{what} between {keys['band_hz'][0]:g} and {keys['band_hz'][1]:g} Hz"
    title += " (unscaled)" if keys.get("scaled") is False else ""
    if "frfs" in keys:
        points = counted(len(keys["dofs"]), "degree of freedom", "degrees of freedom")
        title += f" from {counted(keys['frfs'], 'FRF')}, {points}"
    if keys.get("fit_error") is not None:
        title += f" (fit error {100 * keys['fit_error']:.1f} %)"
    many = "MPC", "MPD (°)", "modal mass (kg)", "largest at"
    shape = ("shape x, y, z",) if dofs is None else many
    columns = "mode", "frequency (Hz)", "damping (%)", *shape, "physical (%)"
    rows = ((str(k), *_cells(mode, dofs)) for k, mode in enumerate(keys["modes"], 1))
    return table(title, *columns, rows=rows)


def _by_pose(keys: Mapping[str, Any]) -> Table:
    poses, (low, high) = keys["poses"], keys["band_hz"]
    labels = sorted({mode["label"] for pose in poses for mode in pose["modes"]})
    made = table(
        f"Modes of {counted(len(poses), 'pose')} between {low:g} and {high:g} Hz",
        *("pose", *(f"mode {label} (Hz)" for label in labels), "without label (Hz)"),
    )
    for pose in poses:
        by_label = {mode["label"]: _short(mode) for mode in pose["modes"]}
        others = "  ".join(map(_short, pose["unlabelled"]))
        made.add_row(pose["pose"], *(by_label.get(label, "–") for label in labels), others)
    return made


def named(dof: Dof) -> tuple[int | str, str]:
    """Node (a number where it is one) and direction, as answers name a degree of freedom."""
    return (int(dof.node) if dof.node.lstrip("-").isdigit() else dof.node), dof.direction


def survey_report(found: "Survey", pictures: Pictures, folder: str) -> Done:
    """Of the labelled modes of all poses; their frequencies are drawn pose by pose."""
    from planner.campaign.hit_errors import systematic_errors

    tracks, bare, poses = found.tracks, found.bare, []
    for i, name in enumerate(found.poses):

        def answer(
            mode: Any, label: int | None = None, sure: float | None = None, i: int = i
        ) -> dict[str, Any]:
            known = {"label": label, "label_probability": sure}
            return mode_keys(mode, **known, sensors_lowered_percent=bare.of(i, mode))

        modes = [
            answer(mode, k + 1, float(tracks.probability[i, k]))
            for k, mode in enumerate(tracks.modes[i])
            if mode is not None
        ]
        others = list(map(answer, tracks.unexpected[i]))
        poses.append({"pose": name, "modes": modes, "unlabelled": others})
    hits = tuple(hit for own in found.hit_errors.poses.values() for hit in own)
    written = pictures.write(lambda: _campbell(found), folder, simulated=found.simulated)
    return modes_answer(
        poses=poses, modes=poses[0]["modes"], band_hz=found.band_hz, refused=found.refused,
        remarks=found.remarks, simulated=found.simulated, hit_errors=hits,
        habits=systematic_errors(hits), **written,
    )  # fmt: skip


def _campbell(found: "Survey") -> "dict[str, Figure]":
    from planner.report.modal_plots import frequency_figure

    tracks, expected = found.tracks, found.simulated_hz
    rows = [[m.frequency_sd_hz if m else np.nan for m in row] for row in tracks.modes]
    sd = np.array(rows, dtype=float).reshape(tracks.probability.shape)
    seen = np.any(np.isfinite(tracks.frequency_hz), axis=0)
    simulated = None if expected is None else expected[:, seen]
    names = [f"mode {k + 1}" for k in np.flatnonzero(seen)]  # numbers as in the table
    known = tracks.frequency_hz[:, seen], sd[:, seen], simulated
    return {"campbell": frequency_figure(found.poses, names, *known, "Campbell diagram")}
