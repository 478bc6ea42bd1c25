"""Hits as CSV files, as a spreadsheet or a simple analyser exports them."""

from pathlib import Path

import numpy as np

from planner.recording.records import Hit

HEADER = "time_s,force_n,acceleration_x_m_s2,acceleration_y_m_s2,acceleration_z_m_s2"


def write_csv(target: Path, hit: Hit, rate_hz: float | None = None, stated: bool = True) -> Path:
    """A hit of the tool, at about a whole part of its rate; its axis is `stated` or not."""
    rate = rate_hz or hit.sampling_rate_hz
    step = round(hit.sampling_rate_hz / rate)
    samples = np.vstack([hit.force_n, hit.acceleration_m_s2])[:, ::step]
    columns = np.column_stack([np.arange(samples.shape[1]) / rate, samples.T])
    header = f"# hit: {hit.axis}\n{HEADER}" if stated else HEADER
    np.savetxt(target, columns, delimiter=",", header=header, comments="", fmt="%.9g")
    return target
