"""Where a mode lies in each set of FRFs, searched for: Gauss-Newton finds what is near only."""

import numpy as np

from planner.modal.fit_data import Data
from planner.modal.residues import Lines, unit

# Trial frequencies lie so many half bandwidths apart, at most so many to either side.
STEP, MOST = 0.5, 40
REACH = 6.0  # half bandwidths around the trial frequencies that are compared
# A set's pole is moved where a trial explains more of its χ² than the pole it has by this.
GAIN = 16.0


def sought(
    data: Data, sets: tuple[np.ndarray, ...], variance: np.ndarray, rest: np.ndarray,
    pole: complex, own: np.ndarray, farthest: float,
) -> np.ndarray:  # fmt: skip
    """Poles (k,) of one mode in every set, those of `own` where no trial is clearly better.

    `rest` (e, F) is the response less all other modes, variance alike; trials lie up to
    `farthest` (rad/s) from `pole`, with its damping.
    """
    step = STEP * abs(pole.real)
    count = min(MOST, int(np.ceil(farthest / step)))
    step = farthest / count
    trials = pole + 1j * step * np.arange(-count, count + 1)
    omega = 2 * np.pi * data.frequency_hz
    far = farthest + REACH * abs(pole.real)
    near = np.flatnonzero(np.abs(omega - pole.imag) < far)
    if near.size < 8:
        return own
    root = np.sqrt(2 / variance[:, near])
    seen = rest[:, near] * root
    values = np.concatenate([seen.real, seen.imag], axis=1)
    lines, profile = data.lines.part(near), root[0] / root[0, 0]
    every = np.concatenate(sets)
    which = np.repeat(np.arange(len(sets)), [len(chosen) for chosen in sets])
    part = [_explained(lines, profile, trial, values)[every] for trial in trials]
    gain = np.array([np.bincount(which, each, len(sets)) for each in part])
    nearest = np.argmin(np.abs(trials.imag[:, None] - own.imag), axis=0)
    best = np.argmax(gain, axis=0)
    index = np.arange(len(sets))
    moved = gain[best, index] - gain[nearest, index] > GAIN
    return np.where(moved, trials[best], own)


def _explained(lines: Lines, profile: np.ndarray, trial: complex, values: np.ndarray) -> np.ndarray:
    """(e,) χ² of each entry that a mode with this pole, and a straight line, explain."""
    up, down = unit(lines, np.array([trial])), unit(lines, np.array([trial.conjugate()]))
    far = np.stack([np.ones(lines.x.size), np.linspace(-1, 1, lines.x.size)])
    columns = np.concatenate([up + down, 1j * (up - down), far, 1j * far]) * profile
    both = np.concatenate([columns.real, columns.imag], axis=1)
    return np.sum((values @ np.linalg.qr(both.T)[0]) ** 2, axis=1)
