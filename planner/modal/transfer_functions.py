"""Modes of transfer functions of which only the numbers are known: no scale, no scatter, no labels.

Roving sensors, mains hum and windows leave errors that no variance describes, so that no fit can
say which small pole is real. What counts here is what stays put: poles of many model orders, in
overlapping parts of the band so that few modes are sought at once, that carry a good share of the
response at their frequency.
"""

import numpy as np

from planner.errors import InputError, RefusedError
from planner.frf.synthesis import DERIVATIVE, convert
from planner.modal.fit_data import Data, too_few_lines
from planner.modal.mode_selection import presences
from planner.modal.modes import UNSCALED, ModalModel, Mode
from planner.modal.plscf import plscf, stable
from planner.modal.residues import lsfd, rank_one
from planner.recording.records import FrfRecord

MAX_ORDER = 40
# Each part of the band spans an octave and is fitted with half an octave more on either side.
SPAN, OVERLAP = 2.0, 2.0**0.5
LEAST_LINES = 64  # of a part
# A line of the diagram that is a mode: part of the range of orders that it spans, share of them
# that have it, scatter in bandwidths over the upper ones, damping, and part of the response at
# its frequency.
REACH, SHARE, SCATTER, DAMPING, PRESENCE = 0.3, 0.8, 0.2, 0.08, 0.3


def modes_from_transfer_functions(
    record: FrfRecord, quantity: str | None = None, band_hz: tuple[float, float] | None = None
) -> ModalModel:
    """Modes of FRFs (k, F) without usable labels, all of them from one hit point.

    `quantity` is "accelerance", "mobility" or "receptance" where the file does not say so (the
    person must know). Standard deviations are those of the poles over model orders. Shapes have
    one entry per FRF in the order of the file; residues are NaN, because nothing scales them.
    Raises InputError without a quantity and RefusedError where nothing is stable.
    """
    stated = record.quantity if record.quantity in DERIVATIVE else quantity
    if stated is None:
        raise InputError(
            f"{record.source} does not say whether its FRFs are accelerance, mobility or "
            f"receptance; add --quantity with one of these."
        )
    keep = record.frequency_hz > 0
    frequency = record.frequency_hz[keep]
    response = convert(frequency, record.values[:, keep], stated, "accelerance")[:, None, :]
    step = frequency[1] - frequency[0]
    band = band_hz or (8 * float(step), float(frequency[-1]) / 1.2)
    inside = (frequency >= band[0]) & (frequency <= band[1])
    if np.count_nonzero(inside) < 8:
        raise too_few_lines(inside, frequency, band)
    modes = [m for part in _parts(band, step) for m in _part(frequency, response, part)]
    if not modes:
        raise RefusedError(
            f"{record.source}: no pole stays put between {band[0]:g} and {band[1]:g} Hz; widen "
            f"the band or record longer."
        )
    remarks = (
        f"Of {response.shape[0]} FRFs without labels: shapes follow the order of the files and are "
        f"not scaled; standard deviations are the scatter over model orders.",
    )
    return ModalModel(tuple(modes), band, float("nan"), MAX_ORDER, (*record.remarks, *remarks))


def _parts(band: tuple[float, float], step_hz: float) -> list[tuple[float, float]]:
    """Bands that touch, each of at most SPAN and of enough lines."""
    parts, low = [], band[0]
    while low < band[1] * 0.999:
        high = min(band[1], max(SPAN * low, low + LEAST_LINES * step_hz))
        parts.append((low, high))
        low = high
    return parts


def _part(frequency: np.ndarray, response: np.ndarray, part: tuple[float, float]) -> list[Mode]:
    step = frequency[1] - frequency[0]
    low = min(part[0] / OVERLAP, part[0] - 4 * step)
    high = max(part[1] * OVERLAP, part[1] + LEAST_LINES * step / 2)
    lines = (frequency >= low) & (frequency <= high)
    f, h = frequency[lines], response[..., lines]
    found = plscf(f, h, MAX_ORDER, reach_hz=(low, high))
    chosen = [line for line in stable(found) if line.reach >= REACH * found.order]
    if not chosen:
        return []
    poles = np.array([line.pole for line in chosen])
    residues = lsfd(f, h, poles)
    present = presences(Data(f, h, None), poles, residues[:, 0])
    modes = []
    for k, line in enumerate(chosen):
        presence = float(present[k])
        inside = part[0] <= line.frequency_hz < part[1]
        still = line.share >= SHARE and line.scatter <= SCATTER
        if inside and still and line.damping_ratio <= DAMPING and presence >= PRESENCE:
            share = min(1.0, line.reach / found.order + 0.3)
            # Rough: how often it was there, how still it stood, how much of the response it is.
            certain = share * min(1.0, presence) ** 0.25 * (1 - line.scatter)
            hz_sd = float(np.std(np.abs(line.late)) / (2 * np.pi))
            damping_sd = float(np.std(-line.late.real / np.abs(line.late)))
            told = line.frequency_hz, hz_sd, line.damping_ratio, damping_sd
            shape = rank_one(residues[:, :, k])[0]
            modes.append(Mode(*told, *UNSCALED, shape, float(certain)))
    return modes
