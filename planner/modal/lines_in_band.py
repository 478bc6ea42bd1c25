"""What is said where FRFs have too few lines in the band that is looked at."""

import numpy as np

from planner.errors import RefusedError


def too_few_lines(
    usable: np.ndarray, frequency_hz: np.ndarray, band_hz: tuple[float, float]
) -> RefusedError:
    """The refusal of FRFs at lines (F,), of which those that are `usable` (F,) are too few."""
    first, last = float(frequency_hz[0]), float(frequency_hz[-1])
    band = f"{band_hz[0]:g} to {band_hz[1]:g} Hz"
    if last < band_hz[0]:
        off = f"The FRFs end at {last:g} Hz, below the band of {band}"
    elif first > band_hz[1]:
        off = f"The FRFs begin at {first:g} Hz, above the band of {band}"
    else:
        return RefusedError(
            f"Only {np.count_nonzero(usable)} usable frequency lines lie in the band of {band}, of "
            f"FRFs between {first:g} and {last:g} Hz: give another band with --band-hz, "
            f"record longer or hit with a harder tip."
        )
    return RefusedError(f"{off} in which modes are looked for; give another with --band-hz.")
