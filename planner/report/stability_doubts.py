"""Sentences on what lines and noise of measured FRFs leave open of the limits."""

import numpy as np

from planner.milling.cut import Cut
from planner.milling.cutter_fit import CutterFit
from planner.milling.directional import Coefficients, mean_matrix
from planner.milling.hidden_modes import hidden_below
from planner.milling.uncertainty import SampledLimits

OPEN = 0.05  # of a limit, half of what holds 90 % of its samples, that is worth a sentence


def doubts(fit: CutterFit, cut: Cut, depth_m: np.ndarray, drawn: SampledLimits | None) -> list[str]:
    """On limits (n,) in m, NaN where none is known, and their samples."""
    said = []
    if drawn is not None:
        low, high = np.quantile(drawn.depth_m, (0.05, 0.95), axis=0, method="nearest")
        with np.errstate(invalid="ignore"):
            width = (high - low) / 2 / depth_m
        count = int(np.sum(~(width <= OPEN) & ~(np.isinf(low) & np.isnan(depth_m))))
        if count:
            said.append(
                f"Lines or noise of these FRFs do not suffice at {count} of {len(depth_m)} speeds: "
                f"they leave the limit open by more than ± {100 * OPEN:.0f} %. Measure at finer "
                f"lines or average more hits."
            )
    most = float(np.max(np.where(np.isnan(depth_m), cut.depth_m[1], depth_m)))
    hidden = hidden_below(fit, mean_matrix(cut, Coefficients.of(cut)), most)
    if hidden is not None:
        said.append(
            f"Below {hidden:.2g} Hz noise and lines of these FRFs would hide a mode that chatters "
            f"at less: the limits hold if the structure has none there."
        )
    return said
