"""The model of a campaign: a pure function of its cell and its state."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.acquire.propose import propose as choose
from planner.campaign.cell import Cell
from planner.campaign.config import ModesTable
from planner.campaign.events import Proposal
from planner.campaign.fidelity import LowFidelity, learn
from planner.campaign.labels import LabelledPose, frequencies, label, observations
from planner.campaign.state import CampaignState, Measurement
from planner.errors import NoPoseLeftError
from planner.frf.types import Frf
from planner.fusion.frf_bands import ModalPrediction, frf_moments
from planner.fusion.hedged import HedgedAR1
from planner.fusion.surrogate import (
    ModalObservations,
    Surrogate,
    fit_primary,
    fit_surrogate,
)
from planner.physics.dynamics import SimulatedModes

# Logarithms: of the chance that a mode is not found, and of the density in ln f of those found
# that are none.
MISSED, STRAY = float(np.log(0.1)), float(np.log(0.01))


@dataclass(frozen=True, eq=False)
class Model:
    """What is believed after the measurements of one state."""

    cell: Cell
    labelled: tuple[LabelledPose, ...]
    low: LowFidelity
    surrogate: Surrogate

    def predict(self, q: np.ndarray) -> ModalPrediction:
        """Modes at poses q (n, dof) in rad."""
        return self._predict(q, self.cell.features(q), self.low.simulate(q))

    @cached_property
    def workspace_prediction(self) -> ModalPrediction:
        """Modes at the candidate poses, which stand for the workspace."""
        candidates = self.cell.candidates
        return self._predict(candidates.q, candidates.features, self.simulated_candidates)

    @cached_property
    def simulated_candidates(self) -> SimulatedModes:
        """What the low fidelity says at the candidates."""
        return self.low.simulate(self.cell.candidates.q)

    def _predict(
        self, q: np.ndarray, features: np.ndarray, simulated: SimulatedModes
    ) -> ModalPrediction:
        """The surrogate's prediction, with what the simulation's own parameters leave open."""
        found = self.surrogate.predict(features, simulated)
        share = self.surrogate.frequency_trust * self.low.frequency_sd(q)
        sd = np.hypot(found.frequency_sd_hz, share * found.frequency_hz)
        return replace(found, frequency_sd_hz=sd)

    def frf(self, q: np.ndarray, frequency_hz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean (n, 3, 3, F), complex, and sd (n, 3, 3, F) of the accelerance in m/s²/N."""
        return frf_moments(self.predict(q), frequency_hz)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the engineer should know of the model: doubts about the simulation."""
        found = [self.low.remark] if self.low.remark else []
        found += self.surrogate.remarks
        if self.labelled and self.low.simulation is not None:
            left = [str(k + 1) for k, w in enumerate(self.surrogate.frequency_trust) if w < 0.5]
            if left:
                found.append(
                    f"The measurements speak against the simulation of mode {', '.join(left)}: "
                    f"predicted without it."
                )
        return tuple(found)

    @property
    def frequency_sd_percent(self) -> np.ndarray:
        """Predicted sd of each natural frequency, root mean square over the workspace, in %."""
        p = self.workspace_prediction
        return 100 * np.sqrt(np.mean((p.frequency_sd_hz / p.frequency_hz) ** 2, axis=0))


def build(
    cell: Cell, state: CampaignState, frf_of: Callable[[Measurement, ModesTable], Frf]
) -> Model:
    """Label and fit everything that the state's measurements hold.

    `frf_of` gives the FRFs of a measurement; it is asked only where the simulation learns.
    """
    low, used, table = cell.frozen, state.used, cell.config.modes
    if cell.config.fidelity.simulation == "updated" and used:
        q = np.deg2rad(np.array([m.joints_deg for m in used]))
        low = learn(low, [frf_of(m, table) for m in used], q, table.band_hz)
    candidates = [_Guided.by(cell, used, low)]
    if low.learned is not None and not low.learned.fits:
        # What lacks physics is bent by fitting it: as it stands it may be a better
        # guide, or none.
        stated = replace(cell.frozen, suspect=low.learned)
        candidates += [
            _Guided.by(cell, used, one) for one in (stated, replace(stated, nominal=None))
        ]
    best = max(candidates, key=lambda guided: guided.log_evidence)
    return Model(cell, best.labelled, best.low, fit_surrogate(best.seen, primary=best.primary))


@dataclass(frozen=True, eq=False)
class _Guided:
    """Labels and frequencies as one low fidelity makes them."""

    low: LowFidelity
    used: tuple[Measurement, ...]
    labelled: tuple[LabelledPose, ...]
    seen: ModalObservations
    primary: HedgedAR1

    @classmethod
    def by(cls, cell: Cell, used: tuple[Measurement, ...], low: LowFidelity) -> "_Guided":
        labelled = label(cell, used, low)
        seen = observations(cell, labelled, low)
        known = low.discrepancy(frequencies(labelled)) if labelled else None
        primary = fit_primary(seen, known, low.left_out, belief=low.belief)
        return cls(low, used, labelled, seen, primary)

    @property
    def log_evidence(self) -> float:
        """How probable the measured modes were, all labels together.

        A label without a mode, and a mode below the last label that got none, are rare too.
        """
        labels = self.primary.log_evidence[: self.low.count]
        missed = sum(mode is None for pose in self.labelled for mode in pose.modes)
        return float(np.sum(labels)) + missed * MISSED + self.stray * STRAY

    @property
    def stray(self) -> int:
        """Measured modes that are no label's though labels lie above them."""
        count = 0
        for pose, measurement in zip(self.labelled, self.used, strict=True):
            given = {mode.frequency_hz for mode in pose.modes if mode is not None}
            free = [m.frequency_hz for m in measurement.modes if m.likely]
            count += sum(f not in given and f < max(given, default=0.0) for f in free)
        return count


