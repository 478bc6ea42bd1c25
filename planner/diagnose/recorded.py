"""Recordings as the diagnosis uses them: hits in order, and FRFs whose decays are over in time."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.errors import RefusedError
from planner.frf.types import Frf
from planner.frf.weighted import weighted
from planner.modes.measure import Source, average
from planner.recording.folder import read_recordings
from planner.recording.types import Hit, PoseRow

OVER = 5.5  # e^−OVER of the slowest decay is left where the record ends


@dataclass(frozen=True, eq=False)
class Recorded:
    """Poses in the order of the table: names, angles q (n, dof) in rad, FRFs, accepted hits.

    `places` (per pose, per hit) are the hits' rows in the table, counted from 0: their order in
    time. `refused` names the files that could not be used, each with its reason.
    """

    poses: tuple[str, ...]
    q: np.ndarray
    frfs: tuple[Frf, ...]
    hits: tuple[tuple[Hit, ...], ...]
    places: tuple[tuple[int, ...], ...]
    refused: tuple[tuple[str, str], ...]
    remarks: tuple[str, ...]
    simulated: bool


def read_recorded(
    folder: Path,
    joint_names: tuple[str, ...],
    band_hz: tuple[float, float],
    window_rate_1_s: float = 0.0,
    progress: Callable[[str], None] = lambda text: None,
) -> Recorded:
    """Read and screen all hits of a folder with recordings.csv, and average them per pose.

    An exponential window makes decays end with the record; what it does is part of the model
    (`Frf.exponential_rate_1_s`). `window_rate_1_s` is that of one which the analyser laid over
    all channels. Raises InputError where the table is wrong, RefusedError where nothing is left.
    """
    groups: dict[str, list[tuple[int, PoseRow]]] = {}
    for place, row in enumerate(read_recordings(folder, joint_names).rows):
        groups.setdefault(row.pose, []).append((place, row))
    found, refused, remarks, simulated = [], [], [], False
    for number, (pose, rows) in enumerate(groups.items()):
        progress(f"reading pose {pose}, {number} of {len(groups)} done")
        sources = tuple(Source(r.file, str(r.file), r.hit, r.repeat) for _, r in rows if r.file)
        measured = average(sources, band_hz, window_rate_1_s=window_rate_1_s)
        refused += [(v.source.name, v.reason) for v in measured.verdicts if not v.accepted]
        simulated |= any(v.simulated for v in measured.verdicts)
        if measured.frf is None:
            remarks.append(f"Pose {pose} is left out: {measured.remarks[0]}")
            continue
        kept = {r.file: place for place, r in rows}
        places = tuple(kept[hit.source] for hit in measured.hits if hit.source in kept)
        q = np.deg2rad(np.mean([r.joints_deg for _, r in rows], axis=0))
        frf = _ended(measured.hits, measured.frf, band_hz, window_rate_1_s)
        found.append((pose, q, frf, measured.hits, places))
    if not found:
        reason = refused[0][1] if refused else remarks[0]
        raise RefusedError(f"{folder}: no pose has a hit that can be used: {reason}")
    poses, q, frfs, hits, places = zip(*found, strict=True)
    rest = tuple(refused), tuple(remarks), simulated
    return Recorded(poses, np.array(q), frfs, hits, places, *rest)


def _ended(hits: tuple[Hit, ...], frf: Frf, band_hz: tuple[float, float], stated: float) -> Frf:
    """The FRF again with a window under which decays are over; exported FRFs as they are."""
    if not hits or not np.isfinite(frf.tail_s):
        return frf
    rate = max(0.0, OVER / frf.tail_s - stated)
    again = weighted(hits, band_hz, rate)
    return replace(again, exponential_rate_1_s=rate + stated)
