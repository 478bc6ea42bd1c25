"""From hits to the FRF matrix of a pose, with coherence and variance per line.

One least-squares estimator: H = Σ w X F* / Σ w |F|² over the hits along an axis. With w = 1 it is
H1, whose power H2 and Hv correct; "weighted" takes w from each record's own noise before its
pulse. H1 weighs hits by the square of their force: where the noise grows with the hit (range of
the analyser, scatter of hand and place) the strongest hit alone decides, and the scatter of three
hits says next to nothing of how well.

"one_hit" is for a model of how hits miss: each hit has one share, by its signal to noise, in all
channels and at all lines, so that the FRF is what a single hit with the mean of all misses gives;
and its variance is that of the noise alone: white as before the pulse, and (f_c/f)² times that
below a corner f_c, for floors rumble and what a record's offset is off leaks as 1/f. With weights
that differ from channel to channel each would show another mean miss, which no single hit explains.
"""

import numpy as np

from planner.frf.frf import Frf
from planner.frf.spectra import HitSpectra, Spectra, running_mean, transform, window_sum
from planner.recording.points import Layout, together
from planner.recording.records import Hit

ESTIMATORS = "h1", "h2", "hv", "weighted", "one_hit"
DROP_DB = 20.0  # of the force spectrum, where the pulse ceases to excite
LEVEL_LINES = 7  # to either side, over which scatter is compared with what noise explains
PRIOR = 12.0  # real values of scatter that the pooled level counts for, beside those near a line
# Corners in lowest lines, and by how much of a pose's FRFs hits miss, that are considered.
CORNERS, MISSES = np.append(0.0, np.geomspace(0.5, 64.0, 15)), np.geomspace(1e-3, 0.3, 13)

# FRF, variance, coherence (r, F) of one hit axis, and the share (F,) of the force's noise.
Estimated = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def estimate(
    hits: tuple[Hit, ...],
    band_hz: tuple[float, float],
    estimator: str = "h1",
    exponential_rate_1_s: float = 0.0,
    *,
    window_rate_1_s: float = 0.0,
) -> Frf:
    """FRF matrix of one pose from its hits (any order and number per axis).

    Args:
        hits: All with the same sampling rate.
        band_hz: The lines reach a little beyond it.
        estimator: "h1" (noise on the responses), "h2" (noise on the force), "hv" (both),
            "weighted" (each hit by its own noise) or "one_hit" (what a hit with the mean miss
            gives); the last two are H1 where records hold no time before a pulse.
        exponential_rate_1_s: Of a window e^(−rate·t), t from the pulse, to lay over force and
            responses; the result is then exactly H at iω + rate, and says so.
        window_rate_1_s: Of such a window that the analyser has laid already.

    Returns:
        The FRF; its variance follows from the scatter of the hits along an axis, of a single hit
        from the noise before its pulse.

    Raises:
        RefusedError: The hits do not fit together.
    """
    spectra = transform(hits, band_hz, exponential_rate_1_s, window_rate_1_s)
    return of_spectra(spectra, band_hz, estimator)


