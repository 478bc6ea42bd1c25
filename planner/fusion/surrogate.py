"""The pose-dependent modal parameters: frequencies, damping ratios and residues by label.

Frequencies are modelled as log f by AR1 over the simulation (primary feature of seed 000), or
without it where the measurements speak against it,
damping as log ζ by a GP, residues part by part (real, imaginary) by AR1 on values scaled to the
mode's own size. Logarithms keep frequencies and damping positive.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm, qmc

from planner.frf import modal
from planner.fusion.ar1 import OutputPrior
from planner.fusion.data import TrainingData
from planner.fusion.hedged import BELIEF, HedgedAR1, fit_hedged
from planner.physics.dynamics import SimulatedModes

# Stiffnesses off by ±30 % move frequencies by 15 %; EMA repeats a frequency to about 0.1 %.
FREQUENCY = OutputPrior(bias_sd=0.15, slope_sd=0.2, amplitude=0.03, nugget=0.002)
FREQUENCY_ALONE = OutputPrior(1.0, 0.0, amplitude=0.2, nugget=0.002, mean=float(np.log(20.0)))
DAMPING = OutputPrior(1.0, 0.0, amplitude=0.15, nugget=0.05, mean=float(np.log(0.03)))
RESIDUE = OutputPrior(bias_sd=0.2, slope_sd=0.5, amplitude=0.2, nugget=0.02)
RESIDUE_ALONE = OutputPrior(bias_sd=0.7, slope_sd=0.0, amplitude=0.5, nugget=0.02)
TYPICAL_RESIDUE = 1e-5  # m/(N·s), a robot's, where neither data nor simulation say anything
NUGGET = 1e-3  # of ln f beside an identified simulation
SAMPLES, KEPT = 256, 32
RESIDUE_SAMPLES, RESIDUE_KEPT = 64, 8


@dataclass(frozen=True, eq=False)
class ModalObservations:
    """Measured modes by label at n poses, x (n, d); NaN where a mode or a column is missing."""

    x: np.ndarray
    frequency_hz: np.ndarray  # (n, k)
    frequency_sd_hz: np.ndarray
    damping_ratio: np.ndarray
    damping_sd: np.ndarray
    residue: np.ndarray  # (n, k, 3, 3)
    residue_sd: np.ndarray
    simulated: SimulatedModes


@dataclass(frozen=True, eq=False)
class ModalPrediction:
    """Predicted modes at q poses with their sd; shapes (q, k) and (q, k, 3, 3).

    `residue_sd` is that of the real and of the imaginary part each (their mean square).
    """

    frequency_hz: np.ndarray
    frequency_sd_hz: np.ndarray
    damping_ratio: np.ndarray
    damping_sd: np.ndarray
    residue: np.ndarray
    residue_sd: np.ndarray


@dataclass(frozen=True, eq=False)
class Surrogate:
    """The fitted models; immutable."""

    primary: HedgedAR1  # log f of every label, then log ζ of every label
    residue: HedgedAR1 | None  # real and imaginary parts, scaled; None: they were not asked for
    scale: np.ndarray  # (k,) m/(N·s)

    @property
    def count(self) -> int:
        """Number of labels."""
        return len(self.scale)

    @property
    def frequency_trust(self) -> np.ndarray:
        """(k,) weight of the simulation in each label's frequency."""
        k, uses = self.count, self.primary.uses_low
        return np.where(uses, self.primary.weight, 1 - self.primary.weight)[:k]

    def frequency_inputs(self, simulated: SimulatedModes) -> np.ndarray:
        """Centred low fidelity (q, k) of the frequency outputs."""
        return self.primary.split(_primary_low(simulated))[1][:, : self.count]

    def predict(self, x: np.ndarray, simulated: SimulatedModes) -> ModalPrediction:
        """Modes at x (q, d) where the simulation says `simulated`; NaN residues if not fitted."""
        q, k = len(x), self.count
        mean, sd = self.primary.predict(x, _primary_low(simulated))
        f, zeta = np.exp(mean[:, :k]), np.exp(mean[:, k:])
        parts, parts_sd = self._parts(x, simulated)
        parts = parts.reshape(q, k, 3, 3, 2) * self.scale[:, None, None, None]
        parts_sd = parts_sd.reshape(q, k, 3, 3, 2) * self.scale[:, None, None, None]
        return ModalPrediction(
            f,
            f * _relative_sd(sd[:, :k]),
            zeta,
            zeta * _relative_sd(sd[:, k:]),
            parts[..., 0] + 1j * parts[..., 1],
            np.sqrt(np.mean(parts_sd**2, axis=-1)),
        )

    def _parts(self, x: np.ndarray, simulated: SimulatedModes) -> tuple[np.ndarray, np.ndarray]:
        """Scaled parts of the residues and their sd, (q, 18 k) each."""
        if self.residue is None:
            nothing = np.full((len(x), 18 * self.count), np.nan)
            return nothing, nothing
        return self.residue.predict(x, _parts(simulated.residue) / np.repeat(self.scale, 18))


