"""FRFs anywhere: the simulation's own, and the fused modes', weighed by what each left out showed.

The simulation brings all of its modes, over the whole band. Where it explains the recordings it is
used alone; else it shares with FRFs made of fused modes, as much as makes the FRFs of measured
poses, each predicted from the others, best. Their errors also say how far off FRFs are elsewhere.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.campaign.frf_posterior import FrfPosterior, LeftOutFrf
from planner.identification.measured_frfs import Measured
from planner.surrogate.frf_bands import ModalPrediction, frf_moments

Moments = tuple[np.ndarray, np.ndarray]  # mean and sd (n, 3, 3, F) of FRFs in m/s²/N
ZONES = (
    5  # of the band, evenly on a logarithmic scale: what is left out differs from one to another
)
WIDTH = 0.05  # of the frequency: over which an FRF's size is averaged
OWN = 0.5  # share of an FRF's own square in its size; the rest is the mean of all nine
# χ² per value up to which the simulation is not weighed against fused modes: on generated cells
# these never came near it. A share too small to matter would only widen the bands.
ALONE, LITTLE_SHARE = 3.0, 0.05
# Before any pose is left out, and as one pose beside those that are.
ERROR_BEFORE, POSES_BEFORE = 0.03, 1.0


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
    """Relative error (ZONES,) of FRFs, in their local size, beyond what is known otherwise."""

    edges_hz: np.ndarray
    relative: np.ndarray

    @classmethod
    def of(cls, found: Sequence[LeftOut], band_hz: tuple[float, float]) -> "ErrorByZone":
        """From the poses that were left out; of none: what is expected before."""
        edges = np.geomspace(max(band_hz[0], 0.1), band_hz[1], ZONES + 1)
        square = np.full(ZONES, POSES_BEFORE * ERROR_BEFORE**2)
        count = np.full(ZONES, POSES_BEFORE)
        for pose in found:
            zone = np.clip(np.searchsorted(edges, pose.frequency_hz) - 1, 0, ZONES - 1)
            sizes = local_size(pose.predicted, pose.frequency_hz)
            left = pose.off - pose.explained
            for k in range(ZONES):
                here = pose.used & (zone == k)
                size = float(np.sum(sizes[here] ** 2))
                if size > 0:
                    excess = np.abs(left[here]) ** 2 - pose.known[here]
                    square[k] += max(0.0, float(np.sum(excess)) / size)
                    count[k] += 1
        return cls(edges, np.sqrt(square / count))

    def at(self, frequency_hz: np.ndarray) -> np.ndarray:
        """(F,) from middle to middle of the zones."""
        middle = np.sqrt(self.edges_hz[:-1] * self.edges_hz[1:])
        return np.interp(np.log(frequency_hz), np.log(middle), self.relative)


def local_size(h: np.ndarray, frequency_hz: np.ndarray) -> np.ndarray:
    """Size (…, 3, 3, F) of FRFs about each line; one that vanishes has a share of the others'."""
    log_f = np.log(frequency_hz)
    near = np.exp(-(((log_f[:, None] - log_f) / WIDTH) ** 2) / 2)
    square = np.abs(h) ** 2 @ (near / near.sum(axis=0))
    return np.sqrt(OWN * square + (1 - OWN) * square.mean(axis=(-3, -2), keepdims=True))


@dataclass(frozen=True, eq=False)
class FrfModel:
    """`share` of the simulation (None: there is none) beside fused modes, and the error of each."""

    simulated: FrfPosterior | None
    share: float
    simulated_error: ErrorByZone
    modal_error: ErrorByZone

    def predict(
        self, q: np.ndarray, frequency_hz: np.ndarray, modal: Callable[[], Moments]
    ) -> Moments:
        """FRFs at q (n, dof) in rad; `modal` gives those of the fused modes there, where needed."""
        found: list[tuple[float, Moments]] = []
        if self.simulated is not None and self.share > 0:
            mean, sd = self.simulated.response(q, frequency_hz)
            moments = mean, np.hypot(sd, self.simulated.common_error * np.abs(mean))
            found.append((self.share, _widened(moments, self.simulated_error, frequency_hz)))
        if self.share < 1:
            moments = _widened(modal(), self.modal_error, frequency_hz)
            found.append((1 - self.share, moments))
        mean = sum(w * m for w, (m, _) in found)
        variance = sum(w * (sd**2 + np.abs(m - mean) ** 2) for w, (m, sd) in found)
        return np.asarray(mean), np.sqrt(variance)


def _widened(moments: Moments, error: ErrorByZone, frequency_hz: np.ndarray) -> Moments:
    mean, sd = moments
    return mean, np.hypot(sd, error.at(frequency_hz) * local_size(mean, frequency_hz))


def frf_model(
    simulated: FrfPosterior | None,
    measured: Measured,
    band_hz: tuple[float, float],
    left_out_modes: Callable[[], ModalPrediction],
    above: Callable[[int, np.ndarray], np.ndarray],
) -> FrfModel:
    """Weigh simulation and fused modes by the FRFs of n measured poses.

    Args:
        simulated: the simulation after these FRFs, where there is one.
        measured: what it was fitted to.
        band_hz: over which FRFs are predicted.
        left_out_modes: fused modes (n, k) at each pose without it.
        above: what higher modes add at a pose, by its number, on lines (F,): (3, 3, F) in m/s²/N.
    """
    several = len(measured.s) > 1
    by_simulation = simulated.left_out() if simulated is not None and several else []
    first = [_simulated(pose) for pose in by_simulation]
    enough = simulated is not None and (simulated.misfit <= ALONE or not several)
    second = [] if enough or not several else _fused(measured, left_out_modes(), above)
    share = float(simulated is not None)
    if first and second:
        share = share_of(first, second)
    return FrfModel(
        simulated, share, ErrorByZone.of(first, band_hz), ErrorByZone.of(second, band_hz)
    )


def _simulated(pose: LeftOutFrf) -> LeftOut:
    used = np.isfinite(pose.noise_sd)
    known = np.where(used, pose.noise_sd, 0.0) ** 2 + pose.sd**2
    return LeftOut(pose.frequency_hz, pose.measured, pose.predicted, pose.missed, known, used)


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


def share_of(simulated: Sequence[LeftOut], fused: Sequence[LeftOut]) -> float:
    """Of the simulation: that with which the FRFs of all poses left out are least off.

    One pose more, at which it is right, speaks for it.
    """
    along, across = [], []
    for a, b in zip(simulated, fused, strict=True):
        apart = np.where(a.used, b.predicted - a.predicted, 0.0)
        size = np.sum(np.abs(np.where(a.used, a.measured, 0.0)) ** 2, axis=-1)
        size = np.where(size > 0, size, np.inf)
        along.append(np.mean(np.sum((apart.conj() * a.off).real, axis=-1) / size))
        across.append(np.mean(np.sum(np.abs(apart) ** 2, axis=-1) / size))
    total = float(np.sum(across) + np.mean(across))
    modal = float(np.sum(along)) / total if total > 0 else 0.0
    return 1 - float(
        np.where(modal > 1 - LITTLE_SHARE, 1.0, modal if modal > LITTLE_SHARE else 0.0)
    )
