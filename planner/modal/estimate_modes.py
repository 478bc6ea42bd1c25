"""From the FRF matrix of one pose to its modes, without an expert."""

import numpy as np

from planner.errors import RefusedError
from planner.frf.frf import Frf
from planner.modal.fit_data import Data
from planner.modal.lines_in_band import too_few_lines
from planner.modal.modes import LEAST_PROBABILITY, ModalModel, Mode
from planner.modal.pole_identification import MAX_ORDER, Identified, PoleIdentification, identify
from planner.modal.residues import rank_one

# Lines beyond the band that are fitted too, so that modes at its edges are met from both sides.
MARGIN = 0.15


def estimate_modes(
    frf: Frf, band_hz: tuple[float, float], max_order: int = MAX_ORDER
) -> ModalModel:
    """All modes in `band_hz` (Hz), with standard deviations and probabilities.

    Poles are those of the structure: an exponential window of the records is part of the fitted
    model. Standard deviations follow from `frf.variance`, enlarged where the error of the fit
    exceeds it, and from the error alone where the variance is unknown. Raises RefusedError where
    no mode can be found.
    """
    found = identification(frf, band_hz, max_order)
    columns = np.flatnonzero(frf.measured)
    inside = [
        m for m in (found.modes if found else ()) if band_hz[0] <= m.frequency_hz <= band_hz[1]
    ]
    modes = tuple(_mode(m, columns) for m in inside if m.probability >= LEAST_PROBABILITY)
    doubtful = tuple(_mode(m, columns) for m in inside if m.probability < LEAST_PROBABILITY)
    if found is None or not modes:
        raise RefusedError(
            f"No mode could be found between {band_hz[0]:g} and {band_hz[1]:g} Hz: hit harder or"
            " with another tip, or check that the band holds a resonance."
        )
    remarks = _remarks(found, doubtful)
    return ModalModel(modes, band_hz, found.fit_error, found.order, remarks, doubtful)


def identification(
    frf: Frf, band_hz: tuple[float, float], max_order: int = MAX_ORDER
) -> PoleIdentification | None:
    """The same with everything in between (stabilisation diagram, fit), None without a mode.

    Raises RefusedError where too few frequency lines are usable.
    """
    return identify(_select(frf, band_hz), max_order)


def _select(frf: Frf, band_hz: tuple[float, float]) -> Data:
    usable = frf.usable_band_hz
    low = max(band_hz[0] / (1 + MARGIN), usable[0], 1e-9)
    high = min(band_hz[1] * (1 + MARGIN), usable[1])
    columns = np.flatnonzero(frf.measured)
    h = frf.accelerance[:, columns]
    chosen = (frf.frequency_hz >= low) & (frf.frequency_hz <= high)
    chosen &= np.all(np.isfinite(h), axis=(0, 1))
    if columns.size == 0 or np.count_nonzero(chosen) < 8 or not np.any(h[..., chosen]):
        raise too_few_lines(chosen, frf.frequency_hz, band_hz)
    variance = frf.variance[:, columns][..., chosen]
    known = np.all(np.isfinite(variance) & (variance > 0))
    force = frf.force_share
    return Data(
        frf.frequency_hz[chosen],
        h[..., chosen],
        variance if known else None,
        frf.exponential_rate_1_s,
        tail_s=frf.tail_s,
        force_share=None if force is None else force[columns][:, chosen],
        force_window_s=frf.force_window_s,
    )


def _mode(mode: Identified, columns: np.ndarray) -> Mode:
    residue = np.full((3, 3), np.nan + 1j * np.nan)
    residue_sd = np.full((3, 3), np.nan)
    residue[:, columns] = mode.residue
    residue_sd[:, columns] = mode.residue_sd
    return Mode(
        mode.frequency_hz,
        mode.frequency_sd_hz,
        mode.damping_ratio,
        mode.damping_sd,
        residue,
        residue_sd,
        rank_one(mode.residue)[0],
        mode.probability,
    )


def _remarks(found: PoleIdentification, doubtful: tuple[Mode, ...]) -> tuple[str, ...]:
    remarks = []
    excess = float(np.median(found.fit.excess)) / found.data.correlated
    if found.data.variance is not None and excess >= 4:
        remarks.append(
            f"The fit misses the FRFs by {np.sqrt(excess):.1f} times their scatter between hits:"
            " standard deviations were enlarged accordingly."
        )
    if doubtful:
        left_out = [f"{mode.frequency_hz:.4g}" for mode in doubtful]
        remarks.append(
            f"Left out as artefacts (probability below {LEAST_PROBABILITY:g}): poles at"
            f" {', '.join(left_out)} Hz."
        )
    return tuple(remarks)