def _relative_sd(sd: np.ndarray) -> np.ndarray:
    """Sd of a log-normal variable over its median."""
    return np.sqrt(np.expm1(sd**2)) * np.exp(sd**2 / 2)


def _primary_low(simulated: SimulatedModes) -> np.ndarray:
    """Low fidelity (n, 2k) of the primary outputs: log f; none for damping."""
    frequency = _log(simulated.frequency_hz)
    return np.concatenate([frequency, np.full_like(frequency, np.nan)], axis=1)


def _log(value: np.ndarray) -> np.ndarray:
    """Logarithm; NaN (missing) for what is not positive, as of a mode that a fit left unstable."""
    return np.log(np.where(value > 0, value, np.nan))


def _parts(residue: np.ndarray) -> np.ndarray:
    """(n, k, 3, 3) complex to (n, 18 k) real: per mode, row by row, real then imaginary."""
    both = np.stack([residue.real, residue.imag], axis=-1)
    return both.reshape(len(residue), 18 * residue.shape[1])


def fit_primary(
    seen: ModalObservations,
    discrepancy: np.ndarray | None = None,
    left_out_hz: np.ndarray | None = None,
    has_simulation: bool = True,
    reference: SimulatedModes | None = None,
    belief: float = BELIEF,
) -> HedgedAR1:
    """Fit log f of every label and log ζ of every label.

    `discrepancy` (k,) is how far ln f of a simulation that was fitted to these very modes is off
    elsewhere: its error at the measured poses says too little. None: it was not fitted.
    `left_out_hz` (n, k) is what it said of each pose before it had seen it, by which it is judged.
    `reference` is the simulation over the workspace: it says how large frequencies are before
    anything is measured. `belief` is the simulation's probability before these frequencies.
    """
    k = seen.frequency_hz.shape[1]
    y = np.concatenate([_log(seen.frequency_hz), _log(seen.damping_ratio)], axis=1)
    f, zeta = np.exp(y[:, :k]), np.exp(y[:, k:])
    sd = np.concatenate([seen.frequency_sd_hz / f, seen.damping_sd / zeta], axis=1)
    low = _primary_low(seen.simulated)
    default = np.full(k, np.log(20.0) if has_simulation else np.nan)
    if reference is not None:
        default = _centre(_log(reference.frequency_hz), default)
    centre = np.full(2 * k, np.nan)
    centre[:k] = _centre(low[:, :k], default)
    return fit_hedged(
        TrainingData(seen.x, y, sd, low),
        (*_frequency_priors(k, discrepancy), *[DAMPING] * k),
        (*[FREQUENCY_ALONE] * k, *[DAMPING] * k),
        centre,
        SAMPLES,
        KEPT,
        _judged(left_out_hz),
        belief,
    )


def fit_surrogate(
    seen: ModalObservations,
    has_simulation: bool = True,
    reference: SimulatedModes | None = None,
    primary: HedgedAR1 | None = None,
    residues: bool = True,
) -> Surrogate:
    """Fit all outputs to the measured modes (n may be 0: then the prior speaks).

    `reference` is as in `fit_primary`; `primary` is what that gave, where it was fitted already.
    Without `residues` these are left out, which takes two thirds of the time.
    """
    k = seen.frequency_hz.shape[1]
    if primary is None:
        primary = fit_primary(seen, has_simulation=has_simulation, reference=reference)
    scale = _scale(seen, reference)
    if not residues:
        return Surrogate(primary, None, scale)
    wide = np.repeat(scale, 18)
    parts_sd = np.repeat(seen.residue_sd.reshape(len(seen.x), 9 * k), 2, axis=1)
    low = _parts(seen.simulated.residue) / wide
    residue = fit_hedged(
        TrainingData(seen.x, _parts(seen.residue) / wide, parts_sd / wide, low),
        (RESIDUE,) * (18 * k),
        (RESIDUE_ALONE,) * (18 * k),
        np.zeros(18 * k) if has_simulation else np.full(18 * k, np.nan),
        RESIDUE_SAMPLES,
        RESIDUE_KEPT,
    )
    return Surrogate(primary, residue, scale)