def of_spectra(
    spectra: Spectra,
    band_hz: tuple[float, float],
    estimator: str = "h1",
    by_scatter: bool = True,
) -> Frf:
    """As `estimate`, from spectra; without `by_scatter` all variance is that of records' noise."""
    if estimator not in ESTIMATORS:
        raise ValueError(f"unknown estimator {estimator}")
    frequency = spectra.frequency_hz
    places = list(dict.fromkeys((s.layout, s.rows) for s in spectra.hits))
    # Each group of sensors that heard hits together has columns of its own.
    sensors = together([inner for inner, _ in places]).sensors
    layout = Layout(tuple(inner.hits[0] for inner, _ in places), sensors)
    shape = (*layout.shape, frequency.size)
    h, variance = np.full(shape, np.nan + 0j), np.full(shape, np.nan)
    coherence, share = np.full(shape, np.nan), np.full((shape[1], frequency.size), np.nan)
    counts, groups = [], list[tuple[list[HitSpectra], np.ndarray]]()
    if not all(s.noise_known and s.noise.all() for s in spectra.hits):
        estimator = "h1" if estimator in ("weighted", "one_hit") else estimator
    for column in range(shape[1]):
        inner, own = places[column // 3]
        where = inner, own, column % 3
        group = [s for s in spectra.hits if (s.layout, s.rows, s.axis) == where]
        counts.append(len(group))
        if group:
            found = _column(group, estimator, by_scatter)
            rows = np.array(layout.rows(inner))[list(own)]
            h[rows, column], variance[rows, column], coherence[rows, column] = found[:3]
            share[column] = found[3]
            groups.append((group, h[rows, column]))
    if estimator == "one_hit" and by_scatter:
        slow = (_corner_hz(groups, frequency) / frequency) ** 2
        variance += (variance - np.abs(h) ** 2 * share) * slow
    return Frf(
        frequency,
        h,
        variance,
        coherence,
        tuple(counts),
        usable_band(spectra, band_hz),
        spectra.exponential_rate_1_s,
        spectra.remarks,
        spectra.tail_s,
        share,
        float(np.mean([s.force_window_s for s in spectra.hits])),
        layout,
    )


def _column(group: list[HitSpectra], estimator: str, by_scatter: bool) -> Estimated:
    """One hit axis from its n hits, which the same r channels heard."""
    force = np.array([s.force for s in group])  # (n, F)
    response = np.array([s.response for s in group])  # (n, r, F)
    noise = np.array([s.noise for s in group])  # (n, r)
    weight = 1 / noise if estimator == "weighted" else np.ones(noise.shape)
    square = np.abs(force) ** 2
    sff = np.einsum("nr,nf->rf", weight, square)  # (r, F)
    sxx = np.einsum("nr,nrf->rf", weight, np.abs(response) ** 2)
    sxf = np.einsum("nr,nrf,nf->rf", weight, response, force.conj())
    told = weight[:, :, None] * square[:, None] / sff  # (n, r, F), sums to 1 over hits
    h = _frf(sff, sxx, sxf, estimator)
    if estimator == "one_hit":
        told = np.broadcast_to(_shares(group)[:, None, None], response.shape)
        h = np.sum(told * response / force[:, None], axis=0)
    force_share = np.array([s.force_noise for s in group])[:, None] / square  # (n, F)
    share = np.mean(np.sum(told**2 * force_share[:, None], axis=0), axis=0)
    alone = np.sum(told**2 * noise[..., None] / square[:, None], axis=0)
    unknown, of_force = np.full(h.shape, np.nan), np.abs(h) ** 2 * share
    if estimator == "one_hit":
        return h, alone + of_force, unknown, share
    if not by_scatter:
        variance = alone + of_force
    elif len(group) == 1:
        variance = alone if group[0].noise_known else unknown
        variance = variance + (of_force if estimator == "weighted" else 0.0)
    else:
        left = np.abs(response - h * force[:, None]) ** 2
        if estimator == "weighted":
            expected = noise[..., None] + np.abs(h) ** 2 * (force_share * square)[:, None]
            level = _level(np.sum(left / expected, axis=0), len(group) - 1)
            variance = alone * level + of_force
        else:
            # Noise may grow with the hit: each counts with its own error (White's, HC2).
            error = left / np.maximum(1 - told, 1e-6)
            # Lines to either side over which the variance, which varies slowly, is averaged
            variance = np.sum(running_mean(error, 5) * told, axis=0) / sff
    coherence = np.clip(np.abs(sxf) ** 2 / np.maximum(sff * sxx, 1e-300), 0.0, 1.0)
    return h, variance, coherence if len(group) > 1 else unknown, share


def _shares(group: list[HitSpectra]) -> np.ndarray:
    """(n,) of hits in an FRF, by their signal to noise."""
    strength = [np.sum(np.abs(s.force) ** 2) * np.sum(1 / s.noise) for s in group]
    return np.array(strength) / np.sum(strength)


def _corner_hz(groups: list[tuple[list[HitSpectra], np.ndarray]], hz: np.ndarray) -> float:
    """Below which noise is above the white, most likely, by how hits along an axis scatter.

    `groups` of hits with their FRFs (r, F). Beside noise they scatter as they miss, in proportion
    to the FRFs' size.
    """
    size = np.mean(np.concatenate([np.abs(h) ** 2 for _, h in groups]), axis=0)
    left, white, miss, values = (np.zeros(len(hz)) for _ in range(4))
    for group, h in groups:
        told = _shares(group)
        for s, share in zip(group, told, strict=True):
            own, square = 1 - 2 * share, np.abs(s.force) ** 2
            left += np.sum(np.abs(s.response - h * s.force) ** 2, axis=0)
            others = (t**2 * np.sum(o.noise) / np.abs(o.force) ** 2
                      for o, t in zip(group, told, strict=True))  # fmt: skip
            white += own * np.sum(s.noise) + square * sum(others)
            miss += len(h) * size * square * (own + np.sum(told**2))
        values += len(h) * (len(group) - 1)
    if not values.any():
        return 0.0
    corners = CORNERS * hz[0]
    noise = white * (1 + (corners[:, None] / hz) ** 2)
    expected = noise[:, None] + MISSES[:, None] ** 2 * miss  # (corners, misses, F)
    likelihood = -np.sum(values * (np.log(expected) + left / expected), axis=-1)
    return float(corners[np.argmax(np.max(likelihood, axis=1))])


def _frf(sff: np.ndarray, sxx: np.ndarray, sxf: np.ndarray, estimator: str) -> np.ndarray:
    """H (r, F) from sums over hits."""
    h1 = sxf / sff
    if estimator in ("h1", "weighted"):
        return h1
    with np.errstate(divide="ignore", invalid="ignore"):
        h2 = np.where(np.abs(sxf) > 0, sxx / sxf.conj(), h1)
    # The geometric mean of H1 and H2 (they share the phase) is Hv for equal relative noise.
    return h2 if estimator == "h2" else h1 * np.sqrt(np.abs(h2) / np.maximum(np.abs(h1), 1e-300))


def _level(scatter: np.ndarray, degrees: int) -> np.ndarray:
    """Noise (r, F) beside what the records say: near each line, drawn toward the channels' mean."""
    pooled = float(np.mean(scatter)) / degrees
    near = running_mean(scatter, LEVEL_LINES) / degrees
    lines = window_sum(np.ones(scatter.shape[1]), LEVEL_LINES)
    # Real values near a line: two a line, of which windows leave about one in four independent.
    values = 2 * degrees * lines / 4
    return (PRIOR * pooled + values * near) / (PRIOR + values)


def usable_band(spectra: Spectra, band_hz: tuple[float, float]) -> tuple[float, float]:
    """From the first line to where the weakest pulse has lost DROP_DB, or the lines end."""
    frequency = spectra.frequency_hz
    high = float(frequency[-1])
    for s in spectra.hits:
        size = np.abs(s.force)
        weak = (size < np.max(size) * 10 ** (-DROP_DB / 20)) & (frequency > band_hz[0])
        if weak.any():
            high = min(high, float(frequency[np.argmax(weak)]))
    return float(frequency[0]), high
