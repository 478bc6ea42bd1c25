"""An exponential window that nobody told of, from the noise of the force after the pulse.

Once the pulse is over the force channel holds noise alone, which stays as large as it is unless
the analyser has laid a window over it. No model of the robot is needed.
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize_scalar

from planner.dataset.dataset import Dataset
from planner.diagnosis.finding import Finding
from planner.diagnosis.thresholds import WINDOW_FASTEST_1_S, WINDOW_LEAST_1_S, WINDOW_RATE_WIDTH_1_S

LEAST_SAMPLES = 64


def screen_window(recorded: Dataset) -> Finding | None:
    """`exponential_window` with its rate, where the noise of the force decays after the pulse."""
    told = [part for visit in recorded.visits for part in map(_noise, visit.hits) if part]
    if not told:
        return None

    def loss(rate: float) -> float:
        return -_log_likelihood(told, rate)

    found = minimize_scalar(loss, bounds=(-5.0, WINDOW_FASTEST_1_S), method="bounded")
    rate = float(found.x)
    curvature = (loss(rate + 0.01) - 2 * loss(rate) + loss(rate - 0.01)) / 1e-4
    sd = float(1 / np.sqrt(max(curvature, 1e-9)))
    evidence = (
        loss(0.0) - loss(rate) + float(np.log(np.sqrt(2 * np.pi) * sd / WINDOW_RATE_WIDTH_1_S))
    )
    if rate < WINDOW_LEAST_1_S or evidence < 0:
        return None
    text = (
        f"The noise of the force fades by {rate:.3g} ± {sd:.1g} 1/s after the pulse: an "
        f"exponential window of {1 / rate:.3g} s is left in the recordings and adds as much "
        f"decay to every mode; correct for it."
    )
    parameters = {
        "time_constant": (1 / rate, sd / rate**2, "s"),
        "rate": (rate, sd, "1/s"),
    }
    return Finding("exponential_window", "sensor", evidence, parameters, text)


def _noise(hit) -> tuple[np.ndarray, np.ndarray] | None:
    """Times (n,) after the pulse in s, and what the force channel holds then."""
    _, last = hit.pulse.around(len(hit.force_n))
    rest = hit.force_n[last:]
    if len(rest) < LEAST_SAMPLES or len(np.unique(rest)) < LEAST_SAMPLES / 2:
        return None  # blanked by a force window, or coarser than its noise
    # Neighbours' differences: an offset, which a window would bend, is gone.
    steps = np.diff(rest)
    return (np.arange(len(steps)) + last - hit.pulse.peak) / hit.sampling_rate_hz, steps


def _log_likelihood(told: Sequence[tuple[np.ndarray, np.ndarray]], rate: float) -> float:
    """Of normal noise whose size falls as e^(−rate·t), each hit's own size profiled out."""
    total = 0.0
    for t, x in told:
        # Differences are correlated with their neighbours: they tell half as much.
        power = np.mean(x**2 * np.exp(2 * rate * t))
        total += 0.5 * (-len(x) / 2 * np.log(power) + rate * float(t.sum()))
    return total