def _judged(
    left_out_hz: np.ndarray | None,
) -> tuple[np.ndarray, tuple[OutputPrior, ...]] | None:
    if left_out_hz is None:
        return None
    low = np.concatenate([_log(left_out_hz), np.full_like(left_out_hz, np.nan)], axis=1)
    k = left_out_hz.shape[1]
    return low, (*[FREQUENCY] * k, *[DAMPING] * k)


def _frequency_priors(k: int, discrepancy: np.ndarray | None) -> list[OutputPrior]:
    if discrepancy is None:
        return [FREQUENCY] * k
    return [
        replace(FREQUENCY, bias_sd=size, slope_sd=size, amplitude=size, nugget=NUGGET, spread=0.5)
        for size in map(float, discrepancy)
    ]


def _centre(low: np.ndarray, default: np.ndarray) -> np.ndarray:
    """Mean of each column (k,), `default` (k,) where nothing is known."""
    known = np.isfinite(low)
    total = np.where(known, low, 0.0).sum(axis=0)
    return np.where(known.any(axis=0), total / np.maximum(known.sum(axis=0), 1), default)


def _scale(seen: ModalObservations, reference: SimulatedModes | None) -> np.ndarray:
    """Size (k,) of each mode's residues: measured, else simulated, else typical."""
    out = np.full(seen.frequency_hz.shape[1], np.nan)
    simulated = reference.residue if reference is not None else seen.simulated.residue
    for residue in (seen.residue, seen.simulated.residue, simulated):
        size = np.abs(residue)
        known = np.isfinite(size)
        mean = np.where(known, size, 0.0) ** 2
        count = known.sum(axis=(0, 2, 3))
        rms = np.sqrt(mean.sum(axis=(0, 2, 3)) / np.maximum(count, 1))
        out = np.where(np.isfinite(out), out, np.where(rms > 0, rms, np.nan))
    return np.where(np.isfinite(out), out, TYPICAL_RESIDUE)


def frf_prediction(
    prediction: ModalPrediction, frequency_hz: np.ndarray, samples: int = 256, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (q, 3, 3, F), complex, and sd (q, 3, 3, F) of the accelerance in m/s²/N.

    Quasi-Monte-Carlo over frequencies, damping ratios and residues (seed 000, section 3.4) with
    scrambled Sobol points; sd is the root of E|H − mean|².
    """
    q, k = prediction.frequency_hz.shape
    normal = _normal(samples, 20 * k, seed)
    zf, zd = normal[:, :k], normal[:, k : 2 * k]
    zr = normal[:, 2 * k :].reshape(samples, k, 3, 3, 2)
    zr = zr[..., 0] + 1j * zr[..., 1]
    mean = np.empty((q, 3, 3, len(frequency_hz)), dtype=complex)
    sd = np.empty((q, 3, 3, len(frequency_hz)))
    for i in range(q):
        f = _log_normal(prediction.frequency_hz[i], prediction.frequency_sd_hz[i], zf)
        zeta = _log_normal(prediction.damping_ratio[i], prediction.damping_sd[i], zd)
        residue = prediction.residue[i] + prediction.residue_sd[i] * zr
        mean[i], sd[i] = _moments(frequency_hz, modal.pole(f, np.minimum(zeta, 0.95)), residue)
    return mean, sd


def _normal(samples: int, dimensions: int, seed: int) -> np.ndarray:
    sobol = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed))
    unit = sobol.random_base2(int(np.ceil(np.log2(samples))))[:samples]
    return norm.ppf(np.clip(unit, 1e-6, 1 - 1e-6))


def _log_normal(median: np.ndarray, sd: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Samples (s, k) of the log-normal with this median and sd."""
    ratio = sd / median
    log_sd = np.sqrt(np.log((1 + np.sqrt(1 + 4 * ratio**2)) / 2))
    return median * np.exp(log_sd * z)


def _moments(
    frequency_hz: np.ndarray, poles: np.ndarray, residue: np.ndarray, chunk: int = 64
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and sd over samples, in chunks that stay in the cache."""
    n, size = len(poles), len(frequency_hz)
    total, square = np.zeros((3, 3, size), complex), np.zeros((3, 3, size))
    for start in range(0, n, chunk):
        part = slice(start, start + chunk)
        h = modal.accelerance(frequency_hz, poles[part], residue[part])
        total = total + h.sum(axis=0)
        square = square + (h.real**2 + h.imag**2).sum(axis=0)
    mean = total / n
    return mean, np.sqrt(np.maximum(square / n - np.abs(mean) ** 2, 0.0))
