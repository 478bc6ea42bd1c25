"""A fitted robot with the laws that force levels told, and recordings as they are without these."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.dataset.dataset import Dataset
from planner.dataset.visits import Visit
from planner.diagnosis.levels import LevelLaw
from planner.dynamics.simulation import Simulation
from planner.inference.parallel import parallel_map
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
    how = recorded.band_hz[1], recorded.window_rate_1_s

    def one(visit: Visit) -> Visit:
        return replace(visit, hits=straightened_hits(visit.hits, visit.q, simulation, *how))

    return recorded.corrected(parallel_map(one, recorded.visits))
