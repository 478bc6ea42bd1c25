"""The modes of every measured pose as the surrogate predicts them from the other poses."""

import numpy as np

from planner.surrogate.frf_bands import ModalPrediction
from planner.surrogate.gp import Posterior
from planner.surrogate.leave_one_out import leave_one_out
from planner.surrogate.modal_surrogate import ModalObservations, Surrogate


def left_out_modes(surrogate: Surrogate, seen: ModalObservations) -> ModalPrediction:
    """Modes (n, k) at the n measured poses, each without its own; `surrogate` has residues.

    In closed form, by the likelier of hedged models. What was not found at a pose is predicted.
    """
    n, k = seen.frequency_hz.shape
    plain = surrogate.predict(seen.x, seen.simulated)
    assert surrogate.residue is not None
    frequency = _without([surrogate.primary.posterior], np.ones((1, k)), np.log(seen.frequency_hz))
    fits = surrogate.damping
    weights = fits.weights[fits.counted]
    damping = _without(list(fits.posteriors), weights, np.log(seen.damping_ratio))
    hertz = _log_normal(frequency, plain.frequency_hz, plain.frequency_sd_hz)
    zeta = _log_normal(damping, plain.damping_ratio, plain.damping_sd)
    scale = surrogate.scale[:, None, None]
    parts = np.stack([seen.residue.real, seen.residue.imag], axis=-1) / scale[..., None]
    parts[np.isnan(seen.residue)] = np.nan
    mean, sd = _without(
        [surrogate.residue.posterior], np.ones((1, 18 * k)), parts.reshape(n, 18 * k)
    )
    mean, sd = (v.reshape(n, k, 3, 3, 2) for v in (mean, sd))
    known = np.isfinite(mean).all(axis=-1)
    residue = np.where(known, scale * (mean[..., 0] + 1j * mean[..., 1]), plain.residue)
    both = np.where(known, scale * np.sqrt(np.mean(sd**2, axis=-1)), plain.residue_sd)
    return ModalPrediction(*hertz, *zeta, residue, both)


def _without(
    posteriors: list[Posterior], weights: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and sd (n, m) of y (n, m) left out, models (a, m) by weight; NaN where y is."""
    found = [leave_one_out(posterior, len(y)) for posterior in posteriors]
    w = (weights / weights.sum(axis=0))[:, None, :]
    means, sds = np.array([y - f.error for f in found]), np.array([f.sd for f in found])
    mean = np.sum(w * means, axis=0)
    return mean, np.sqrt(np.sum(w * (sds**2 + (means - mean) ** 2), axis=0))


def _log_normal(
    left_out: tuple[np.ndarray, np.ndarray], plain: np.ndarray, plain_sd: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    mean, sd = left_out
    known = np.isfinite(mean)
    value = np.where(known, np.exp(mean), plain)
    return value, np.where(known, value * sd, plain_sd)
