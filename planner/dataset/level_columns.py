"""Columns of the FRF matrix, per force level, on one common grid of lines."""

from dataclasses import dataclass

import numpy as np

from planner.frf.estimator import of_spectra
from planner.frf.spectra import Windows, transform
from planner.recording.force_levels import peak_n
from planner.recording.records import Hit


@dataclass(frozen=True, eq=False)
class Column:
    """Accelerance (r, F) in m/s²/N along hit `axis` at one force `level`, at s = iω + `rate_1_s`.

    Rows are those of the hits' layout. `variance` (r, F) is E|δH|², ∞ where the pulse does not
    excite. `peak_n` is the mean peak.
    """

    axis: int
    level: int
    peak_n: float
    frequency_hz: np.ndarray
    accelerance: np.ndarray
    variance: np.ndarray
    rate_1_s: float
    force: np.ndarray  # (F,) in N·s: of one hit, time being 0 at its peak
    hits: tuple[Hit, ...]
    share: np.ndarray  # (hits, F): of each hit in the accelerance, by the power of its force


def column(
    hits: tuple[Hit, ...],
    axis: int,
    level: int,
    length: int,
    band_hz: tuple[float, float],
    laid_1_s: float,
    carried_1_s: float,
) -> Column:
    """H1 of hits along one axis; an exponential window of rate `laid_1_s` is laid over both sides.

    The variance is that of the records' noise: hits of a level differ by more than noise where the
    structure is not linear. `length` samples (those of the longest record) make the lines common
    to all columns; the records carry a window of rate `carried_1_s` already.
    """
    windows = Windows(laid_1_s, carried_1_s)
    spectra = transform(hits, band_hz, windows, length)
    frf = of_spectra(spectra, band_hz, windows, by_scatter=False)
    f, high = frf.frequency_hz, frf.usable_band_hz[1]
    lines = (f >= band_hz[0]) & (f <= band_hz[1])
    excited = (f < high) | (high == f[-1])
    variance = np.where(excited, frf.variance[:, axis], np.inf)[:, lines]
    power = np.array([np.abs(hit.force) ** 2 for hit in spectra.hits])[:, lines]
    turned = np.exp(2j * np.pi * f * spectra.peak_s) / hits[0].sampling_rate_hz
    return Column(
        axis,
        level,
        float(np.mean([peak_n(hit) for hit in hits])),
        f[lines],
        frf.accelerance[:, axis][:, lines],
        variance,
        frf.exponential_rate_1_s,
        (spectra.hits[0].force * turned)[lines],
        hits,
        power / power.sum(axis=0),
    )
