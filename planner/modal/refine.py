"""Maximum-likelihood refinement of poles and residues in the frequency domain.

The residues enter linearly and are eliminated (variable projection, Golub and Pereyra 1973, in
Kaufman's form), so that Gauss–Newton with Levenberg–Marquardt damping runs over the poles only.
The noise of a line is circular complex normal with the stated variance E|δH|²; at the solution
the linearised equations give the covariance of poles and residues (Pintelon and Schoukens,
System Identification, 2012, ch. 9).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.modal.residues import Lines, Residues, basis, basis_slope, unpack

MAX_ITERATIONS = 30
# Few lines around a resonance are fitted nearly quadratically: the damping may vanish at once.
# At first, by how much less after a step that gained and more after one that did not, at most.
DAMPING, LIGHTER, HEAVIER, MOST = 1e-3, 0.1, 10.0, 1e8


@dataclass(frozen=True, eq=False)
class ReducedFit:
    """The problem at one set of poles, residues at their best: χ², its slope and curvature."""

    chi2: float
    coefficients: np.ndarray  # (entries, columns)
    gradient: np.ndarray  # (2m,) of χ²/2
    normal: np.ndarray  # (2m, 2m) JᵀWJ
    inverse: np.ndarray  # (entries, columns, columns) of the linear normal matrix
    sensitivity: np.ndarray  # (entries, columns, 2m): change of coefficients with the poles


@dataclass(frozen=True, eq=False)
class Refined:
    """Poles and residues at the minimum of χ² = Σ 2|H − fit|²/variance, and their covariance."""

    poles: np.ndarray  # (m,) in the plane of the lines
    residues: Residues  # (outputs, inputs, m)
    chi2: float
    degrees: int  # degrees of freedom left
    pole_covariance: np.ndarray  # (2m, 2m) of real parts (all modes), then imaginary parts
    residue_variance: np.ndarray  # (outputs, inputs, 2, m) of real and imaginary parts
    significance: np.ndarray  # (m,) rise of χ² if the mode were left out, poles of others held
    point: ReducedFit


def refine(
    lines: Lines,
    response: np.ndarray,
    variance: np.ndarray,
    poles: np.ndarray,
    allowed: Callable[[np.ndarray], bool],
) -> Refined:
    """Minimise the weighted error over poles and residues, starting from `poles`.

    response and variance (outputs, inputs, F), finite, variance > 0, at `lines`; poles (m,),
    m ≥ 1, in the plane of `lines`; a step to poles that are not `allowed` is shortened.
    """
    outputs, inputs, count = response.shape
    data = response.reshape(-1, count)
    weight = 2 / variance.reshape(-1, count)
    poles = np.asarray(poles, complex)

    def at(parts: np.ndarray) -> ReducedFit:
        return evaluate(lines, data, weight, _complex(parts))

    def objective(parts: np.ndarray) -> ReducedFit | None:
        return at(parts) if allowed(_complex(parts)) else None

    start = np.concatenate([poles.real, poles.imag])
    parts, point = _minimised(objective, start, at(start))
    return _finish(lines, _complex(parts), point, (outputs, inputs), count)


def _minimised(
    objective: Callable[[np.ndarray], ReducedFit | None], parts: np.ndarray, point: ReducedFit
) -> tuple[np.ndarray, ReducedFit]:
    """Where damped Gauss-Newton steps (Levenberg-Marquardt) lead; None where poles cannot be."""
    damping = DAMPING
    for _ in range(MAX_ITERATIONS):
        # In units in which the diagonal is 1: the damping is relative to it.
        diagonal = np.diagonal(point.normal)
        unit = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
        damped = point.normal * np.outer(unit, unit) + damping * np.eye(len(unit))
        step = -unit * np.linalg.lstsq(damped, unit * point.gradient)[0]
        tried = objective(parts + step)
        settled = tried is not None and damping < DAMPING and _still(point, tried, step)
        if tried is not None and tried.chi2 < point.chi2:
            parts, point, damping = parts + step, tried, LIGHTER * damping
        else:
            damping *= HEAVIER
        if settled or damping > MOST:
            break
    return parts, point


def _still(before: ReducedFit, after: ReducedFit, step: np.ndarray) -> bool:
    """Whether a step changed nothing: far below a standard deviation, or by rounding alone.

    A short step tells nothing as long as damping keeps it short.
    """
    sds = np.abs(step) * np.sqrt(np.maximum(np.diag(before.normal), 0.0))
    return bool(np.max(sds) < 1e-3 or abs(before.chi2 - after.chi2) < 1e-9 * before.chi2)


def shared_error(
    lines: Lines, variance: np.ndarray, refined: Refined, errors: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Covariance of poles (2m, 2m) and variance of residues that errors common to lines add.

    errors (n, outputs, inputs, F): what each of n independent sources, at one standard deviation,
    adds to the response. The residues' variance (outputs, inputs, 2, m) is that of real and
    imaginary part.
    """
    m, count = refined.poles.size, variance.shape[-1]
    point, shape = refined.point, variance.shape[:2]
    if not len(errors):
        return np.zeros((2 * m, 2 * m)), np.zeros((*shape, 2, m))
    p = point.coefficients.shape[1]
    poles = refined.poles
    columns = np.concatenate([basis(lines, poles), basis_slope(lines, poles)])
    both = np.concatenate([columns.real, columns.imag], axis=1)
    weighted = (errors * 2 / variance).reshape(len(errors), -1, count)
    cross = np.concatenate([weighted.real, weighted.imag], axis=-1) @ both.T
    turn = slope_turn(point.coefficients, m)
    gradient = np.einsum("eka,nek->na", turn, cross[..., p:])
    gradient += np.einsum("eka,nek->na", point.sensitivity, cross[..., :p])
    change = gradient @ refined.pole_covariance
    moved = np.einsum("ekl,nel->nek", point.inverse, cross[..., :p])
    moved += np.einsum("eka,na->nek", point.sensitivity, change)
    residue = np.sum(moved[..., : 2 * m] ** 2, axis=0)
    return change.T @ change, residue.reshape(*shape, 2, m)


