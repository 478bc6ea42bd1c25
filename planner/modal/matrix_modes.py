"""Modes of any matrix of FRFs: poles common to all, one shape per mode over all points."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from planner.errors import RefusedError
from planner.frf.matrix import FrfMatrix, by_number
from planner.modal.consistency import Consistency, check
from planner.modal.estimate_modes import PoleIdentification
from planner.modal.mac import phase_collinearity, phase_deviation_deg, real_normal_modes
from planner.modal.matrix_poles import identify_matrix
from planner.modal.modes import UNSCALED, Eigenvectors, Mode
from planner.modal.motion_fields import expected
from planner.modal.rank_one_fit import FREE_GAIN, Entries, FittedShape, fit_shape, row_gain
from planner.modal.residues import realign
from planner.recording.points import Dof
from planner.recording.screening import FIRST_LINE
from planner.recording.uff import Geometry


@dataclass(frozen=True, eq=False)
class MatrixModes:
    """Modes in increasing frequency; `dofs` name the entries of every shape."""

    dofs: tuple[Dof, ...]
    modes: tuple[Mode, ...]
    band_hz: tuple[float, float]
    remarks: tuple[str, ...]
    found: PoleIdentification
    checks: Consistency


def modes_of_matrix(
    matrix: FrfMatrix,
    band_hz: tuple[float, float] | None = None,
    geometry: Geometry | None = None,
) -> MatrixModes:
    """All modes that a matrix of FRFs holds in a band (Hz; default: all lines but the first few).

    Where the points lie (`geometry`) shows which of them have a turned sign or another's name.
    Raises RefusedError where no mode can be found.
    """
    frequency = matrix.frequency_hz
    band = band_hz or (float(frequency[min(FIRST_LINE, frequency.size) - 1]), float(frequency[-1]))
    found = identify_matrix(matrix, band)
    hz = np.abs(found.fit.poles) / (2 * np.pi) if found else np.zeros(0)
    inside = [
        k for k in np.argsort(hz) if found and found.weak[k] <= 1 and band[0] <= hz[k] <= band[1]
    ]
    if found is None or not inside:
        raise RefusedError(
            f"No mode could be found between {band[0]:g} and {band[1]:g} Hz in {matrix.count} FRFs:"
            " check that the band holds a resonance."
        )
    checks = check(matrix, found, np.array(inside), geometry)
    found = _put_right(matrix, found, checks)
    dofs, entries = _points(matrix, found, checks)
    shapes = _informed(_shapes(found, inside, entries), dofs, geometry)
    each = zip(inside, shapes, strict=True)
    modes = [_mode(found, int(k), shape, entries, matrix.scaled) for k, shape in each]
    modes = _with_vectors(modes, dofs, matrix, found, inside)
    remarks = (*matrix.remarks, *checks.faults, *checks.remarks)
    return MatrixModes(dofs, tuple(modes), band, remarks, found, checks)


def _put_right(
    matrix: FrfMatrix, found: PoleIdentification, checks: Consistency
) -> PoleIdentification:
    """With residues of turned points as they should be; odd ones count for nothing."""
    roved, stayed = matrix.roved.responses, matrix.roved.references
    named = [(roved[r], stayed[c]) for r, c in zip(found.data.row, found.data.column, strict=True)]
    turned = [(r in checks.turned_rows) != (s in checks.turned) for r, s in named]
    sign = np.where(turned, -1.0, 1.0)[:, None]
    # A residue that does not fit the others counts with so many times its variance.
    doubt = np.where([pair in checks.odd for pair in named], 1e8, 1.0)[:, None]
    own, variance = found.fit.coefficients * sign, found.fit.residue_variance * doubt
    return replace(found, fit=replace(found.fit, coefficients=own, residue_variance=variance))


def _points(
    matrix: FrfMatrix, found: PoleIdentification, checks: Consistency
) -> tuple[tuple[Dof, ...], Entries]:
    """All points hit or felt, and the entries by their indices.

    References whose column does not go with their row are points of their own, behind the others.
    A point that was only hit is among them where a driving point ties its size to the rest.
    """
    responses, references = found.data.places
    tied = [d for d in matrix.references if d not in checks.untied] if checks.driving else []
    seen = {matrix.responses[o] for o in responses}
    dofs = tuple(sorted({*seen, *tied}, key=by_number))
    apart = [d for d in matrix.references if d not in tied]
    place = {dof: k for k, dof in enumerate(dofs)}
    hit_at = place | {dof: len(dofs) + k for k, dof in enumerate(apart)}
    felt = np.array([place[matrix.responses[o]] for o in responses])
    hit = np.array([hit_at[matrix.references[i]] for i in references])
    roved = (hit, felt) if found.data.hit else (felt, hit)
    return dofs, Entries(*roved, len(dofs) + len(apart))


def _shapes(found: PoleIdentification, modes: list[int], entries: Entries) -> list[FittedShape]:
    """Shapes of modes (indices); rows err as a whole by what those of the references show.

    Points that are rows and columns tell it, at first fitted with their gains left free.
    """
    if np.intersect1d(entries.rows, entries.columns).size < 2:
        return [_shape(found, k, entries) for k in modes]
    free = [_shape(found, k, entries, FREE_GAIN) for k in modes]
    gain = row_gain(free)
    return [_shape(found, k, entries, gain, one.shape) for k, one in zip(modes, free, strict=True)]


def _shape(found: PoleIdentification, k: int, entries: Entries, *options: Any) -> FittedShape:
    """Of a mode (index); `entries` have the fit's order, the options are as in `fit_shape`."""
    fit = found.fit
    variance = found.scale[k] * fit.residue_variance[:, k]
    return fit_shape(entries, fit.residue[:, k], variance, fit.poles[k].imag, *options)