def propose(
    model: Model, state: CampaignState, count: int, acquisition: str
) -> tuple[Proposal, ...]:
    """The next poses to measure; NoPoseLeftError when no candidate is left."""
    cell = model.cell
    candidates = cell.candidates
    taken = [m.joints_deg for m in state.measurements.values()]
    taken += [state.proposals[pose].joints_deg for pose in state.skipped]
    picks = choose(
        acquisition,
        model.surrogate,
        candidates.features,
        model.simulated_candidates,
        count=count,
        exclude=cell.features(np.deg2rad(np.array(taken))) if taken else None,
        seed=state.events,
    )
    if not picks:
        raise NoPoseLeftError(
            f"No reachable pose is left among {len(candidates.q)} candidates of the workspace; "
            f"widen [workspace] or raise candidates in campaign.toml."
        )
    return tuple(
        Proposal(
            pose=f"P{state.proposals_made + i + 1:03d}",
            joints_deg=tuple(round(float(v), 4) for v in np.rad2deg(candidates.q[pick.index])),
            position_m=_xyz(candidates.position_m[pick.index]),
            score=float(pick.score),
            reason=_reason(model, pick.index, acquisition),
        )
        for i, pick in enumerate(picks)
    )


def _xyz(position_m: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (round(float(v), 5) for v in position_m)
    return x, y, z


def _reason(model: Model, index: int, acquisition: str) -> str:
    p = model.workspace_prediction
    sd = 100 * p.frequency_sd_hz[index] / p.frequency_hz[index]
    k = int(np.argmax(sd))
    text = f"mode {k + 1} is expected at {p.frequency_hz[index, k]:.2f} Hz ± {sd[k]:.1f} %"
    if model.labelled:
        x = model.cell.features(np.array([pose.q for pose in model.labelled]))
        distance = np.linalg.norm(x - model.cell.candidates.features[index], axis=1)
        near = model.labelled[int(np.argmin(distance))].pose
        text += f" here, nearest measured pose {near}"
    return f"{acquisition.replace('_', ' ')}: {text}"
