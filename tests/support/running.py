"""Responses of simulated structures to noise that acts everywhere, as in operation."""

import numpy as np
import scipy.signal

from tests.support.structures import Structure


def response(
    structure: Structure, points: list[int], seconds: float, rate_hz: float,
    rng: np.random.Generator,
) -> np.ndarray:  # fmt: skip
    """Accelerations (points, n) of modes below 0.45 of the rate, 2 % sensor noise on top."""
    poles, shapes = structure.poles()
    n = int(seconds * rate_hz)
    force = rng.normal(size=(len(structure.nodes), n))
    values = np.zeros((len(points), n))
    for pole, shape in zip(poles, shapes.T, strict=True):
        if np.abs(pole) / (2 * np.pi) > 0.45 * rate_hz:
            continue
        state = scipy.signal.lfilter([1], [1, -np.exp(pole / rate_hz)], shape @ force / rate_hz)
        values += 2 * np.real((shape[points] * pole**2)[:, None] * state)
    noise = 0.02 * np.std(values, axis=1, keepdims=True)
    return values + noise * rng.normal(size=values.shape)
