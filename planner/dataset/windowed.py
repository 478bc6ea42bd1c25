"""Recordings as the diagnosis uses them: FRFs whose decays are over when the records end."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.dataset.recorded import Recorded, read_recorded
from planner.dataset.visits import Recorded as Visits
from planner.frf.estimator import estimate
from planner.frf.frf import Frf
from planner.frf.weighted import weighted
from planner.recording.records import Hit

OVER = 5.5  # e^−OVER of the slowest decay is left where the record ends


def read_ended(
    folder: Path,
    joint_names: tuple[str, ...],
    band_hz: tuple[float, float],
    window_rate_1_s: float = 0.0,
    progress: Callable[[str], None] = lambda text: None,
) -> Recorded:
    """As `identify.recorded.read_recorded`, with an exponential window that ends the decays.

    What it does is part of the model (`Frf.exponential_rate_1_s`); `window_rate_1_s` is that of
    one which the analyser laid over all channels. Raises as that does.
    """

    def ended(hits: tuple[Hit, ...], frf: Frf) -> Frf:
        return _ended(hits, frf, band_hz, window_rate_1_s)

    return read_recorded(folder, joint_names, band_hz, window_rate_1_s, progress, ended)


def corrected(recorded: Recorded, visits: Visits) -> Recorded:
    """The same with FRFs of hits that were corrected for artefacts, one entry a visit."""
    rate, band = visits.window_rate_1_s, visits.band_hz
    frfs = tuple(_ended(v.hits, estimate(v.hits, band), band, rate) for v in visits.visits)
    poses = tuple(visit.pose for visit in visits.visits)
    return replace(recorded, poses=poses, q=visits.q, frfs=frfs)


def _ended(hits: tuple[Hit, ...], frf: Frf, band_hz: tuple[float, float], stated: float) -> Frf:
    """The FRF again with a window under which decays are over; exported FRFs as they are."""
    if not hits or not np.isfinite(frf.tail_s):
        return frf
    rate = max(0.0, OVER / frf.tail_s - stated)
    again = weighted(hits, band_hz, rate)
    return replace(again, exponential_rate_1_s=rate + stated)
