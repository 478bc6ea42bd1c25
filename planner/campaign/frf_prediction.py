"""How a campaign's model predicts FRFs: simulation and fused modes of its measured poses."""

from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from planner.campaign.frf_model import FrfModel, frf_model
from planner.measurement.measured_frfs import common_band, stack
from planner.surrogate.frf_bands import ModalPrediction
from planner.surrogate.leave_one_out import left_out_modes

if TYPE_CHECKING:
    from planner.campaign.model import Model

LINES, LEAST, MOST = 300, 20, 80  # of all poses together, and of one at least and at most
MODEL_ERROR = 0.01  # relative sd of what no modes follow


def frf_model_of(model: "Model") -> FrfModel:
    """From the FRFs of its poses and, where there is one, from what was identified of them."""
    with threadpool_limits(1):
        return _frf_model(model)


def _frf_model(model: "Model") -> FrfModel:
    q = np.array([pose.q for pose in model.labelled])
    band = model.cell.config.modes.band_hz
    learned = model.low.learned
    simulated = learned.posterior if learned is not None and learned.fits else None
    lines = int(np.clip(LINES // len(q), LEAST, MOST))
    measured = stack(model.frfs, common_band(model.frfs, band), lines, MODEL_ERROR)

    def modes() -> ModalPrediction:
        return left_out_modes(model.with_residues, model.seen_exactly)

    def above(pose: int, frequency_hz: np.ndarray) -> np.ndarray:
        return model.low.above(q[[pose]], frequency_hz)[0]

    return frf_model(simulated, measured, band, modes, above)
