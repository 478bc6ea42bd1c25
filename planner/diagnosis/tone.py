"""A tone that sounds without any hit: a pump, a fan, the mains. No physics of the robot."""

from dataclasses import dataclass

import numpy as np

from planner.dataset.dataset import LAID, Dataset
from planner.dataset.visits import Visit
from planner.diagnosis.finding import Finding
from planner.frf.estimator import of_spectra
from planner.frf.spectra import transform
from planner.recording.records import Hit

WIDTH_HZ = 1.0  # half of what a tone takes up under the window
CONCENTRATED = 0.6  # share of the levels' differences that lies there, at all poses together
LEAST = 10.0  # χ² per value there: below it levels hardly differ
SOUNDS_ON = 0.7  # of its size in the third quarter of a record that a tone has in the last
STANDS_OUT, BESIDE_HZ = 3.0, 1.5  # power there over that beside it


def screen_tone(recorded: Dataset) -> Finding | None:
    """`unknown`, naming the frequency, where levels differ at one frequency, whatever the pose.

    A tone adds the same to weak and strong hits, so that their FRFs differ there. Resonances,
    where a nonlinear joint shows, move with the pose.
    """
    pairs = [pair for visit in recorded.visits for pair in _pairs(recorded, visit)]
    if not pairs:
        return None
    frequency = pairs[0][0].frequency_hz
    excess, noise = np.zeros(len(frequency)), np.zeros(len(frequency))
    for weak, strong in pairs:
        variance = weak.variance + strong.variance
        used = np.all(np.isfinite(variance), axis=0)
        square = np.abs(weak.accelerance - strong.accelerance) ** 2 * weak.power
        scale = np.where(used, variance * weak.power, 1.0).mean()
        excess += np.where(used, square.sum(axis=0) / scale, 0.0)
        noise += np.where(used, (variance * weak.power).sum(axis=0) / scale, 0.0)
    over = np.maximum(excess - noise, 0.0)
    line = int(np.argmax(over))
    near = np.abs(frequency - frequency[line]) <= WIDTH_HZ
    share = float(over[near].sum() / max(over.sum(), 1e-300))
    if excess[near].sum() < LEAST * noise[near].sum() or share < CONCENTRATED:
        return None
    hz = float(np.sum(frequency[near] * over[near]) / over[near].sum())
    if _kept(recorded, hz) < SOUNDS_ON:
        return None  # a resonance that hardly moves with the pose: it dies away
    spacing = float(frequency[1] - frequency[0])
    text = (
        f"Something sounds at {hz:.1f} Hz however hard the robot is hit: look for a pump, a fan or "
        "a drive that runs during the test."
    )
    evidence = float(over[near].sum() / 2)
    return Finding("unknown", None, evidence, {"frequency": (hz, spacing / 2, "Hz")}, text)


def _kept(recorded: Dataset, hz: float) -> float:
    """What is left of a frequency from the third to the last quarter of the weakest hits.

    0 where it does not stand out from what lies beside it there.
    """
    beside = np.array([0.0, -3.0, -2.0, 2.0, 3.0]) * BESIDE_HZ + hz
    power = np.zeros((2, len(beside)))
    for hit in (h for visit in recorded.visits for h in visit.hits if not recorded.level(h)):
        n = len(hit.force_n)
        for number, (first, last) in enumerate(((n // 2, 3 * n // 4), (3 * n // 4, n))):
            t = np.arange(first, last) / hit.sampling_rate_hz
            waves = np.hanning(last - first) * np.exp(-2j * np.pi * beside[:, None] * t)
            power[number] += np.sum(np.abs(hit.acceleration_m_s2[:, first:last] @ waves.T) ** 2, 0)
    noise = np.median(power[:, 1:], axis=1)
    before, after = np.maximum(power[:, 0] - noise, 0.0)
    if after < STANDS_OUT * noise[1] or before == 0:
        return 0.0
    return float(np.sqrt(after / before))


@dataclass(frozen=True, eq=False)
class _Column:
    """Accelerance (r, F) of hits along an axis at one force level, under a window of rate LAID.

    `variance` (r, F) is E|δH|² of the records' noise, ∞ where the pulse does not excite; hits of a
    level differ by more where the structure is not linear. `power` (F,) is |F|² of the first hit.
    """

    frequency_hz: np.ndarray
    accelerance: np.ndarray
    variance: np.ndarray
    power: np.ndarray

    @classmethod
    def of(cls, recorded: Dataset, hits: list[Hit]) -> "_Column":
        """Of the hits of a level; the longest record makes the lines common to all."""
        low, high = recorded.band_hz
        longest = max(len(hit.force_n) for visit in recorded.visits for hit in visit.hits)
        carried, axis = recorded.window_rate_1_s, hits[0].axis_index
        spectra = transform(tuple(hits), recorded.band_hz, LAID, carried, longest)
        frf = of_spectra(spectra, recorded.band_hz, by_scatter=False)
        f, usable = frf.frequency_hz, frf.usable_band_hz[1]
        lines = (f >= low) & (f <= high)
        excited = (f < usable) | (usable == f[-1])
        variance = np.where(excited, frf.variance[:, axis], np.inf)
        force = spectra.hits[0].force / hits[0].sampling_rate_hz
        accelerance = frf.accelerance[:, axis][:, lines]
        return cls(f[lines], accelerance, variance[:, lines], np.abs(force[lines]) ** 2)


def _pairs(recorded: Dataset, visit: Visit) -> list[tuple[_Column, _Column]]:
    """Weakest and strongest level of each hit axis."""
    out = []
    for axis in range(3):
        levels: dict[int, list[Hit]] = {}
        for hit in (hit for hit in visit.hits if hit.axis_index == axis):
            levels.setdefault(recorded.level(hit), []).append(hit)
        if len(levels) > 1:
            ends = levels[min(levels)], levels[max(levels)]
            out.append((_Column.of(recorded, ends[0]), _Column.of(recorded, ends[1])))
    return out
