"""What a campaign found, measured and predicted, as CSV tables, a MAT file and a small model."""

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import RBFInterpolator

from planner.campaign.campaign import Campaign
from planner.campaign.state import Measurement
from planner.errors import InputError
from planner.frf.frf import Frf
from planner.recording.joints import SCALES, JointUnits
from planner.recording.records import AXES
from planner.surrogate.frf_bands import ModalPrediction

MODES = "frequency_hz", "frequency_sd_hz", "damping_ratio", "damping_sd"  # what is said of each
# Points of a workspace of up to two coordinates, and of more: 3 and 9 s, 0.1 and 0.6 MB.
FEW_POINTS, MANY_POINTS = 1000, 3000
NEIGHBOURS = 64
CHECKED = 5  # every so many points is left out once to tell the error of interpolating
SEED = 1  # other points than the candidates'

LOADER = """
import numpy as np
from scipy.interpolate import RBFInterpolator

with np.load("{file}") as file:
    m = dict(file)
modes = RBFInterpolator(m["x"], m["values"], neighbors=int(m["neighbours"]), kernel="cubic")

def at(coordinates):  # (n, d): {coordinates}
    v = modes((np.atleast_2d(coordinates) - m["lower"]) / m["span"])
    log_hz, log_sd, damping = np.split(v, 3, axis=1)
    relative = np.hypot(np.exp(log_sd), m["error_percent"] / 100)  # interpolating errs too
    return np.exp(log_hz), np.exp(log_hz) * relative, damping  # Hz, sd in Hz, damping ratio
"""


@dataclass(frozen=True, eq=False)
class ExportData:
    """All of a campaign that other programs can use: measured poses, and the model at n `poses`.

    Measured ones with their likely modes and FRFs; the others with joints (n, dof) in degrees or
    mm, modes, FRFs (n, 3, 3, F) with sd in m/s²/N.
    """

    name: str
    joints: JointUnits
    simulated: bool
    measured: tuple[tuple[Measurement, Frf], ...]
    poses: tuple[str, ...]
    joints_deg: np.ndarray
    frequency_hz: np.ndarray
    frf_mean: np.ndarray
    frf_sd: np.ndarray
    modes: ModalPrediction

    @property
    def label(self) -> str:
        """What stands first in every file."""
        return f"{'SIMULATED ' if self.simulated else ''}planner campaign {self.name}"


def export_data(
    campaign: Campaign, poses: Sequence[str], joints_deg: Sequence[Sequence[float]]
) -> ExportData:
    """Measured poses, and the model's predictions at `poses` (none: at the measured ones)."""
    state, cell = campaign.state, campaign.cell
    used, lines = state.used, campaign.frequency_lines
    names, angles = tuple(poses), np.array(joints_deg, dtype=float)
    if not names:
        names = tuple(m.pose for m in used)
        angles = np.array([m.joints_deg for m in used])
    angles = angles.reshape(len(names), len(cell.robot.joint_names))
    if names:
        q = cell.robot.joints.internal(angles)
        mean, sd = campaign.frf_at(q, lines)
        modes = campaign.model.predict(q)
    else:
        mean, sd = np.empty((0, 3, 3, len(lines)), complex), np.empty((0, 3, 3, len(lines)))
        none = np.empty((0, cell.config.modes.count))
        modes = ModalPrediction(none, none, none, none, np.empty((*none.shape, 3, 3)), none)
    measured = tuple(
        (replace(m, modes=tuple(filter(lambda mode: mode.likely, m.modes))), campaign.frf_of(m))
        for m in used
    )
    found = measured, names, angles, lines, mean, sd, modes
    return ExportData(campaign.directory.name, cell.robot.joints, state.simulated, *found)


def modes_csv(found: ExportData) -> str:
    """Measured and predicted modes, one a row: Hz, ratios, and their standard deviations."""
    header = ["source", "pose", *found.joints.columns, "mode", *MODES]
    header += [f"shape_{a}_{part}" for a in AXES for part in ("re", "im")]
    rows: list[list[object]] = []
    for m, _ in found.measured:
        for k, mode in enumerate(m.modes, 1):
            shape = [v for pair in mode.shape for v in pair]
            numbers = [getattr(mode, name) for name in MODES]
            rows.append(["measured", m.pose, *m.joints_deg, k, *numbers, *shape])
    predicted = np.stack([getattr(found.modes, name) for name in MODES], axis=-1)
    for pose, joints, modes in zip(found.poses, found.joints_deg, predicted, strict=True):
        for k, numbers in enumerate(modes, 1):
            rows.append(["predicted", pose, *joints.tolist(), k, *numbers, *[""] * 6])
    return _text(found, header, rows)


