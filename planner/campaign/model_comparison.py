"""Every model of natural frequencies, each measured pose predicted from the others alone.

The modes, their labels and the simulation are those of the campaign's own model, the simulation
identified from all poses: that helps all models that use it alike.
"""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from planner.campaign.build import simulated_elsewhere
from planner.campaign.model import Model
from planner.inference.parallel import parallel_map
from planner.progress import ProgressCallback, no_progress
from planner.surrogate.average import Average
from planner.surrogate.frequency_models import MODELS
from planner.surrogate.modal_surrogate import ModalObservations, fit_primary

INSIDE = 1.96  # sds of the interval that holds 95 %


# Mean and sd (m,) of ln f at the pose left out; evidence of all, seconds of the fit.
Fitted = tuple[np.ndarray, np.ndarray, float | None, float]


def compared_models(model: Model, progress: ProgressCallback = no_progress) -> list[dict[str, Any]]:
    """How each usable one predicts measured frequencies from the other poses, the likeliest first.

    "log_density" is that of all values of ln f left out one by one, "log_evidence" that of all
    together, None where hyperparameters are not averaged; "seconds" a fit to all poses takes.
    "campaign": it is the campaign's own. None with fewer than two poses.
    """
    n, config = len(model.seen.x), model.cell.config
    usable = [m for m in MODELS if model.low.simulation or not MODELS[m].simulation]
    if n < 2:
        return []
    seen, discrepancy, belief = model.seen, model.low.discrepancy, model.low.belief
    kernel = config.surrogate.kernel
    points = {name: simulated_elsewhere(model.cell, model.low, name) for name in usable}

    def without(item: tuple[str, int]) -> Fitted:
        """A model fitted without one pose (−1: to all), and what it says there."""
        (name, left), started = item, time.perf_counter()
        kept, there = np.arange(n) != left, seen[max(left, 0) : max(left, 0) + 1]
        primary = fit_primary(
            seen[kept], discrepancy, belief, model=name, kernel=kernel, elsewhere=points[name]
        )
        mean, sd = primary.predict(there.x, np.log(there.simulated.frequency_hz), nugget=True)
        evidence = float(primary.log_evidence.sum()) if type(primary) is Average else None
        return mean[0], sd[0], evidence, time.perf_counter() - started

    items = [(name, left) for name in usable for left in range(-1, n)]
    done = parallel_map(without, items, lambda i, k: progress(items[i][0], k / len(items)))
    found = dict(zip(items, done, strict=True))
    rows = [
        _row(name, seen, found[name, -1][2], [found[name, i] for i in range(n)])
        | {"campaign": name == config.surrogate.model}
        for name in usable
    ]
    return sorted(rows, key=lambda row: -row["log_density"])


def _row(
    name: str, seen: ModalObservations, log_evidence: float | None, each: Sequence[Fitted]
) -> dict[str, Any]:
    mean, sd, _, seconds = zip(*each, strict=True)
    off = np.array(mean) - np.log(seen.frequency_hz)
    sd = np.hypot(sd, seen.frequency_sd_hz / seen.frequency_hz)
    known = np.isfinite(off)
    off, sd = off[known], sd[known]
    density = -0.5 * np.sum((off / sd) ** 2 + np.log(2 * np.pi * sd**2))
    return {
        "model": name, "about": MODELS[name].sentence,
        "rmse_percent": float(100 * np.sqrt(np.mean(np.expm1(off) ** 2))),
        "coverage95": float(np.mean(np.abs(off) <= INSIDE * sd)), "log_density": float(density),
        "log_evidence": log_evidence, "seconds": float(np.median(seconds)),  # the first compiles
    }  # fmt: skip
