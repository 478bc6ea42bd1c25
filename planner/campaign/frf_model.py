"""FRFs anywhere: the simulation's own where it explains the recordings, else the fused modes'.

The simulation brings all of its modes, over the whole band. FRFs made of fused modes are as far off
as those of measured poses, each predicted from the others, say.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.fit.posterior import RobotPosterior
from planner.measurement.measured_frfs import Measured
from planner.surrogate.frf_bands import ModalPrediction, frf_moments

Moments = tuple[np.ndarray, np.ndarray]  # mean and sd (n, 3, 3, F) of FRFs in m/s²/N
ZONES = (
    5  # of the band, evenly on a logarithmic scale: what is left out differs from one to another
)
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


@dataclass(frozen=True, eq=False)
class LeftOut:
    """FRFs (3, 3, F) of a measured pose, and predicted from the others; `used` where measured.

    `explained`: of their difference, what the hits' own misses explain; `known`: variance of noise
    and of the prediction as it is.
    """

    frequency_hz: np.ndarray
    measured: np.ndarray
    predicted: np.ndarray
    explained: np.ndarray
    known: np.ndarray
    used: np.ndarray

    @property
    def off(self) -> np.ndarray:
        """(3, 3, F) measured less predicted, 0 where nothing was measured."""
        return np.where(self.used, self.measured - self.predicted, 0.0)


@dataclass(frozen=True, eq=False)
class ErrorByZone:
    """Relative error (ZONES,) of predicted FRFs by frequency zone, beyond `LeftOut.known`.

    Relative to the FRF's size near each line; learned from poses that were left out.
    """

    edges_hz: np.ndarray
    relative: np.ndarray

    @classmethod
    def of(cls, found: Sequence[LeftOut], band_hz: tuple[float, float]) -> "ErrorByZone":
        """From all poses that were left out, weighed together; of none: what is expected before."""
        edges = np.geomspace(max(band_hz[0], 0.1), band_hz[1], ZONES + 1)
        log_likelihood = np.zeros((ZONES, len(SIZES)))
        for pose in found:
            log_likelihood += _log_likelihood(pose, edges)
        return cls(edges, np.sqrt(_posterior(log_likelihood) @ SIZES**2))

    def at(self, frequency_hz: np.ndarray) -> np.ndarray:
        """(F,) from middle to middle of the zones."""
        middle = np.sqrt(self.edges_hz[:-1] * self.edges_hz[1:])
        return np.interp(np.log(frequency_hz), np.log(middle), self.relative)


def _log_likelihood(pose: LeftOut, edges_hz: np.ndarray) -> np.ndarray:
    """(ZONES, SIZES): |left|² is e² size² + known on the mean; quiet lines count most."""
    zone = np.clip(np.searchsorted(edges_hz, pose.frequency_hz) - 1, 0, ZONES - 1)
    square = local_size(pose.predicted, pose.frequency_hz) ** 2
    found = np.zeros((ZONES, len(SIZES)))
    for k in range(ZONES):
        here = pose.used & (zone == k) & (square > 0)
        if not here.any():
            continue
        size, known = square[here], pose.known[here]
        left = np.abs(pose.off[here] - pose.explained[here]) ** 2
        weight = size / (known + ERROR_BEFORE**2 * size) ** 2
        weight /= weight @ size
        expected = SIZES**2 + weight @ known
        found[k] = -VALUES / 2 * (np.log(expected) + weight @ left / expected)
    return found


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


@dataclass(frozen=True, eq=False)
class FrfModel:
    """The simulation that explains the recordings, or None and the error of fused modes."""

    simulated: RobotPosterior | None
    modal_error: ErrorByZone

    def predict(
        self, q: np.ndarray, frequency_hz: np.ndarray, modal: Callable[[], Moments]
    ) -> Moments:
        """FRFs at q (n, dof) in rad; `modal` gives those of the fused modes there, where needed."""
        if self.simulated is not None:
            return self.simulated.predicted(q, frequency_hz)
        mean, sd = modal()
        relative = self.modal_error.at(frequency_hz)
        return mean, np.hypot(sd, relative * local_size(mean, frequency_hz))


def frf_model(
    simulated: RobotPosterior | None,
    measured: Measured,
    band_hz: tuple[float, float],
    left_out_modes: Callable[[], ModalPrediction],
    above: Callable[[int, np.ndarray], np.ndarray],
) -> FrfModel:
    """Of the FRFs of n measured poses.

    Args:
        simulated: the simulation after these FRFs, where it explains them.
        measured: what was measured.
        band_hz: over which FRFs are predicted.
        left_out_modes: fused modes (n, k) at each pose without it.
        above: what higher modes add at a pose, by its number, on lines (F,): (3, 3, F) in m/s²/N.
    """
    found: list[LeftOut] = []
    if simulated is None and len(measured.s) > 1:
        found = _fused(measured, left_out_modes(), above)
    return FrfModel(simulated, ErrorByZone.of(found, band_hz))


def _fused(
    measured: Measured,
    modes: ModalPrediction,
    above: Callable[[int, np.ndarray], np.ndarray],
) -> list[LeftOut]:
    found = []
    for i, (hertz, s) in enumerate(zip(measured.frequency_hz, measured.s, strict=True)):
        one = ModalPrediction(*(values[i : i + 1] for values in vars(modes).values()))
        mean, sd = frf_moments(_windowed(one, float(s.real[0])), hertz)
        predicted = mean[0] * (s / (1j * s.imag)) ** 2 + above(i, hertz)
        used = measured.used[i]
        known = np.where(used, measured.sd[i], 0.0) ** 2 + sd[0] ** 2
        nothing = np.zeros_like(predicted)
        found.append(LeftOut(hertz, measured.accelerance[i], predicted, nothing, known, used))
    return found


def _windowed(modes: ModalPrediction, rate_1_s: float) -> ModalPrediction:
    """Modes as an exponential window shows them: poles shifted left by its rate."""
    if rate_1_s == 0:
        return modes
    omega, zeta = 2 * np.pi * modes.frequency_hz, modes.damping_ratio
    real, imaginary = zeta * omega + rate_1_s, omega * np.sqrt(np.maximum(0.0, 1 - zeta**2))
    size = np.hypot(real, imaginary)
    return replace(modes, frequency_hz=size / (2 * np.pi), damping_ratio=real / size)
