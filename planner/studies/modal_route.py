"""An FRF over a sweep by its modes: estimated at every angle, fused, synthesised again.

To a surface of amplitudes a moving peak is one that ends and one that begins; to its mode it is a
frequency that changes smoothly, and that the simulation follows.
"""

import numpy as np

from planner.modal.tracking import Guide, Tracks, track
from planner.progress import quietly
from planner.studies.busch2020_data import ACROSS, BAND_HZ, BEYOND_DEG, SWEEP_DEG, Sweep
from planner.surrogate.frf_bands import frf_moments
from planner.surrogate.modal_surrogate import ModalObservations, fit_surrogate

EXTRA_MODES = 2  # simulated, beyond those in the band, which a measured one may be instead


def predict_beyond(seen: Sweep) -> tuple[np.ndarray, np.ndarray]:
    """Amplitude and sd (f, p) at BEYOND_DEG in m/s²/N, from the modes of what was measured."""
    modes = [list(each) for each in seen.struck.modes(BAND_HZ, quietly)]
    count = max(len(each) for each in modes)
    guide = seen.modes(seen.angles_deg, count + EXTRA_MODES)
    x = _scaled(seen.angles_deg)
    tracks = track(modes, Guide(guide.frequency_hz, guide.shape), x, ordered=True)
    fitted = fit_surrogate(_observations(tracks, count, seen))
    prediction = fitted.predict(_scaled(BEYOND_DEG), seen.modes(BEYOND_DEG, count))
    mean, sd = frf_moments(prediction, seen.lines_hz)
    return np.abs(mean[:, ACROSS, ACROSS]).T, sd[:, ACROSS, ACROSS].T


def _scaled(angles_deg: np.ndarray) -> np.ndarray:
    return (angles_deg[:, None] - SWEEP_DEG[0]) / (SWEEP_DEG[1] - SWEEP_DEG[0])


def _observations(tracks: Tracks, count: int, seen: Sweep) -> ModalObservations:
    shape = len(seen.angles_deg), count

    def gathered(name: str, empty: np.ndarray) -> np.ndarray:
        for i, row in enumerate(tracks.modes):
            for k, mode in enumerate(row[:count]):
                if mode is not None:
                    empty[i, k] = getattr(mode, name)
        return empty

    known = {
        name: gathered(name, np.full(shape, np.nan))
        for name in ("frequency_hz", "frequency_sd_hz", "damping_ratio", "damping_sd")
    }
    return ModalObservations(
        _scaled(seen.angles_deg),
        **known,
        residue=gathered("residue", np.full((*shape, 3, 3), np.nan + 0j)),
        residue_sd=gathered("residue_sd", np.full((*shape, 3, 3), np.nan)),
        simulated=seen.modes(seen.angles_deg, count),
    )
