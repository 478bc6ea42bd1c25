"""One FRF as receptance, mobility or accelerance: each is iω times the one before it.

The motion per force is a displacement, a velocity or an acceleration (Ewins, Modal Testing, 2000,
ch. 1): receptance m/N, mobility m/s/N, accelerance m/s²/N.
"""

import numpy as np

from planner.errors import InputError

# How often the displacement is differentiated, by the name of the FRF.
DERIVATIVE = {"receptance": 0, "mobility": 1, "accelerance": 2}


def convert(frequency_hz: np.ndarray, frf: np.ndarray, given: str, wanted: str) -> np.ndarray:
    """FRF (..., F) of the kind `given`, in SI units, as one of the kind `wanted`, in SI units.

    frequency_hz (F,). Kinds are "receptance" (m/N), "mobility" (m/s/N), "accelerance" (m/s²/N).
    Raises InputError for another kind, and where a line at 0 Hz would have to be integrated.
    """
    for kind in (given, wanted):
        if kind not in DERIVATIVE:
            raise InputError(
                f"An FRF of kind {kind!r} is not known; say one of {', '.join(DERIVATIVE)}."
            )
    times = DERIVATIVE[wanted] - DERIVATIVE[given]
    if times < 0 and np.any(np.asarray(frequency_hz) == 0):
        raise InputError(f"A line at 0 Hz of {given} has no {wanted}: leave that line out.")
    return np.asarray(frf) * (2j * np.pi * np.asarray(frequency_hz)) ** times
