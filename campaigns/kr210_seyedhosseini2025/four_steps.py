"""The four-step check of modes at neighbouring postures (Seyed Hosseini et al. 2025, section II.A).

A mode is kept where (1) the FRFs have a peak, (2) their phase turns and their coherence is high,
(3) neighbouring postures have it at nearly the same frequency, (4) the stabilisation diagram has
it, which modal analysis asks for anyway. A mode that a posture lacks between postures that have it
is looked for again among the poles that modal analysis held for doubtful, near the frequency
between its neighbours'.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.frf.frf import Frf
from planner.modal.modes import Mode

# Chosen: a peak may lie beside a pole by so many half-widths; phase that turns (rad) over a
# half-width to both sides; coherence; how far (log f) neighbours may differ.
PEAK_WIDTHS, TURN_RAD, COHERENT, ALIKE = 2.0, 0.5, 0.8, 0.05
REACH = 3  # postures to either side that are neighbours


@dataclass(frozen=True, eq=False)
class Checked:
    """Modes by posture and label after the check, and the share of found ones passing each step.

    `recovered` (n, k): looked for again and found; `doubted` (n, k): found at first, and dropped.
    """

    modes: tuple[tuple[Mode | None, ...], ...]
    passed: dict[str, float]
    recovered: np.ndarray
    doubted: np.ndarray


def check(
    frfs: Sequence[Frf],
    modes: Sequence[Sequence[Mode | None]],
    doubtful: Sequence[Sequence[Mode]],
) -> Checked:
    """Check labelled modes of n postures in the order of the trajectory."""
    shape = len(modes), len(modes[0])
    peak, turned = np.zeros(shape, bool), np.zeros(shape, bool)
    for i, (frf, row) in enumerate(zip(frfs, modes, strict=True)):
        for k, mode in enumerate(row):
            if mode is not None:
                peak[i, k], turned[i, k] = _has_peak(frf, mode), _turns(frf, mode)
    found = np.array([[mode is not None for mode in row] for row in modes])
    expected = _between(modes, found & (peak | turned))
    with np.errstate(invalid="ignore"):
        alike = np.abs(_log_f(modes) - expected) < ALIKE
    alike |= ~np.isfinite(expected)
    kept = found & (peak | turned) & alike
    out = [[m if keep else None for m, keep in zip(row, kept[i], strict=True)]
           for i, row in enumerate(modes)]  # fmt: skip
    recovered = np.zeros(shape, bool)
    for i, k in zip(*np.nonzero(~kept & np.isfinite(expected)), strict=True):
        near = [m for m in doubtful[i] if abs(np.log(m.frequency_hz) - expected[i, k]) < ALIKE]
        taken = {id(m) for m in out[i]}
        near = [m for m in near if id(m) not in taken]
        if near:
            out[i][k] = max(near, key=lambda mode: mode.probability)
            recovered[i, k] = True
    steps = {"a peak": peak, "phase and coherence": turned, "neighbours": alike & found}
    share = {name: float(np.sum(which & found) / max(found.sum(), 1)) for name, which in
             steps.items()}  # fmt: skip
    share["stabilisation"] = 1.0
    return Checked(tuple(tuple(row) for row in out), share, recovered, found & ~kept)


def _has_peak(frf: Frf, mode: Mode) -> bool:
    size = np.nansum(np.abs(frf.accelerance) ** 2, axis=(0, 1)) / frf.frequency_hz**4
    inner = (size[1:-1] >= size[:-2]) & (size[1:-1] >= size[2:])
    peaks = frf.frequency_hz[1:-1][inner]
    line = float(frf.frequency_hz[1] - frf.frequency_hz[0])
    near = max(PEAK_WIDTHS * mode.damping_ratio * mode.frequency_hz, 2 * line)
    return bool(np.any(np.abs(peaks - mode.frequency_hz) < near))


def _turns(frf: Frf, mode: Mode) -> bool:
    """Of the direct FRF in which the mode is strongest."""
    axis = int(np.nanargmax(np.abs(np.diagonal(mode.residue))))
    half = mode.damping_ratio * mode.frequency_hz
    hz = frf.frequency_hz
    near = np.abs(hz - mode.frequency_hz) <= max(half, 2 * float(hz[1] - hz[0]))
    if np.count_nonzero(near) < 2:
        return False
    phase = np.unwrap(np.angle(frf.accelerance[axis, axis, near]))
    coherence = float(np.nanmedian(frf.coherence[axis, axis, near]))
    return bool(abs(phase[-1] - phase[0]) > TURN_RAD and coherence > COHERENT)


def _log_f(modes: Sequence[Sequence[Mode | None]]) -> np.ndarray:
    return np.array(
        [[np.nan if m is None else np.log(m.frequency_hz) for m in row] for row in modes]
    )


def _between(modes: Sequence[Sequence[Mode | None]], trusted: np.ndarray) -> np.ndarray:
    """Median log f (n, k) of the trusted neighbours along the trajectory, NaN without any."""
    log_f = np.where(trusted, _log_f(modes), np.nan)
    out = np.full(log_f.shape, np.nan)
    for i in range(len(log_f)):
        rows = [j for j in range(i - REACH, i + REACH + 1) if j != i and 0 <= j < len(log_f)]
        for k in range(log_f.shape[1]):
            near = log_f[rows, k]
            if np.isfinite(near).any():
                out[i, k] = np.median(near[np.isfinite(near)])
    return out
