"""Measured receptances as few common modes: what noise adds from line to line is taken out.

Rotations are small differences of measured motions, so noise is what limits them most. All FRFs of
one structure share their poles, and each mode has one shape.
"""

from dataclasses import replace

import numpy as np

from planner.milling.coupling import TipReceptance
from planner.modal.estimate_modes import identify
from planner.modal.fit_data import Data
from planner.modal.rank_one_fit import Entries
from planner.modal.shape_fit import shape_fit


def smoothed(tip: TipReceptance) -> TipReceptance:
    """The same from smoothed measured values, and a remark; as it is where no sd is stated.

    Also as it is, and said so, where no fit by common modes comes near the noise.
    """
    if not np.all(tip.sd > 0):
        return tip
    square = (2 * np.pi * tip.frequency_hz) ** 2
    accelerance = -np.moveaxis(tip.measured, 0, -1) * square
    variance = (np.moveaxis(tip.sd, 0, -1) * square) ** 2
    data = Data(tip.frequency_hz, accelerance, variance, above=True, steady=True)
    found, count = identify(data), len(accelerance)
    rows, columns = np.divmod(np.arange(count**2), count)
    fit = None if found is None else shape_fit(data, found.fit, Entries(rows, columns, count))
    if fit is None or fit.chi2 > 1.2:  # per degree of freedom: beyond, sds would not hold
        text = "The FRFs are used line by line: few common modes do not follow them to their noise."
        return replace(tip, remarks=(*tip.remarks, text))
    text = (
        f"The FRFs are those of {fit.poles.size} common modes fitted to them, "
        f"misfit {np.sqrt(fit.chi2):.2f} of their noise."
    )
    measured = np.moveaxis((-fit.response / square).reshape(accelerance.shape), -1, 0)
    errors = (-fit.errors / square).reshape(-1, *accelerance.shape)
    errors = np.moveaxis(errors, -1, 1)
    sd = np.sqrt(np.sum(np.abs(errors) ** 2, axis=0))
    return replace(tip, measured=measured, sd=sd, errors=errors, remarks=(*tip.remarks, text))