def frfs_csv(found: ExportData) -> str:
    """Measured and predicted accelerances in m/s²/N, one line of one FRF a row."""
    numbers = [f"{part}_m_s2_per_n" for part in ("real", "imag", "sd")]
    header = ["source", "pose", "response", "hit", "frequency_hz", *numbers, "coherence"]
    hz = found.frequency_hz
    band = (float(hz[0]), float(hz[-1])) if len(hz) else (0.0, 0.0)
    known = [("measured", m.pose, frf.within(band)) for m, frf in found.measured]
    blank = np.full(found.frf_mean.shape[1:], "")
    tables = [
        (*which, f.measured, (f.frequency_hz, f.accelerance, np.sqrt(f.variance), f.coherence))
        for *which, f in known
    ]
    tables += [
        ("predicted", pose, np.ones(3, dtype=bool), (hz, mean, sd, blank))
        for pose, mean, sd in zip(found.poses, found.frf_mean, found.frf_sd, strict=True)
    ]
    rows = (
        [source, pose, AXES[i], AXES[j], f, h.real, h.imag, s, c]
        for source, pose, hit, (lines, *parts) in tables
        for i, j in np.ndindex(3, 3) if hit[j]
        for f, h, s, c in zip(lines, *(part[i, j] for part in parts), strict=True)
    )  # fmt: skip
    return _text(found, header, rows)


def _text(found: ExportData, header: list[str], rows: Iterable[list[object]]) -> str:
    """A table; where recordings are simulated every row says so."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    mark = ["simulated"] if found.simulated else []
    writer.writerow([*header, *mark])
    for row in rows:
        shown = [f"{v:.9g}" if isinstance(v, float | np.floating) else v for v in row]
        writer.writerow([*shown, *(["yes"] if mark else [])])
    return out.getvalue()


def mat_arrays(found: ExportData) -> dict[str, Any]:
    """Variables of the MAT file; poses come first in every array."""
    made: dict[str, Any] = {
        "label": found.label,
        "simulated": found.simulated,
        "joint_names": np.array(found.joints.names, dtype=object),
        "predicted_pose": np.array(found.poses, dtype=object),
        "predicted_joints_deg": found.joints_deg,
        "frequency_hz": found.frequency_hz,
        "frf_mean": found.frf_mean,
        "frf_sd": found.frf_sd,
        "frf_unit": "m/s^2/N",
        **{f"mode_{name}": getattr(found.modes, name) for name in MODES},
    }
    if any(found.joints.slides):
        made["joint_units"] = np.array(found.joints.units, dtype=object)
    parts = "frequency_hz", "accelerance", "coherence", "variance"
    cells = [
        {
            "pose": m.pose,
            "joints_deg": np.array(m.joints_deg),
            **{name: getattr(frf, name) for name in parts},
            **{f"mode_{c}": np.array([getattr(mode, c) for mode in m.modes]) for c in MODES},
            "mode_shape": np.array([[complex(*v) for v in mode.shape] for mode in m.modes]),
        }
        for m, frf in found.measured
    ]
    made["measured"] = np.array(cells, dtype=object)
    return made


def model_arrays(campaign: Campaign, found: ExportData) -> dict[str, np.ndarray]:
    """Arrays of the file: points x (n, d), scaled to [0, 1], and values (n, 3 · modes) there.

    Values are ln frequency in Hz, ln of its relative sd, and damping ratio, mode by mode.
    `error_percent` (modes,) is what interpolating adds to the frequencies (root mean square at
    points left out), `largest_error_percent` the largest; `names` say what the coordinates are.
    Where modes cross or veer their frequencies have kinks, which no interpolation meets.
    """
    cell = campaign.cell
    if not cell.workspace.varying.any():
        raise InputError("The workspace is one pose: there is nothing to interpolate; export csv.")
    number = FEW_POINTS if cell.workspace.varying.sum() <= 2 else MANY_POINTS
    points = cell.workspace.candidates(cell.robot, number, SEED)
    p = campaign.model.predict(points.q)
    relative = p.frequency_sd_hz / p.frequency_hz
    values = np.hstack([np.log(p.frequency_hz), np.log(relative), p.damping_ratio])
    if len(x := points.features) < 2 * NEIGHBOURS:
        raise InputError(
            f"Only {len(x)} poses of the workspace can be reached: too few to interpolate; "
            f"export csv."
        )
    ends = [name.rsplit("_", 1)[-1] for name in cell.workspace.feature_names]
    scale = np.array([SCALES.get(end, 1.0) for end in ends])
    varying = cell.workspace.varying
    lower = cell.workspace.lower[varying] * scale
    span = (cell.workspace.upper - cell.workspace.lower)[varying] * scale
    error = _errors(x, values[:, : p.frequency_hz.shape[1]])
    return {
        "x": x,
        "values": values,
        "lower": lower,
        "span": span,
        "names": np.array(cell.workspace.feature_names),
        "neighbours": np.array(min(NEIGHBOURS, len(x))),
        "error_percent": np.sqrt(np.mean(error**2, axis=0)),
        "largest_error_percent": error.max(axis=0),
        "measurements": np.array(len(found.measured)),
        "label": np.array(found.label),
    }


def _errors(x: np.ndarray, log_hz: np.ndarray) -> np.ndarray:
    """Errors (m, modes) in % at points that were left out of the interpolation."""
    out = np.arange(len(x)) % CHECKED == 0
    near = min(NEIGHBOURS, int((~out).sum()))
    met = RBFInterpolator(x[~out], log_hz[~out], neighbors=near, kernel="cubic")(x[out])
    return 100 * np.abs(np.expm1(met - log_hz[out]))
