"""Modal analysis by sdypy-EMA, whose user is told the true frequencies."""

import contextlib
import io
import time
import warnings

import numpy as np

LINES = np.arange(2.0, 80.0, 0.1)


def peer_poles(
    h: np.ndarray, guesses: np.ndarray, lines: np.ndarray = LINES, order: int = 40
) -> tuple[np.ndarray, np.ndarray, float]:
    """Frequencies and damping ratios that its user would pick nearest the guesses, and seconds."""
    from sdypy import EMA

    start = time.perf_counter()
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        model = EMA.Model(
            h.reshape(9, -1),
            lines,
            lower=lines[0],
            upper=lines[-1],
            pol_order_high=order,
            frf_form="accelerance",
        )
        model.get_poles(show_progress=False)
        model.select_closest_poles(list(guesses), f_window=2)
    seconds = time.perf_counter() - start
    return np.asarray(model.nat_freq), np.asarray(model.nat_xi), seconds