def _with_vectors(
    modes: list[Mode], dofs: tuple[Dof, ...], matrix: FrfMatrix, found: PoleIdentification,
    inside: list[int],
) -> list[Mode]:  # fmt: skip
    """With right and left vectors of modes `inside` (indices), without reciprocity.

    On the scale on which both are most alike at points that were felt and hit, with the shape's
    sign. None where rows and columns fall apart into groups that share no entry: nothing ties their
    scales.
    """
    felt, hit = len(matrix.responses), len(matrix.references)
    responses, references = found.data.places
    entries = Entries(responses, felt + references, felt + hit)
    group, _ = entries.groups
    if len(np.unique(group[entries.rows])) > 1:
        return modes
    o, i = np.array(matrix.both, int).reshape(-1, 2).T

    def apart(k: int, mode: Mode) -> Eigenvectors:
        fitted = _shape(found, k, entries)
        right, left = fitted.shape[:felt], fitted.shape[felt:]
        alike = np.sum(left[i] * right[o].conj()) / max(np.sum(np.abs(right[o]) ** 2), 1e-300)
        factor = np.sqrt(alike) if abs(alike) > 0 else realign(right)
        size, shape = abs(factor), dict(zip(dofs, mode.shape, strict=True))
        same = [shape.get(dof, 0.0) for dof in matrix.responses]
        factor = factor * (np.sign(np.vdot(same, factor * right).real) or 1.0)
        return Eigenvectors(
            factor * right, size * fitted.sd[:felt], left / factor, fitted.sd[felt:] / size
        )

    return [replace(m, vectors=apart(k, m)) for k, m in zip(inside, modes, strict=True)]


def _mode(
    found: PoleIdentification, k: int, fitted: FittedShape, entries: Entries, scaled: bool
) -> Mode:
    group, odd = entries.groups
    shape, shape_sd = fitted.shape, fitted.sd
    scaled = scaled and bool(np.all(odd[group[: shape.size]]))
    if scaled:
        shape = shape * (np.sign(shape[np.argmax(np.abs(shape))].real) or 1.0)
    else:
        size = max(float(np.linalg.norm(shape)), 1e-300)
        shape, shape_sd = shape * realign(shape) / size, shape_sd / size
    poles = found.fit.poles
    return Mode(
        *found.natural(found.scale)[k], *UNSCALED, shape,
        found.probability(k, poles[k]), shape_sd, scaled,
        phase_collinearity(shape), phase_deviation_deg(shape),
        float(np.sqrt(found.fit.spread[poles.size + k]) / (2 * np.pi)),
    )  # fmt: skip


def _informed(
    shapes: list[FittedShape], dofs: tuple[Dof, ...], geometry: Geometry | None
) -> list[FittedShape]:
    """Shapes over `dofs`, points that are hardly determined drawn to where others expect them.

    Where poles of a set nearly coincide, or only a reference near a mode's node felt a point, its
    residues alone would be anything.
    """
    n = len(dofs)
    values = np.stack([fitted.shape[:n] for fitted in shapes], axis=1)
    sd = np.stack([fitted.sd[:n] for fitted in shapes], axis=1)
    mean, variance = expected(dofs, values, sd, geometry)
    share = variance / np.maximum(variance + 2 * sd**2, 1e-300)
    values, sd = mean + share * (values - mean), sd * np.sqrt(share)
    return [
        replace(fitted, shape=value, sd=own)
        for fitted, value, own in zip(shapes, values.T, sd.T, strict=True)
    ]


def with_normal_modes(found: MatrixModes) -> MatrixModes:
    """With the real normal modes behind the complex shapes; frequencies and damping stay."""
    poles = np.array([mode.pole for mode in found.modes])
    shapes = np.stack([mode.shape for mode in found.modes], axis=1)
    real = real_normal_modes(poles, shapes)
    each = zip(found.modes, real.T, strict=True)
    modes = tuple(replace(mode, shape=shape.astype(complex)) for mode, shape in each)
    remark = "Shapes are real normal modes; MPC and MPD are those of the complex ones."
    return replace(found, modes=modes, remarks=(*found.remarks, remark))
