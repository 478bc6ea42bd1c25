"""A tone that sounds without any hit: a pump, a fan, the mains. No physics of the robot."""

import numpy as np

from planner.dataset.dataset import Dataset
from planner.dataset.level_columns import Column
from planner.diagnosis.finding import Finding

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
    pairs = [pair for columns in recorded.columns for pair in _pairs(columns)]
    if not pairs:
        return None
    frequency = pairs[0][0].frequency_hz
    excess, noise = np.zeros(len(frequency)), np.zeros(len(frequency))
    for weak, strong in pairs:
        variance = weak.variance + strong.variance
        used = np.all(np.isfinite(variance), axis=0)
        square = np.abs(weak.accelerance - strong.accelerance) ** 2 * np.abs(weak.force) ** 2
        scale = np.where(used, variance * np.abs(weak.force) ** 2, 1.0).mean()
        excess += np.where(used, square.sum(axis=0) / scale, 0.0)
        noise += np.where(used, (variance * np.abs(weak.force) ** 2).sum(axis=0) / scale, 0.0)
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


def _pairs(columns: tuple[Column, ...]) -> list[tuple[Column, Column]]:
    """Weakest and strongest column of each hit axis."""
    out = []
    for axis in range(3):
        group = [c for c in columns if c.axis == axis]
        if len(group) > 1:
            out.append((group[0], group[-1]))
    return out