def _complex(parts: np.ndarray) -> np.ndarray:
    real, imag = np.split(parts, 2)
    return real + 1j * imag


def evaluate(lines: Lines, data: np.ndarray, weight: np.ndarray, poles: np.ndarray) -> ReducedFit:
    """Residues at their best for poles (m,) of responses (entries, F), and how χ² goes on.

    weight like data: 2/variance.
    """
    m = poles.size
    linear, slope = basis(lines, poles), basis_slope(lines, poles)
    p = linear.shape[0]
    columns = np.concatenate([linear, slope])
    norm = np.sqrt(np.mean(np.abs(columns) ** 2, axis=1))
    columns /= norm[:, None]
    gram, cross, square = products(columns, data, weight)
    size = np.sqrt(np.einsum("ekk->ek", gram))[:, :p]
    scaled = gram[:, :p, :p] / size[:, :, None] / size[:, None, :]
    if proportional(weight):  # entries share one matrix
        inverse = np.linalg.pinv(scaled[:1], rcond=1e-13, hermitian=True)
        inverse = np.repeat(inverse, len(scaled), axis=0)
    else:
        inverse = np.linalg.pinv(scaled, rcond=1e-13, hermitian=True)
    inverse /= size[:, :, None] * size[:, None, :]
    coefficients = np.einsum("ekl,el->ek", inverse, cross[:, :p])
    chi2 = float(np.sum(square) - np.einsum("ek,ek->", coefficients, cross[:, :p]))
    # Jacobian columns as combinations of the slope basis: J = slope · turn.
    turn = slope_turn(coefficients / norm[:p], m) * norm[p:, None]
    mixed = gram[:, :p, p:] @ turn
    sensitivity = -inverse @ mixed
    gradient = np.einsum("eka,ek->a", mixed, coefficients)
    gradient -= np.einsum("eka,ek->a", turn, cross[:, p:])
    jtj = turn.transpose(0, 2, 1) @ gram[:, p:, p:] @ turn
    normal = np.sum(jtj + mixed.transpose(0, 2, 1) @ sensitivity, axis=0)
    return ReducedFit(
        max(chi2, 0.0),
        coefficients / norm[:p],
        gradient,
        normal,
        inverse / norm[:p, None] / norm[:p],
        sensitivity / norm[:p, None],
    )


def products(
    columns: np.ndarray, data: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gram matrix of the columns, their products with the data, ‖data‖², per entry."""
    square = np.sum(weight * np.abs(data) ** 2, axis=1)
    both = np.concatenate([columns.real, columns.imag], axis=1)
    wide = np.concatenate([weight, weight], axis=1)
    values = np.concatenate([data.real, data.imag], axis=1)
    cross = (wide * values) @ both.T
    if proportional(weight):
        profile = wide[0] / wide[0, 0]
        gram = weight[:, 0, None, None] * ((both * profile) @ both.T)
    else:
        gram = np.stack([(both * row) @ both.T for row in wide])
    return gram, cross, square


def proportional(weight: np.ndarray) -> bool:
    """Whether the weights (entries, F) are a level for each entry times one profile of lines."""
    product = weight[:, :1] * (weight[:1] / weight[0, 0])
    return bool(np.all(np.abs(weight - product) <= 1e-12 * product))


def slope_turn(coefficients: np.ndarray, m: int) -> np.ndarray:
    """(…, 2m, 2m) of (…, columns): how the slope basis combines into ∂H/∂Re λ and ∂H/∂Im λ."""
    real, imag = coefficients[..., :m], coefficients[..., m : 2 * m]
    turn = np.zeros((*real.shape[:-1], 2 * m, 2 * m))
    index = np.arange(m)
    turn[..., index, index] = turn[..., m + index, m + index] = real
    turn[..., m + index, index], turn[..., index, m + index] = imag, -imag
    return turn


def _finish(
    lines: Lines,
    poles: np.ndarray,
    point: ReducedFit,
    shape: tuple[int, int],
    count: int,
) -> Refined:
    m = poles.size
    entries, p = point.coefficients.shape
    covariance = np.linalg.pinv(point.normal, hermitian=True)
    spread = np.einsum("eka,ab,ekb->ek", point.sensitivity, covariance, point.sensitivity)
    # Of rounding, where lines without noise leave curvatures almost singular, variances below 0
    variance = np.maximum(np.einsum("ekk->ek", point.inverse) + spread, 0.0)
    residues = unpack(point.coefficients.reshape(*shape, p), m)
    return Refined(
        poles,
        residues,
        point.chi2,
        2 * count * entries - entries * p - 2 * m,
        covariance,
        variance[:, : 2 * m].reshape(*shape, 2, m),
        significance(point, m),
        point,
    )


def significance(point: ReducedFit, m: int) -> np.ndarray:
    """Wald statistic of each mode's residues: 2 · entries degrees of freedom without a mode."""
    index = np.stack([np.arange(m), m + np.arange(m)], axis=1)
    value = point.coefficients[:, index]
    block = point.inverse[:, index[:, :, None], index[:, None, :]]
    return np.einsum("emk,emkl,eml->m", value, np.linalg.pinv(block, hermitian=True), value)
