"""Leave-one-out: how each measurement is predicted from all the others.

For every hyperparameter sample the answer is in closed form (Sundararajan & Keerthi 2001): error
α_i/(K⁻¹)_ii with variance 1/(K⁻¹)_ii, the measurement's own noise included. The samples, which
have seen the measurement, are weighed by how little they needed it (importance sampling with
truncated weights, Ionides 2008).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.surrogate.ar1 import AR1
from planner.surrogate.average import mixed
from planner.surrogate.frf_bands import ModalPrediction
from planner.surrogate.gp import Posterior
from planner.surrogate.modal_surrogate import ModalObservations, Surrogate, residue_parts

LEVELS = (0.5, 0.8, 0.9, 0.95)


@dataclass(frozen=True, eq=False)
class LeaveOneOut:
    """Of n measurements and m outputs (n, m), NaN where there is none.

    `error` is measured less predicted, `sd` what was expected of it, `rank` the share of the
    predictive distribution below the measurement: uniform on [0, 1] if the model is calibrated.
    """

    error: np.ndarray
    sd: np.ndarray
    rank: np.ndarray

    def coverage(self, levels: tuple[float, ...] = LEVELS) -> np.ndarray:
        """Share of the measurements inside the central interval of each level."""
        known = self.rank[np.isfinite(self.rank)]
        if not len(known):
            return np.full(len(levels), np.nan)
        return np.array([np.mean(np.abs(known - 0.5) <= level / 2) for level in levels])

    @property
    def surprise(self) -> np.ndarray:
        """(n, m) errors in sds of what was expected of them, 0 where there is none."""
        return np.where(np.isfinite(self.error), np.abs(self.error / self.sd), 0.0)

    def worst(self, count: int = 3) -> np.ndarray:
        """Indices of the measurements that surprise most."""
        return np.argsort(-self.surprise.max(axis=1), kind="stable")[:count]


def leave_one_out(outputs: Sequence[Posterior], measurements: int) -> LeaveOneOut:
    """Of the first `measurements` (n) rows that the outputs were fitted to."""
    from scipy.special import ndtr  # 0.1 s, which predictions do not need

    shape = (measurements, len(outputs))
    error, sd, rank = (np.full(shape, np.nan) for _ in range(3))
    for j, output in enumerate(outputs):
        known = output.rows[output.rows < measurements]
        count, solved = len(known), output.solved
        precision = np.sum(solved.whiten**2, axis=1)[:, :count]  # (k, i): diagonal of K⁻¹
        off, spread = solved.weights[:, :count] / precision, 1 / np.sqrt(precision)
        needed = 0.5 * (off / spread) ** 2 + np.log(spread) + 0.5 * np.log(2 * np.pi)
        w = np.exp(needed - needed.max(axis=0))
        w = np.minimum(w, np.sqrt(len(w)) * w.mean(axis=0))
        w = w / w.sum(axis=0)
        mean = np.sum(w * off, axis=0)
        error[known, j] = mean
        sd[known, j] = np.sqrt(np.sum(w * (spread**2 + (off - mean) ** 2), axis=0))
        rank[known, j] = np.sum(w * ndtr(off / spread), axis=0)
    return LeaveOneOut(error, sd, rank)


def left_out_modes(surrogate: Surrogate, seen: ModalObservations) -> ModalPrediction:
    """Modes (n, k) at the n measured poses, each without its own; `surrogate` has residues.

    In closed form, by the likelier of hedged models. What was not found at a pose is predicted.
    """
    n, k = seen.frequency_hz.shape
    plain = surrogate.predict(seen.x, seen.simulated)
    assert surrogate.residue is not None
    alone, one = [surrogate.primary.most_probable], np.ones((1, k))
    frequency = _without(alone, one, np.log(seen.frequency_hz))
    fits = surrogate.damping
    weights = fits.weights[fits.counted]
    damping = _without([fits.models[i] for i in fits.counted], weights, np.log(seen.damping_ratio))
    hertz = _log_normal(frequency, plain.frequency_hz, plain.frequency_sd_hz)
    zeta = _log_normal(damping, plain.damping_ratio, plain.damping_sd)
    scale = surrogate.scale[:, None, None]
    parts = residue_parts(seen.residue) / np.repeat(surrogate.scale, 18)
    found = _without([surrogate.residue.most_probable], np.ones((1, 18 * k)), parts)
    mean, sd = (v.reshape(n, k, 3, 3, 2) for v in found)
    known = np.isfinite(mean).all(axis=-1)
    residue = np.where(known, scale * (mean[..., 0] + 1j * mean[..., 1]), plain.residue)
    both = np.where(known, scale * np.sqrt(np.mean(sd**2, axis=-1)), plain.residue_sd)
    return ModalPrediction(*hertz, *zeta, residue, both)


def _without(
    models: list[AR1], weights: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and sd (n, m) of y (n, m) left out, models (a, m) by weight; NaN where y is."""
    found = [leave_one_out(model.outputs, len(y)) for model in models]
    return mixed(weights, np.array([y - f.error for f in found]), np.array([f.sd for f in found]))


def _log_normal(
    left_out: tuple[np.ndarray, np.ndarray], plain: np.ndarray, plain_sd: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    mean, sd = left_out
    known = np.isfinite(mean)
    value = np.where(known, np.exp(mean), plain)
    return value, np.where(known, value * sd, plain_sd)


def report(residuals: LeaveOneOut, poses: tuple[str, ...], outputs: tuple[str, ...]) -> list[str]:
    """Lines for the user: coverage, and the poses that surprise most."""
    count = int(np.isfinite(residuals.rank).sum())
    if count == 0 or len(poses) < 2:
        return ["No pose can be predicted from the others yet: too few are measured."]
    ends = LEVELS[0], LEVELS[-1]
    inside = [
        f"{count * share:.0f} lie in their {100 * level:.0f} % interval ({count * level:.0f} "
        f"expected)"
        for level, share in zip(ends, residuals.coverage(ends), strict=True)
    ]
    lines = [
        f"Test of the model, each pose predicted from the others alone: of {count} measured "
        f"frequencies {' and '.join(inside)}."
    ]
    for i in residuals.worst():
        score = residuals.surprise[i]
        j = int(np.argmax(score))
        if score[j] > 2:
            lines.append(f"{poses[i]}: {outputs[j]} is {score[j]:.1f} sd off what the others say.")
    return lines
