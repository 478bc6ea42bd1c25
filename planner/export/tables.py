"""FRFs and modes as CSV tables and as a MAT file."""

import csv
import io
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from planner.export.collected import ExportData

AXES = "xyz"


def modes_csv(found: ExportData) -> str:
    """Measured and predicted modes, one a row: Hz, ratios, and their standard deviations."""
    header = ["source", "pose", *found.joints.columns, "mode", "frequency_hz", "frequency_sd_hz",
              "damping_ratio", "damping_sd"]  # fmt: skip
    header += [f"shape_{a}_{part}" for a in AXES for part in ("re", "im")]
    rows: list[list[object]] = []
    for one in found.measured:
        for k, m in enumerate(one.modes, 1):
            shape = [v for pair in m.shape for v in pair]
            numbers = m.frequency_hz, m.frequency_sd_hz, m.damping_ratio, m.damping_sd
            rows.append(["measured", one.pose, *one.joints_deg, k, *numbers, *shape])
    modes = found.modes
    for i, pose in enumerate(found.poses):
        for k in range(modes.frequency_hz.shape[1]):
            columns = modes.frequency_hz, modes.frequency_sd_hz, modes.damping_ratio
            numbers = [float(c[i, k]) for c in (*columns, modes.damping_sd)]
            there = pose, *found.joints_deg[i].tolist(), k + 1
            rows.append(["predicted", *there, *numbers, *[""] * 6])
    return _text(found, header, rows)


def frfs_csv(found: ExportData) -> str:
    """Measured and predicted accelerances in m/s²/N, one line of one FRF a row."""
    numbers = [f"{part}_m_s2_per_n" for part in ("real", "imag", "sd")]
    header = ["source", "pose", "response", "hit", "frequency_hz", *numbers, "coherence"]
    return _text(found, header, _frf_rows(found))


def _frf_rows(found: ExportData) -> Iterator[list[object]]:
    hz = found.frequency_hz
    low, high = (hz[0], hz[-1]) if len(hz) else (0.0, 0.0)
    for one in found.measured:
        frf = one.frf.within((float(low), float(high)))
        sd = np.sqrt(frf.variance)
        for i, j in np.ndindex(3, 3):
            if frf.measured[j]:
                rows = zip(frf.frequency_hz, frf.accelerance[i, j], sd[i, j], frf.coherence[i, j],
                           strict=True)  # fmt: skip
                for f, h, s, c in rows:
                    yield ["measured", one.pose, AXES[i], AXES[j], f, h.real, h.imag, s, c]
    for n, pose in enumerate(found.poses):
        for i, j in np.ndindex(3, 3):
            rows = zip(hz, found.frf_mean[n, i, j], found.frf_sd[n, i, j], strict=True)
            for f, h, s in rows:
                yield ["predicted", pose, AXES[i], AXES[j], f, h.real, h.imag, s, ""]


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
    modes = found.modes
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
        "mode_frequency_hz": modes.frequency_hz,
        "mode_frequency_sd_hz": modes.frequency_sd_hz,
        "mode_damping_ratio": modes.damping_ratio,
        "mode_damping_sd": modes.damping_sd,
    }
    if any(found.joints.slides):
        made["joint_units"] = np.array(found.joints.units, dtype=object)
    cells = [
        {
            "pose": one.pose,
            "joints_deg": np.array(one.joints_deg),
            "frequency_hz": one.frf.frequency_hz,
            "accelerance": one.frf.accelerance,
            "coherence": one.frf.coherence,
            "variance": one.frf.variance,
            "mode_frequency_hz": np.array([m.frequency_hz for m in one.modes]),
            "mode_frequency_sd_hz": np.array([m.frequency_sd_hz for m in one.modes]),
            "mode_damping_ratio": np.array([m.damping_ratio for m in one.modes]),
            "mode_shape": np.array([[complex(*v) for v in m.shape] for m in one.modes]),
        }
        for one in found.measured
    ]
    made["measured"] = np.array(cells, dtype=object)
    return made
