"""What each hit of a pose says by itself, on a few lines, and what one of them all would say."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from planner.dataset.dataset import LAID
from planner.dataset.measure import MeasuredPose, frf_of, of_tool
from planner.dataset.screened_files import Source
from planner.frf.estimator import usable_band
from planner.frf.frf import Frf
from planner.frf.spectra import transform
from planner.recording.channel_faults import by_good_sensors
from planner.recording.points import TOOL
from planner.recording.records import Hit

LINES = 48  # of each hit, at most: four numbers a hit are told from 144 complex values
Correction = Callable[[tuple[Hit, ...]], tuple[Hit, ...]]  # of the hits of a pose


@dataclass(frozen=True, eq=False)
class HitColumns:
    """The n hits of a pose at L lines, at s = iω + `rate_1_s`; n = 0 of exported FRFs.

    Those at the tcp, as the sensor there has them.

    `file` (n,) counts the files they are from; `axis` (n,) is 0, 1 or 2 and `sign` (n,) their sense
    along it. `accelerance` (n, 3, L) in m/s²/N is that of a force along +axis, `variance` (n, 3, L)
    is E|δH|² of the records' noise, `share` (n, L) each hit's part in the average of its axis.
    `tail_s` as in `Frf`.
    """

    file: np.ndarray
    axis: np.ndarray
    sign: np.ndarray
    frequency_hz: np.ndarray
    accelerance: np.ndarray
    variance: np.ndarray
    share: np.ndarray
    rate_1_s: float
    tail_s: float

    def shared_at(self, frequency_hz: np.ndarray) -> np.ndarray:
        """`share` (n, F) at other lines (Hz)."""
        return np.array([np.interp(frequency_hz, self.frequency_hz, row) for row in self.share])


@dataclass(frozen=True, eq=False)
class PoseHits:
    """The accepted hits of a pose one by one, and `whole`, their FRFs at all points.

    These are of one hit in the middle of all, see `MeasuredPose.one_hit_frf`; `averaged` is the
    tool's FRF as the average of all, the one that `measure` gave, NaN where others were measured.
    """

    columns: HitColumns
    whole: Frf
    averaged: Frf

    @property
    def of_tool(self) -> Frf:
        """The tool's FRF as one hit in the middle of all would show it.

        Its variance is that of the noise alone: how hits scatter is part of how they miss, which is
        integrated out, and would count twice.
        """
        return self.whole.of_tool or self.averaged


def hit_columns(
    hits: tuple[Hit, ...],
    file: tuple[int, ...],
    band_hz: tuple[float, float],
    window_rate_1_s: float = 0.0,
) -> HitColumns:
    """Columns of hits, which are from the files of those numbers, in a band.

    `window_rate_1_s`: of an exponential window that the analyser laid. Raises RefusedError where
    the hits do not fit together.
    """
    spectra = transform(hits, band_hz, LAID, window_rate_1_s)
    frequency = spectra.frequency_hz
    high = min(band_hz[1], usable_band(spectra, band_hz)[1])
    inside = np.flatnonzero((frequency >= band_hz[0]) & (frequency <= high))
    if len(inside) > LINES:
        inside = inside[np.linspace(0, len(inside) - 1, LINES).round().astype(int)]
    force = np.array([s.force for s in spectra.hits])[:, inside]
    size = np.abs(force)
    h = np.array([s.response for s in spectra.hits])[:, :, inside] / force[:, None]
    noise = np.array([s.noise for s in spectra.hits])[:, :, None]
    force_noise = np.array([s.force_noise for s in spectra.hits])[:, None, None]
    axis = np.array([s.axis for s in spectra.hits])
    total = np.array([np.sum(size[axis == own] ** 2, axis=0) for own in axis])
    return HitColumns(
        np.array(file),
        axis,
        np.array([hit.sign for hit in hits]),
        frequency[inside],
        h,
        (noise + np.abs(h) ** 2 * force_noise) / size[:, None] ** 2,
        size**2 / total,
        LAID + window_rate_1_s,
        spectra.tail_s,
    )


def hits_of(
    sources: tuple[Source, ...],
    band_hz: tuple[float, float],
    window_rate_1_s: float = 0.0,
    corrected: Correction | None = None,
) -> PoseHits:
    """Those of files that were accepted before, kept like FRFs unless they are `corrected`."""
    how = band_hz, "h1", window_rate_1_s
    pose = MeasuredPose(sources, *how)

    def make() -> PoseHits:
        read = [source.read() for source in sources]
        records = tuple(record for _, found in read for record in found)
        files = [number for number, (found, _) in enumerate(read) for _ in found]
        every = tuple(by_good_sensors(hit)[0] for found, _ in read for hit in found)
        every = every if corrected is None else corrected(every)
        at_tool = [(n, one) for n, hit in zip(files, every, strict=True) for one in of_tool((hit,))]
        columns = no_columns()
        if at_tool:
            file, hits = zip(*at_tool, strict=True)
            columns = hit_columns(hits, file, band_hz, window_rate_1_s)
        whole = frf_of(every, records, *how)
        one_hit = MeasuredPose((), *how, given=every).one_hit_frf if every else None
        nothing = np.full((3, 3, len(whole.frequency_hz)), np.nan)
        averaged = whole.of_tool or replace(
            whole, accelerance=nothing + 0j, variance=nothing, coherence=nothing, hits=(0, 0, 0),
            force_share=None, layout=TOOL,
        )  # fmt: skip
        return PoseHits(columns, one_hit or whole, averaged)

    return pose.kept("hits", PoseHits, make) if corrected is None else make()


def no_columns() -> HitColumns:
    """Of no hit."""
    empty, h = np.zeros(0), np.zeros((0, 3, 0))
    return HitColumns(
        empty.astype(int), empty.astype(int), empty, empty, h.astype(complex), h,
        np.zeros((0, 0)), LAID, np.inf,
    )  # fmt: skip
