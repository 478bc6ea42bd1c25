"""The one chain from responses to modes: poles of all orders, stable lines, fit, probability."""

from dataclasses import dataclass

import numpy as np

from planner.modal.fit_data import Data
from planner.modal.mode_selection import PoleFit, fit, model, scales, strongest, weakness
from planner.modal.model_check import inflation
from planner.modal.plscf import PoleSet, plscf
from planner.modal.refine import Refined, shared_error
from planner.modal.residues import unit
from planner.modal.stabilisation import Diagram, diagram, stable

MAX_ORDER = 40


@dataclass(frozen=True, eq=False)
class Identified:
    """One mode in rad/s and the units of the data."""

    pole: complex
    frequency_hz: float
    frequency_sd_hz: float
    damping_ratio: float
    damping_sd: float
    residue: np.ndarray  # (outputs, inputs)
    residue_sd: np.ndarray  # (outputs, inputs) of real and imaginary part each
    presence: float  # share of the response at its frequency that is this mode's, roughly
    support: float  # share of the higher model orders that have this pole
    probability: float


@dataclass(frozen=True, eq=False)
class PoleIdentification:
    """Modes in increasing frequency, and what they came from."""

    modes: tuple[Identified, ...]
    data: Data
    diagram: Diagram
    fit: PoleFit
    fit_error: float  # ‖H − fit‖/‖H‖
    order: int


def identify(data: Data, max_order: int = MAX_ORDER) -> PoleIdentification | None:
    """All modes that the lines of `data` carry, None where there is none."""
    # At least as many lines as half the unknowns of one column need, and once that to spare.
    top = max(2, min(max_order, data.frequency_hz.size // 3))
    orders = ladder(top)
    weight = None if data.variance is None else 1 / np.mean(data.variance, axis=1)
    sets = plscf(data.frequency_hz, data.response, orders, weight)
    reach = (data.frequency_hz[0] * 0.95, data.frequency_hz[-1] * 1.05)
    found = diagram(sets, reach)
    start = np.array([line.pole for line in stable(found)]) + data.rate_1_s
    if start.size == 0:
        start = strongest(data)
    if start.size == 0:
        return None
    fitted = fit(data, start)
    modes = modes_of_fit(data, fitted, sets)
    error = np.linalg.norm(data.response - model(data, fitted.refined))
    relative = float(error / np.linalg.norm(data.response))
    return PoleIdentification(modes, data, found, fitted, relative, top) if modes else None


def ladder(top: int) -> tuple[int, ...]:
    """Model orders of the diagram: all at first, then every second, then every fourth.

    High orders cost most (their cube) and differ least from their neighbours.
    """
    steps = ((2, 20, 1), (20, 40, 2), (40, top, 4))
    orders = {n for low, high, step in steps for n in range(low, min(high, top) + 1, step)}
    return tuple(sorted(orders | {top}))


def modes_of_fit(data: Data, fitted: PoleFit, sets: tuple[PoleSet, ...]) -> tuple[Identified, ...]:
    """The poles of a fit that are established, with standard deviations and probabilities."""
    refined = fitted.refined
    m = refined.poles.size
    scale = scales(data, fitted)
    weak = weakness(data, fitted)
    errors = data.force_errors(model(data, refined))
    shared_pole, shared_residue = shared_error(data.lines, fitted.variance, refined, errors)
    if data.step_s is None:
        scale = scale * inflation(data, fitted, shared_pole)
    modes = []
    for k in range(m):
        if weak[k] > 1:
            continue
        index = [k, m + k]
        covariance = scale[k] * refined.pole_covariance[np.ix_(index, index)]
        covariance = covariance + shared_pole[np.ix_(index, index)]
        pole = complex(refined.poles[k])
        frequency, damping, sd = natural(pole, covariance)
        residue = refined.residues.residue[..., k]
        variance = scale[k] * np.mean(refined.residue_variance[..., k], axis=-1)
        variance = variance + np.mean(shared_residue[..., k], axis=-1)
        presence = _presence(data, refined, k)
        supported = support(pole - data.rate_1_s, sets)
        modes.append(
            Identified(
                pole,
                frequency,
                float(sd[0]),
                damping,
                float(sd[1]),
                residue,
                np.sqrt(np.maximum(variance, 0.0)),  # less by rounding alone
                presence,
                supported,
                probability(presence, supported, float(weak[k])),
            )
        )
    return tuple(sorted(modes, key=lambda mode: mode.frequency_hz))


def natural(pole: complex, covariance: np.ndarray) -> tuple[float, float, np.ndarray]:
    """Natural frequency (Hz), damping ratio and their standard deviations (linearised)."""
    slope = natural_slope(pole)
    sd = np.sqrt(np.maximum(0.0, np.diag(slope @ covariance @ slope.T)))
    return abs(pole) / (2 * np.pi), -pole.real / abs(pole), sd


def natural_slope(pole: complex) -> np.ndarray:
    """(2, 2) change of natural frequency (Hz) and damping ratio with Re λ and Im λ (rad/s)."""
    size = abs(pole)
    by_frequency = [pole.real / size / (2 * np.pi), pole.imag / size / (2 * np.pi)]
    return np.array([by_frequency, [-(pole.imag**2) / size**3, pole.real * pole.imag / size**3]])


def support(pole: complex, sets: tuple[PoleSet, ...]) -> float:
    """Share of the upper half of the orders with a pole within half a bandwidth or 0.5 %."""
    upper = sets[len(sets) // 2 :]
    reach = max(abs(pole.real), 0.005 * abs(pole))
    near = [np.any(np.abs(entry.poles.imag - pole.imag) < reach) for entry in upper]
    return float(np.mean(near))


def _presence(data: Data, refined: Refined, k: int) -> float:
    """‖response of mode k‖/‖response‖ at the line nearest its frequency."""
    frequency = refined.poles[k].imag / (2 * np.pi)
    line = int(np.argmin(np.abs(data.frequency_hz - frequency)))
    lines = data.lines.part(slice(line, line + 1))
    one = unit(lines, data.to_plane(refined.poles[k : k + 1]))[0, 0]
    whole = np.linalg.norm(data.response[..., line])
    return float(np.linalg.norm(refined.residues.residue[..., k] * one) / max(whole, 1e-300))


def probability(presence: float, support: float, weak: float) -> float:
    """Logistic in what separates modes from artefacts.

    That is: the share of the response that is the mode's, its support in the diagram, and how
    far it is from the limits of `weakness`. Coefficients from 200 simulated poses (2-s records,
    hits that disagree by 0.3 %, a 3 % ripple, short records, weak modes; 1,100 poles).
    """
    size = np.log(np.clip(presence, 1e-3, 1.0))
    score = -0.3 + 1.2 * support - 3.1 * np.log(max(weak, 1e-6)) + 2.1 * size
    return float(1 / (1 + np.exp(-score)))
