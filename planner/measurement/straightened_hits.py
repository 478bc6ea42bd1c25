"""Hits as springs alone would answer them: what stated laws of joints do to each is taken out.

Equivalent stiffnesses go with the force, and an average over forces is no linear robot's.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.dynamics.at_force import measured_at_force
from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import accelerance
from planner.recording.force_levels import pulse_s
from planner.recording.points import Layout
from planner.recording.records import Hit

BEYOND = 1.5  # times the end of the band, up to which a law's answer is taken out

Hits = tuple[Hit, ...]


def straightened_hits(
    hits: Hits, q: np.ndarray, simulation: Simulation, highest_hz: float, window_rate_1_s: float
) -> Hits:
    """Hits at q (dof,) in rad less what the laws of a simulation add to their answers.

    The FRFs are used up to `highest_hz`; the records carry a window of that rate.
    """
    alike: dict[tuple[Layout, int, float], list[int]] = {}
    for i, hit in enumerate(hits):
        key = hit.layout, len(hit.force_n), hit.sampling_rate_hz
        alike.setdefault(key, []).append(i)
    found = list(hits)
    for same in alike.values():
        those = [hits[i] for i in same]
        changes = _changes(those, q, simulation, BEYOND * highest_hz)
        for i, change in zip(same, changes, strict=True):
            found[i] = _less(hits[i], change, window_rate_1_s)
    return tuple(found)


def struck_n(simulation: Simulation, hits: Sequence[Hit]) -> np.ndarray:
    """Peaks (h,) in N of pulses as the simulation has them, of the same impulse as hits.

    Their own pulses may be shorter or longer.
    """
    pulse = simulation.robot.config.hammer.pulse_ms / 1e3
    return np.array([hit.pulse.peak_n * pulse_s(hit) / pulse for hit in hits])


def _changes(hits: list[Hit], q: np.ndarray, simulation: Simulation, up_to_hz: float) -> np.ndarray:
    """(h, 3s, 3, F) that laws add to the FRFs of hits with the same points, rate and length."""
    force_n = struck_n(simulation, hits)
    lines = np.fft.rfftfreq(2 * len(hits[0].force_n), 1 / hits[0].sampling_rate_hz)
    used = np.flatnonzero((lines > 0) & (lines <= up_to_hz))
    layout = hits[0].layout
    change = np.zeros((len(hits), *layout.shape, len(lines)), dtype=complex)
    many = np.tile(q, (len(hits), 1))
    solved = simulation.solved(simulation.elastic.matrices(q, layout=layout))
    there = measured_at_force(simulation, many, force_n, lines[used], layout)
    change[..., used] = there - accelerance(solved, lines[used])
    return change


def _less(hit: Hit, change: np.ndarray, rate_1_s: float) -> Hit:
    """A hit less what a change (3s, 3, F) of its FRFs adds, under the window of its record."""
    samples = len(hit.force_n)
    count = 2 * (change.shape[-1] - 1)
    force = np.fft.rfft(hit.sign * hit.force_n, count)
    more = np.fft.irfft(change[hit.rows, hit.axis_index] * force, count)[:, :samples]
    late = np.maximum(np.arange(samples) - hit.pulse.peak, 0) / hit.sampling_rate_hz
    return replace(hit, acceleration_m_s2=hit.acceleration_m_s2 - more * np.exp(-rate_1_s * late))
