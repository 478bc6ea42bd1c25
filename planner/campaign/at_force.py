"""What a stated force changes in a campaign's predictions, where joints are not linear."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from planner.dynamics.at_force import averaged, change_at_force, modes_at_force
from planner.dynamics.simulation import Simulation
from planner.recording.force_levels import peak_n
from planner.surrogate.frf_bands import ModalPrediction

if TYPE_CHECKING:
    from planner.campaign.reads import CampaignReads

UNCHANGED = (
    "peak_force_n changes nothing: robot.toml states no [[law]] of a joint that is not linear "
    "(planner diagnose finds them from hits of different force)."
)


@dataclass(frozen=True, eq=False)
class ForceModel:
    """The `simulation` whose laws say what another force changes; None: nothing does."""

    simulation: Simulation | None

    @classmethod
    def of(cls, campaign: "CampaignReads") -> "ForceModel":
        """Springs that were identified have what the campaign's own hits have of the laws."""
        low = campaign.model.low
        simulation = low.simulation
        if simulation is None or not simulation.robot.config.law:
            return cls(None)
        if low.learned is None:
            return cls(simulation)
        visits = campaign.dataset(campaign.cell.config.modes.band_hz).visits
        hits = [(visit.q, hit.axis_index, peak_n(hit)) for visit in visits for hit in visit.hits]
        if not hits:
            return cls(simulation)
        q, axes, force_n = (np.array(column) for column in zip(*hits, strict=True))
        return cls(averaged(simulation, q, axes, force_n))

    def frf_change(
        self, q: np.ndarray, force_n: np.ndarray, frequency_hz: np.ndarray, in_time: bool = True
    ) -> np.ndarray:
        """(n, 3, 3, F) in m/s²/N, as of `change_at_force`; 0 where no force is stated."""
        if self.simulation is None:
            return np.zeros((len(q), 3, 3, len(frequency_hz)), dtype=complex)
        return change_at_force(self.simulation, q, force_n, frequency_hz, in_time)

    def modes(
        self, predicted: ModalPrediction, q: np.ndarray, force_n: np.ndarray
    ) -> ModalPrediction:
        """Frequencies and damping moved as the simulation's are; as they were where NaN."""
        known = np.flatnonzero(np.isfinite(force_n))
        if self.simulation is None or not known.size:
            return predicted
        count = predicted.frequency_hz.shape[1]
        there = modes_at_force(self.simulation, q[known], force_n[known], count)
        stated = self.simulation.frequencies(q[known], count)
        moved = {}
        for name in ("frequency_hz", "damping_ratio"):
            ratio = getattr(there, name) / getattr(stated, name)
            moved[name] = getattr(predicted, name).copy()
            moved[name][known] *= np.where(np.isfinite(ratio), ratio, 1.0)
        return replace(predicted, **moved)
