"""A fitted robot with the laws that force levels told, and recordings as they are without these."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from planner.dataset.dataset import Dataset
from planner.diagnosis.levels import LevelLaw
from planner.dynamics.simulation import Simulation
from planner.measurement.straightened_hits import straightened_hits
from planner.recording.force_levels import pulse_s
from planner.robot.config import HammerTable


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
    """Recordings as springs alone would answer, what is beyond them taken out."""
    visits = recorded.visits
    counts = [len(visit.hits) for visit in visits]
    q, hits = np.repeat([v.q for v in visits], counts, axis=0), [h for v in visits for h in v.hits]
    how = simulation, recorded.band_hz[1], recorded.window_rate_1_s
    found = iter(straightened_hits(hits, q, *how))
    return recorded.corrected([replace(v, hits=tuple(islice(found, len(v.hits)))) for v in visits])
