"""When to stop: the RMSE over the workspace as the model itself predicts it, with a probability.

Samples of the error field (discrepancy and parameters together) give samples of its root mean
square. The model's sds are corrected: leave-one-out residuals, in units of the sds, give the
posterior of a common factor on them (scaled inverse χ², Gelman et al. 2013, section 2.6).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from planner.inference.covariance import covariance_root
from planner.words import counted, significant

if TYPE_CHECKING:  # a forecast that was kept is read without JAX
    from planner.design.frequency_posterior import FrequencyOutputs, Poses
    from planner.surrogate.gp import Posterior

FIELD_SAMPLES = 400  # samples of the error field, at least
# Errors are as large as the model says, to within a factor of two, before any is seen.
PRIOR_COUNT = 4.0
MOST_PERCENT = 100.0  # what is larger is said to be larger
WORKSPACE_POINTS = 64  # of the workspace, the first ones, over which the mean is taken


@dataclass(frozen=True)
class Forecast:
    """Predicted frequency RMSE over the workspace (%): median, and what it is below with
    `probability`; `reached` is the probability that it is below `target`.
    """

    rmse_percent: float
    bound_percent: float
    probability: float
    target_percent: float
    reached: float
    calibration: float  # size of left-out residuals in sds, 1 where the model is right
    gain_percent: float  # of the RMSE, by one more measurement
    measurements: int
    misses: float = 0.0  # of the simulation, in sds of the noise, where they make it no forecast

    def doubted(self, misses: float) -> "Forecast":
        """The same where a simulation misses what was measured by so many sds of its noise.

        Left-out residuals of a few poses do not tell what that does elsewhere: it is as much wider.
        """
        rmse, bound = self.rmse_percent * misses, self.bound_percent * misses
        return replace(self, rmse_percent=rmse, bound_percent=bound, reached=0.0, misses=misses)

    @property
    def text(self) -> str:
        """One or two sentences for the engineer."""
        return " ".join(filter(None, (self.known, self.outlook)))

    @property
    def known(self) -> str:
        """How far frequencies are off, in a sentence."""
        if self.misses:
            few = counted(self.measurements, "pose") if self.measurements else "one pose"
            return (
                f"How far frequencies are off over the workspace is not known: the simulation "
                f"misses the recordings by {self.misses:.2g} times their noise, and {few} cannot "
                f"tell what that does elsewhere. Look at the hits first (axis, sign, point), or "
                f"measure on."
            )
        if not self.measurements:  # of one pose nothing can be left out
            return (
                "How far frequencies are off over the workspace is told once two poses are "
                "measured: until then nothing shows how far the model can be trusted."
            )
        known = f"The frequencies' RMSE over the workspace is about {percent(self.rmse_percent)}"
        share = f"{100 * self.probability:.0f} % probability"
        if self.bound_percent > MOST_PERCENT:
            return f"{known}; too little is known for a bound with {share}."
        return f"{known}, below {percent(self.bound_percent)} with {share}."

    @property
    def outlook(self) -> str:
        """What one more measurement is expected to make of it, in a sentence; "": nobody knows."""
        if self.misses or not self.measurements:
            return ""
        left = percent(self.rmse_percent - self.gain_percent)
        return f"One more pose should bring the RMSE to about {left}."


def percent(value: float) -> str:
    """A percentage with two digits, in no power of ten; what is over 100 is no forecast."""
    if value > MOST_PERCENT:
        return f"more than {MOST_PERCENT:.0f} %"
    return f"{significant(value, 2)} %"


def forecast(
    outputs: "FrequencyOutputs",
    best: "Poses | None",
    target_percent: float,
    probability: float,
    least: float = 0.0,
) -> Forecast:
    """What the model expects of itself; `best` (n = 1) is the pose that would be measured next.

    `least` is what the mean square of ln f is at least, where the outputs do not have all that few
    poses leave open.
    """
    squares = mean_squares(outputs)
    open_ = max(0.0, least - float(np.mean(squares)))
    squares += open_
    count, size = left_out(outputs.posteriors)
    rng = np.random.default_rng(0)
    # The residuals of one pose go together: they count as one.
    freedom, total = PRIOR_COUNT + count, PRIOR_COUNT + count * size**2
    scale = total / rng.chisquare(freedom, len(squares))
    rmse = 100 * np.sqrt(squares * scale)
    bound = float(np.quantile(rmse, probability))
    after = squares if best is None else open_ + mean_squares(outputs.planning(best))
    median = float(np.median(rmse))
    gain = median * (1 - np.sqrt(np.mean(after) / np.mean(squares)))
    return Forecast(
        median, bound, probability, target_percent, float(np.mean(rmse <= target_percent)),
        float(np.sqrt(total / freedom)), max(float(gain), 0.0), count,
    )  # fmt: skip


def mean_squares(outputs: "FrequencyOutputs") -> np.ndarray:
    """Samples (≥ FIELD_SAMPLES,) of the weighted mean square error of ln f over the workspace."""
    rng = np.random.default_rng(0)
    poses = outputs.workspace.poses[:WORKSPACE_POINTS]
    importance = outputs.workspace.importance[:WORKSPACE_POINTS]
    importance = importance / importance.sum()
    samples = len(outputs.posteriors[0].theta)
    each = -(-FIELD_SAMPLES // samples)
    p = len(outputs.covariance_root)
    parameters = rng.standard_normal((samples * each, p)) @ outputs.covariance_root.T
    total = np.zeros(samples * each)
    for k in range(outputs.count):
        error = outputs.trust[k] * parameters @ poses.slope[:, k].T
        between, _, _ = outputs.covariance(k, poses, poses)
        means, _ = outputs.posteriors[k].predictive(poses.x, poses.low[:, k])
        apart = means - means.mean(axis=0)  # of each sample of the hyperparameters from all
        for s, one in enumerate(between):
            drawn = rng.standard_normal((each, len(poses))) @ covariance_root(one).T
            error[s * each : (s + 1) * each] += drawn + apart[s]
        total += error**2 @ importance[:, k]
    return total


def left_out(posteriors: "Sequence[Posterior]") -> tuple[int, float]:
    """Measured poses, and the size (rms) of their residuals, left out, in sds of the prediction.

    In closed form (Rasmussen & Williams 2006, eq. 5.12), averaged over the hyperparameters.
    """
    squares, poses = [], 0
    for posterior in posteriors:
        poses = max(poses, len(posterior.x))
        if len(posterior.x) < 2:
            continue
        solved = posterior.solved
        variance = 1 / np.sum(solved.whiten**2, axis=1)
        residual = solved.weights * variance
        mixed = np.mean(variance, axis=0) + np.var(residual, axis=0)
        squares.append(np.mean(residual, axis=0) ** 2 / mixed)
    if not squares:
        return 0, 1.0
    return poses, float(np.sqrt(np.mean(np.concatenate(squares))))
