"""Sentences on what lines and noise of measured FRFs leave open of the limits."""

import numpy as np

from planner.milling.cut import Cut
from planner.milling.cutter_fit import hidden_below
from planner.milling.directional import Coefficients, mean_matrix
from planner.milling.structure import Structure
from planner.milling.uncertainty import OPEN


def doubts(structure: Structure, cut: Cut, depth_m: np.ndarray, known: np.ndarray) -> list[str]:
    """On limits (n,) in m, NaN or inf where there is none, and whether samples agree on them."""
    fit, said = structure.fit, []
    if fit is None:
        return []
    if not np.all(known):
        said.append(
            f"Lines or noise of these FRFs do not suffice at {np.sum(~known)} of {len(known)} "
            f"speeds: they leave the limit open by more than ± {100 * OPEN:.0f} %. Measure at "
            f"finer lines or average more hits."
        )
    most = float(np.max(np.where(np.isfinite(depth_m), depth_m, cut.depth_m[1])))
    hidden = hidden_below(fit, mean_matrix(cut, Coefficients.of(cut)), most)
    if hidden is not None:
        said.append(
            f"Below {hidden:.2g} Hz noise and lines of these FRFs would hide a mode that chatters "
            f"at less: the limits hold if the structure has none there."
        )
    return said
