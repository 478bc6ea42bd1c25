"""The model of a campaign: a pure function of its cell and its state."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.acquire.propose import propose as choose
from planner.campaign.cell import Cell
from planner.campaign.events import Proposal
from planner.campaign.labels import LabelledPose, label, observations
from planner.campaign.state import CampaignState
from planner.errors import NoPoseLeftError
from planner.fusion.surrogate import ModalPrediction, Surrogate, fit_surrogate, frf_prediction


@dataclass(frozen=True, eq=False)
class Model:
    """What is believed after the measurements of one state."""

    cell: Cell
    labelled: tuple[LabelledPose, ...]
    surrogate: Surrogate

    def predict(self, q: np.ndarray) -> ModalPrediction:
        """Modes at poses q (n, dof) in rad."""
        return self.surrogate.predict(self.cell.features(q), self.cell.simulate(q))

    @cached_property
    def workspace_prediction(self) -> ModalPrediction:
        """Modes at the candidate poses, which stand for the workspace."""
        candidates = self.cell.candidates
        return self.surrogate.predict(candidates.features, self.cell.simulated_candidates)

    def frf(self, q: np.ndarray, frequency_hz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean (n, 3, 3, F), complex, and sd (n, 3, 3, F) of the accelerance in m/s²/N."""
        return frf_prediction(self.predict(q), frequency_hz)

    @property
    def frequency_sd_percent(self) -> np.ndarray:
        """Predicted sd of each natural frequency, root mean square over the workspace, in %."""
        p = self.workspace_prediction
        return 100 * np.sqrt(np.mean((p.frequency_sd_hz / p.frequency_hz) ** 2, axis=0))


def build(cell: Cell, state: CampaignState) -> Model:
    """Label and fit everything that the state's measurements hold."""
    labelled = label(cell, state.used)
    return Model(cell, labelled, fit_surrogate(observations(cell, labelled)))


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
        cell.simulated_candidates,
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
