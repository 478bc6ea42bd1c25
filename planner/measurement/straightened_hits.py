"""Hits as springs alone would answer them: what stated laws of joints do to each is taken out.

Equivalent stiffnesses go with the force, and an average over forces is no linear robot's.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.dynamics.at_force import measured_at_force
from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import accelerance
from planner.inference.parallel import parallel_map
from planner.recording.force_levels import pulse_s
from planner.recording.points import Layout
from planner.recording.records import Hit

TOGETHER = 60  # hits, whose answers are held in memory
BEYOND = 1.5  # times the end of the band, up to which a law's answer is taken out

Hits = tuple[Hit, ...]


def straightened_hits(
    hits: Sequence[Hit], q: np.ndarray, simulation: Simulation, highest_hz: float,
    window_rate_1_s: float,
) -> Hits:  # fmt: skip
    """Hits (h) at q (h, dof) in rad less what the laws of a simulation add to their answers.

    The FRFs are used up to `highest_hz`; the records carry a window of that rate. Those with the
    same points, rate and length are marched through time together.
    """
    alike: dict[tuple[Layout, int, float], list[int]] = {}
    for i, hit in enumerate(hits):
        key = hit.layout, len(hit.force_n), hit.sampling_rate_hz
        alike.setdefault(key, []).append(i)
    parts = [p for same in alike.values() for p in np.array_split(same, -(-len(same) // TOGETHER))]

    def less(part: np.ndarray) -> Hits:
        those = [hits[i] for i in part]
        changes = _changes(those, q[part], simulation, BEYOND * highest_hz)
        pairs = zip(those, changes, strict=True)
        return tuple(_less(hit, change, window_rate_1_s) for hit, change in pairs)

    found = zip(parts, parallel_map(less, parts), strict=True)
    each = {i: hit for part, those in found for i, hit in zip(part, those, strict=True)}
    return tuple(each[i] for i in range(len(hits)))


def struck_n(simulation: Simulation, hits: Sequence[Hit]) -> np.ndarray:
    """Peaks (h,) in N of pulses as the simulation has them, of the same impulse as hits.

    Their own pulses may be shorter or longer.
    """
    pulse = simulation.robot.config.hammer.pulse_ms / 1e3
    return np.array([hit.pulse.peak_n * pulse_s(hit) / pulse for hit in hits])


def _changes(
    hits: Sequence[Hit], q: np.ndarray, simulation: Simulation, up_to_hz: float
) -> np.ndarray:
    """(h, 3s, 3, F) that laws add to the FRFs of hits at q (h, dof), alike but for these."""
    force_n = struck_n(simulation, hits)
    lines = np.fft.rfftfreq(2 * len(hits[0].force_n), 1 / hits[0].sampling_rate_hz)
    used = np.flatnonzero((lines > 0) & (lines <= up_to_hz))
    layout = hits[0].layout
    change = np.zeros((len(hits), *layout.shape, len(lines)), dtype=complex)
    solved = simulation.solved(simulation.elastic.matrices(q, layout=layout))
    there = measured_at_force(simulation, q, force_n, lines[used], layout)
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
