"""A tone that sounds without any hit: a pump, a fan, the mains. No physics of the robot."""

import numpy as np

from planner.diagnose.finding import Finding
from planner.diagnose.visits import Recorded

SHARP = 3  # lines on each side that a tone may spread over
LEAST = 12.0  # times the noise that a tone's power has to rise above
COMMON = 0.5  # of the hits


def screen_tone(recorded: Recorded) -> Finding | None:
    """`unknown`, naming the frequency, where a line stays as loud however hard is hit.

    The end of each record, when most of the ringing is over, is compared between levels: ringing
    grows with the force, a tone does not.
    """
    hits = [hit for visit in recorded.visits for hit in visit.hits]
    n = min(len(hit.force_n) for hit in hits) // 2
    rate = hits[0].sampling_rate_hz
    frequency = np.fft.rfftfreq(n, 1 / rate)
    band = (frequency > recorded.band_hz[0]) & (frequency < recorded.band_hz[1])
    window = np.hanning(n)
    power = np.array(
        [np.abs(np.fft.rfft(window * h.acceleration_m_s2[:, -n:], axis=1)) ** 2 for h in hits]
    ).sum(axis=1)[:, band]
    level = np.array([recorded.level(hit) for hit in hits])
    weak, strong = power[level == level.min()], power[level == level.max()]
    quiet, loud = np.median(weak, axis=0), np.median(strong, axis=0)
    line = int(np.argmax(quiet / np.median(quiet)))
    near = slice(max(0, line - SHARP), line + SHARP + 1)
    ground = np.delete(quiet, np.arange(len(quiet))[near])
    forces = recorded.level_n[-1] / recorded.level_n[0]
    rises = quiet[line] > LEAST * np.median(ground)
    steady = loud[line] / quiet[line] < np.sqrt(forces)
    often = np.mean(weak[:, line] > LEAST * np.median(weak, axis=1)) > COMMON
    if not (rises and steady and often):
        return None
    evidence = float(len(weak) * np.log(quiet[line] / np.median(ground)))
    hz = float(frequency[band][line])
    text = (
        f"Something sounds at {hz:.1f} Hz however hard the robot is hit: look for a pump, a fan or "
        "a drive that runs during the test."
    )
    return Finding("unknown", None, evidence, {"frequency": (hz, rate / n / 2, "Hz")}, text)
