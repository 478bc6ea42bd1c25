"""Universal files: FRFs and coherences as dataset 58, modes as dataset 55 (SDRC 1995, as text)."""

from collections.abc import Sequence

import numpy as np

from planner.campaign.events import MeasuredMode
from planner.frf.frf import Frf

AXES = "xyz"
HIT_NODE, SENSOR_NODE = 1, 2
FRF, COHERENCE = 4, 6  # function types of dataset 58
COMPLEX_DOUBLE, REAL_DOUBLE = 6, 4
ACCELERATION, FORCE, FREQUENCY, NONE = (12, "m/s^2"), (13, "N"), (18, "Hz"), (0, "NONE")


def frf_sets(
    frequency_hz: np.ndarray, accelerance: np.ndarray, title: str, coherence: np.ndarray | None
) -> str:
    """Dataset 58 of every FRF of a matrix (3, 3, F) in m/s²/N; columns that are NaN are left out.

    The node of the hits is 1, that of the sensor 2; directions 1, 2, 3 are x, y, z. `coherence`
    (3, 3, F) follows each FRF as function type 6 where it is known.
    """
    parts = []
    for i, j in np.ndindex(3, 3):
        if np.isfinite(accelerance[i, j]).all():
            parts.append(_function(FRF, frequency_hz, accelerance[i, j], (i, j), title))
            if coherence is not None and np.isfinite(coherence[i, j]).all():
                parts.append(_function(COHERENCE, frequency_hz, coherence[i, j], (i, j), title))
    return "".join(parts)


def measured_sets(frf: Frf, title: str) -> str:
    """Dataset 58 of a measured FRF matrix with its coherences."""
    return frf_sets(frf.frequency_hz, frf.accelerance, title, frf.coherence)


def mode_sets(modes: Sequence[MeasuredMode], title: str) -> str:
    """Dataset 55 of each mode: complex eigenvalue in rad/s and shape at the sensor's node."""
    return "".join(_mode(mode, number, title) for number, mode in enumerate(modes, 1))


def _line(text: str) -> str:
    return f"{text.encode('ascii', 'replace').decode()[:80]:<80}\n"


def _function(
    kind: int, frequency_hz: np.ndarray, values: np.ndarray, place: tuple[int, int], title: str
) -> str:
    """One dataset 58 with evenly spaced lines; `place` is (response, hit) from 0."""
    i, j = place
    form = COMPLEX_DOUBLE if np.iscomplexobj(values) else REAL_DOUBLE
    step = float(frequency_hz[1] - frequency_hz[0]) if len(frequency_hz) > 1 else 0.0
    names = f"response {AXES[i]}", f"hit {AXES[j]}"
    head = [_line(t) for t in (title, f"{names[0]}, {names[1]}", "NONE", "NONE", "NONE")]
    head.append(
        f"{kind:5d}{0:10d}{0:5d}{0:10d} {'SENSOR':<10}{SENSOR_NODE:10d}{i + 1:4d}"
        f" {'HIT':<10}{HIT_NODE:10d}{j + 1:4d}\n"
    )
    head.append(
        f"{form:10d}{len(frequency_hz):10d}{1:10d}{frequency_hz[0]:13.5E}{step:13.5E}{0:13.5E}\n"
    )
    over, under = (ACCELERATION, FORCE) if kind == FRF else (NONE, NONE)
    for number, unit in (FREQUENCY, over, under, NONE):
        head.append(f"{number:10d}{0:5d}{0:5d}{0:5d} {'NONE':<20} {unit:<20}\n")
    flat = values.astype(complex).view(float) if form == COMPLEX_DOUBLE else values
    return f"    -1\n    58\n{''.join(head)}{_numbers(flat)}    -1\n"


def _numbers(values: np.ndarray) -> str:
    rows = [values[k : k + 4] for k in range(0, len(values), 4)]
    return "".join("".join(f"{v:20.12E}" for v in row) + "\n" for row in rows)


def _mode(mode: MeasuredMode, number: int, title: str) -> str:
    w, z = 2 * np.pi * mode.frequency_hz, mode.damping_ratio
    pole = complex(-z * w, w * np.sqrt(max(0.0, 1 - z * z)))
    shape = np.array(mode.shape, dtype=float).ravel()
    said = f"{mode.frequency_hz:.6g} Hz, damping ratio {z:.4g}"
    head = [_line(t) for t in (title, f"mode {number}: {said}", "NONE", "NONE", "NONE")]
    # Structural, complex eigenvalue of first order, 3 translations of displacement, complex.
    head.append("".join(f"{v:10d}" for v in (1, 3, 2, 8, 5, 3)) + "\n")
    head.append("".join(f"{v:10d}" for v in (2, 6, 1, number)) + "\n")
    head.append("".join(f"{v:13.5E}" for v in (pole.real, pole.imag, 0, 0, 0, 0)) + "\n")
    data = f"{SENSOR_NODE:10d}\n" + "".join(f"{v:13.5E}" for v in shape) + "\n"
    return f"    -1\n    55\n{''.join(head)}{data}    -1\n"
