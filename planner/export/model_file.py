"""The predicted model as one small file: modes over the workspace, to be interpolated."""

import numpy as np
from scipy.interpolate import RBFInterpolator

from planner.campaign.campaign import Campaign
from planner.errors import InputError
from planner.export.collected import ExportData
from planner.recording.joints import SCALES

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
