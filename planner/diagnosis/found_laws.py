"""A fitted robot with the laws that force levels told, and recordings as they are without these."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.dataset.dataset import Dataset
from planner.dataset.visits import Visit
from planner.diagnosis.levels import LevelLaw
from planner.dynamics.at_force import change_at_force
from planner.dynamics.simulation import Simulation
from planner.recording.force_levels import peak_n, pulse_s
from planner.recording.records import Hit
from planner.robot.config import HammerTable

BEYOND = 1.5  # times the end of the band, up to which a law's answer is taken out


def with_laws(simulation: Simulation, found: Sequence[LevelLaw], recorded: Dataset) -> Simulation:
    """With laws in the place of those stated for their joints, and with the pulse of the hits.

    Those that would take away more than a spring has are left out.
    """
    config, stiffness = simulation.robot.config, simulation.elasticity.stiffness
    tables = [
        law.table
        for law in found
        if law.table is not None
        and stiffness[simulation.elastic.own_spring(law.table.joint)] + law.table.weakest > 0
    ]
    if not tables:
        return simulation
    joints = {table.joint for table in tables}
    pulse = float(np.median([pulse_s(h) for visit in recorded.visits for h in visit.hits]))
    others = (law for law in config.law if law.joint not in joints)
    return simulation.with_laws((*others, *tables), HammerTable(1e3 * pulse))


def straightened(recorded: Dataset, simulation: Simulation) -> Dataset:
    """Recordings of the tool as springs alone would answer, what is beyond them taken out."""
    return recorded.corrected(_without(visit, simulation, recorded) for visit in recorded.visits)


def _without(visit: Visit, simulation: Simulation, recorded: Dataset) -> Visit:
    pulse = simulation.robot.config.hammer.pulse_ms / 1e3
    # Of the same impulse as the hit, whose pulse may be shorter or longer than that of others.
    force_n = np.array([peak_n(hit) * pulse_s(hit) / pulse for hit in visit.hits])
    hit = visit.hits[0]
    count, step_s = 2 * len(hit.force_n), 1 / hit.sampling_rate_hz
    lines = np.fft.rfftfreq(count, step_s)
    used = np.flatnonzero((lines > 0) & (lines <= BEYOND * recorded.band_hz[1]))
    change = np.zeros((len(visit.hits), 3, 3, len(lines)), dtype=complex)
    q = np.tile(visit.q, (len(visit.hits), 1))
    change[..., used] = change_at_force(simulation, q, force_n, lines[used])
    hits = zip(visit.hits, change, strict=True)
    return replace(visit, hits=tuple(_less(h, c, recorded.window_rate_1_s) for h, c in hits))


def _less(hit: Hit, change: np.ndarray, rate_1_s: float) -> Hit:
    """A hit less what a change (3, 3, F) of its FRFs adds, under the window of its record."""
    samples = len(hit.force_n)
    count = 2 * (change.shape[-1] - 1)
    force = np.fft.rfft(hit.sign * hit.force_n, count)
    more = np.fft.irfft(change[:, hit.axis_index] * force, count)[:, :samples]
    late = np.maximum(np.arange(samples) - hit.pulse.peak, 0) / hit.sampling_rate_hz
    return replace(hit, acceleration_m_s2=hit.acceleration_m_s2 - more * np.exp(-rate_1_s * late))
