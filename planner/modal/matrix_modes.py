"""Modes of any matrix of FRFs: poles common to all, one shape per mode over all points."""

from dataclasses import dataclass

import numpy as np

from planner.errors import RefusedError
from planner.frf.matrix import FrfMatrix, by_number
from planner.modal.matrix_poles import identify_matrix
from planner.modal.modes import LEAST_PROBABILITY
from planner.modal.pole_identification import Identified, PoleIdentification
from planner.modal.rank_one_fit import Entries, fit_shape
from planner.modal.residues import realign
from planner.modal.shape_measures import phase_collinearity, phase_deviation_deg
from planner.recording.dof import Dof

# A band that the user does not state begins at this line: the first ones hold offsets and drift.
FIRST_LINE = 3


@dataclass(frozen=True, eq=False)
class MatrixMode:
    """A mode over all points.

    `shape` (n,) has unit modal mass (kg^-1/2) where `scaled`, else unit length; `shape_sd` (n,) is
    the standard deviation of real and imaginary part each. `collinearity` is the MPC, `deviation`
    the MPD in degrees, `modal_mass_kg` that of the shape with largest component 1 (NaN unscaled).
    `misfit` is χ² per degree of freedom that one shape leaves in the residues.
    """

    frequency_hz: float
    frequency_sd_hz: float
    damping_ratio: float
    damping_sd: float
    shape: np.ndarray
    shape_sd: np.ndarray
    scaled: bool
    probability: float
    collinearity: float
    deviation_deg: float
    modal_mass_kg: float
    misfit: float

    @property
    def pole(self) -> complex:
        """Pole λ in rad/s."""
        w = 2 * np.pi * self.frequency_hz
        return complex(-self.damping_ratio * w, w * np.sqrt(max(0.0, 1 - self.damping_ratio**2)))


@dataclass(frozen=True, eq=False)
class MatrixModes:
    """Modes in increasing frequency; `dofs` name the entries of every shape."""

    dofs: tuple[Dof, ...]
    modes: tuple[MatrixMode, ...]
    band_hz: tuple[float, float]
    fit_error: float  # ‖H − fit‖/‖H‖
    order: int
    remarks: tuple[str, ...]
    found: PoleIdentification


def modes_of_matrix(matrix: FrfMatrix, band_hz: tuple[float, float] | None = None) -> MatrixModes:
    """All modes that a matrix of FRFs holds in a band (Hz; default: all lines but the first few).

    Raises RefusedError where no mode can be found.
    """
    frequency = matrix.frequency_hz
    band = band_hz or (float(frequency[min(FIRST_LINE, frequency.size) - 1]), float(frequency[-1]))
    found, rows, columns = identify_matrix(matrix, band)
    inside = [
        m
        for m in (found.modes if found else ())
        if band[0] <= m.frequency_hz <= band[1] and m.probability >= LEAST_PROBABILITY
    ]
    if found is None or not inside:
        raise RefusedError(
            f"No mode could be found between {band[0]:g} and {band[1]:g} Hz in {matrix.count} FRFs:"
            " check that the band holds a resonance."
        )
    dofs, entries = _points(matrix, rows, columns)
    modes = tuple(_mode(mode, entries, matrix.scaled) for mode in inside)
    return MatrixModes(dofs, modes, band, found.fit_error, found.order, matrix.remarks, found)


def _points(
    matrix: FrfMatrix, rows: np.ndarray, columns: np.ndarray
) -> tuple[tuple[Dof, ...], Entries]:
    """All points hit or felt, and the entries by their indices."""
    dofs = tuple(sorted({*matrix.responses, *matrix.references}, key=by_number))
    place = {dof: k for k, dof in enumerate(dofs)}
    felt = np.array([place[matrix.responses[o]] for o in rows])
    hit = np.array([place[matrix.references[i]] for i in columns])
    return dofs, Entries(felt, hit, len(dofs))


def _mode(mode: Identified, entries: Entries, scaled: bool) -> MatrixMode:
    damped = float(mode.pole.imag)
    fitted = fit_shape(entries, mode.residue[:, 0], mode.residue_sd[:, 0] ** 2, damped)
    _, odd = entries.groups
    scaled = scaled and bool(np.all(odd))
    shape, sd = fitted.shape, fitted.sd
    if scaled:
        largest = shape[np.argmax(np.abs(shape))]
        shape = shape * (np.sign(largest.real) or 1.0)
    else:
        size = np.linalg.norm(shape)
        shape, sd = shape * realign(shape) / size, sd / size
    mass = 1 / float(np.max(np.abs(shape)) ** 2) if scaled else float("nan")
    return MatrixMode(
        mode.frequency_hz, mode.frequency_sd_hz, mode.damping_ratio, mode.damping_sd,
        shape, sd, scaled, mode.probability,
        phase_collinearity(shape), phase_deviation_deg(shape), mass, fitted.misfit,
    )  # fmt: skip
