"""How far off FRFs of the fused modes are, where no simulation explains the recordings."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from planner.dynamics.at_force import modes_at_force
from planner.dynamics.simulation import Simulation
from planner.measurement.measured_frfs import common_band, stack
from planner.surrogate.frf_bands import ModalPrediction, frf_moments
from planner.surrogate.leave_one_out import left_out_modes

if TYPE_CHECKING:
    from planner.campaign.model import Model

ZONES = 5  # of the band, evenly on a logarithmic scale: they differ in what is left out
LINES, LEAST, MOST = 300, 20, 80  # of all poses together, and of one at least and at most
MODEL_ERROR = 0.01  # relative sd of what no modes follow
WIDTH = 0.05  # of the frequency: over which an FRF's size is averaged
OWN = 0.5  # share of an FRF's own square in its size; the rest is the mean of all nine
# What is expected of an error's size before any pose is left out: its median, and sds of its
# logarithm, of a whole campaign and of a zone within it. Of generated campaigns in which physics
# lacked zones were 0.01 to 0.3 off, where nothing lacked 0.003 to 0.03.
ERROR_BEFORE, CAMPAIGN_SPREAD, ZONE_SPREAD = 0.03, 0.7, 0.7
# As how many independent values the squares of a pose in a zone vary about what is expected, for an
# error is alike over many lines: of generated campaigns in which physics lacked, 1 to 13.
VALUES = 4
SIZES = np.geomspace(1e-3, 3.0, 60)  # of errors that are considered
SHIFTS = np.linspace(-3, 3, 25)  # of a campaign from others, in sds
UNCHANGED = (
    "peak_force_n changes nothing: robot.toml states no [[law]] of a joint that is not linear "
    "(planner diagnose finds them from hits of different force)."
)


@dataclass(frozen=True, eq=False)
class ErrorByZone:
    """Relative error (ZONES,) of predicted FRFs by frequency zone, beyond what their sds say.

    Relative to the FRF's size near each line; learned from poses that were left out.
    """

    edges_hz: np.ndarray
    relative: np.ndarray

    @classmethod
    def of(cls, model: "Model") -> "ErrorByZone":
        """From all poses, each left out, weighed together; of one: what is expected before."""
        low, high = model.cell.config.modes.band_hz
        edges = np.geomspace(max(low, 0.1), high, ZONES + 1)
        log_likelihood = np.zeros((ZONES, len(SIZES)))
        if len(model.frfs) > 1:
            log_likelihood += sum(_log_likelihoods(model, edges))
        return cls(edges, np.sqrt(_posterior(log_likelihood) @ SIZES**2))

    def at(self, frequency_hz: np.ndarray) -> np.ndarray:
        """(F,) from middle to middle of the zones."""
        middle = np.sqrt(self.edges_hz[:-1] * self.edges_hz[1:])
        return np.interp(np.log(frequency_hz), np.log(middle), self.relative)


def _log_likelihood(left: np.ndarray, square: np.ndarray, known: np.ndarray) -> np.ndarray:
    """(SIZES,) of a zone's lines (n,): |left|² is e² size² + known on the mean.

    `square` is the FRFs' size² there, `known` the variance of noise and prediction as it is; quiet
    lines count most.
    """
    weight = square / (known + ERROR_BEFORE**2 * square) ** 2
    weight /= weight @ square
    expected = SIZES**2 + weight @ known
    return -VALUES / 2 * (np.log(expected) + weight @ np.abs(left) ** 2 / expected)


def _posterior(log_likelihood: np.ndarray) -> np.ndarray:
    """(ZONES, SIZES) probability: log-normal before, about a median that a campaign's zones share.

    So a zone that noise hides is expected to be as the others.
    """
    likelihood = np.exp(log_likelihood - log_likelihood.max(axis=1, keepdims=True))
    away = np.log(SIZES / ERROR_BEFORE) - CAMPAIGN_SPREAD * SHIFTS[:, None]
    before = np.exp(-((away / ZONE_SPREAD) ** 2) / 2)
    before /= before.sum(axis=1, keepdims=True)
    joint = before[:, None] * likelihood  # (SHIFTS, ZONES, SIZES)
    evidence = joint.sum(axis=2)
    shift = np.exp(-(SHIFTS**2) / 2) * np.prod(evidence, axis=1)
    return np.einsum("u,uzs->zs", shift / shift.sum(), joint / evidence[..., None])


def local_size(h: np.ndarray, frequency_hz: np.ndarray) -> np.ndarray:
    """Size (…, 3, 3, F) of FRFs about each line; one that vanishes has a share of the others'."""
    log_f = np.log(frequency_hz)
    near = np.exp(-(((log_f[:, None] - log_f) / WIDTH) ** 2) / 2)
    square = np.abs(h) ** 2 @ (near / near.sum(axis=0))
    return np.sqrt(OWN * square + (1 - OWN) * square.mean(axis=(-3, -2), keepdims=True))


def _log_likelihoods(model: "Model", edges_hz: np.ndarray) -> Iterator[np.ndarray]:
    """(ZONES, SIZES) by each pose's FRFs, from fused modes of the others."""
    frfs, band = model.frfs, model.cell.config.modes.band_hz
    lines = int(np.clip(LINES // len(frfs), LEAST, MOST))
    with threadpool_limits(1):
        measured = stack(frfs, common_band(frfs, band), lines, MODEL_ERROR)
        fused = left_out_modes(model.with_residues, model.seen_exactly)
    for i, (hertz, s) in enumerate(zip(measured.frequency_hz, measured.s, strict=True)):
        one = fused[i : i + 1]
        mean, sd = frf_moments(_windowed(one, float(s.real[0])), hertz)
        predicted = mean[0] * (s / (1j * s.imag)) ** 2
        used = measured.used[i]
        left, known = measured.accelerance[i] - predicted, measured.sd[i] ** 2 + sd[0] ** 2
        square = local_size(predicted, hertz) ** 2
        zone = np.clip(np.searchsorted(edges_hz, hertz) - 1, 0, ZONES - 1)
        found = np.zeros((ZONES, len(SIZES)))
        for k in range(ZONES):
            here = used & (zone == k) & (square > 0)
            if here.any():
                found[k] = _log_likelihood(left[here], square[here], known[here])
        yield found


def _windowed(modes: ModalPrediction, rate_1_s: float) -> ModalPrediction:
    """Modes as an exponential window shows them: poles shifted left by its rate."""
    if rate_1_s == 0:
        return modes
    omega, zeta = 2 * np.pi * modes.frequency_hz, modes.damping_ratio
    real, imaginary = zeta * omega + rate_1_s, omega * np.sqrt(np.maximum(0.0, 1 - zeta**2))
    size = np.hypot(real, imaginary)
    return replace(modes, frequency_hz=size / (2 * np.pi), damping_ratio=real / size)


def struck_modes(
    struck: Simulation, predicted: ModalPrediction, q: np.ndarray, force_n: np.ndarray
) -> ModalPrediction:
    """Frequencies and damping moved as those of a simulation with laws; as they were where NaN."""
    known = np.flatnonzero(np.isfinite(force_n))
    if not known.size:
        return predicted
    count = predicted.frequency_hz.shape[1]
    there = modes_at_force(struck, q[known], force_n[known], count)
    stated = struck.frequencies(q[known], count)
    moved = {}
    for name in ("frequency_hz", "damping_ratio"):
        ratio = getattr(there, name) / getattr(stated, name)
        moved[name] = getattr(predicted, name).copy()
        moved[name][known] *= np.where(np.isfinite(ratio), ratio, 1.0)
    return replace(predicted, **moved)
