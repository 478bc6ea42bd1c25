"""The pose-dependent modal parameters: frequencies, damping ratios and residues by label.

Frequencies are modelled as log f by AR1 over the simulation (primary feature of Busch et al.
2022), or without it where the measurements speak against it, damping as log ζ by a GP whose kernel
the measurements choose, residues part by part (real, imaginary) by AR1 on values scaled to the
mode's own size. Logarithms keep frequencies and damping positive.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.dynamics.vibration import SimulatedModes
from planner.inference.per_pose import PerPose
from planner.surrogate.ar1 import FusionData, OutputPrior
from planner.surrogate.average import PRIOR_BELIEF, Average, fit_hedged, fit_shapes
from planner.surrogate.frequency_models import DEFAULT, KERNEL, MODELS, FrequencyData
from planner.surrogate.frf_bands import ModalPrediction
from planner.surrogate.gp import remarks
from planner.surrogate.training_data import TrainingData

# Visits to a pose scatter by 0 to 1 % of ln f (temperature, clamping, readback) beyond what EMA
# states: median of the scatter, its log-sd, and the share of the latter's square that modes have
# in common, chosen on generated cells. Stiffnesses off by ±30 % move frequencies by 15 %.
FREQUENCY_PRIOR = OutputPrior(
    bias_sd=0.15, slope_sd=0.2, amplitude=0.03, nugget=0.003, nugget_spread=1.0, nugget_shared=0.7
)
FREQUENCY_PRIOR_ALONE = replace(
    FREQUENCY_PRIOR, bias_sd=1.0, slope_sd=0.0, amplitude=0.2, mean=float(np.log(20.0))
)
DAMPING_PRIOR = OutputPrior(1.0, 0.0, amplitude=0.15, nugget=0.05, mean=float(np.log(0.03)))
DAMPING_KERNELS = ("bias", "cubic", "matern52")  # of Busch et al. 2022; any shape
DAMPING_RANGE = -0.25, 1.25  # of coordinates; beyond it damping stays: polynomials run away
LARGEST_LOG_SD = 1.0  # of a mode of which nothing is known: it lies within a factor of e
RESIDUE_PRIOR = OutputPrior(bias_sd=0.2, slope_sd=0.5, amplitude=0.2, nugget=0.02)
RESIDUE_PRIOR_ALONE = OutputPrior(bias_sd=0.7, slope_sd=0.0, amplitude=0.5, nugget=0.02)
# Beside a simulation that was identified from these very recordings and fits them.
DAMPING_PRIOR_IDENTIFIED = OutputPrior(bias_sd=0.1, slope_sd=0.1, amplitude=0.03, nugget=0.02)
TYPICAL_RESIDUE = 1e-5  # m/(N·s), a robot's, where neither data nor simulation say anything
RESIDUE_SAMPLES, RESIDUE_KEPT = 64, 8


@dataclass(frozen=True, eq=False)
class ModalObservations(PerPose):
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
class Surrogate:
    """The fitted models; immutable."""

    primary: Average  # log f of every label
    damping: Average  # log ζ of every label
    residue: Average | None  # real and imaginary parts, scaled; None: they were not asked for
    scale: np.ndarray  # (k,) m/(N·s)

    @property
    def count(self) -> int:
        """Number of labels."""
        return len(self.scale)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What went wrong in the fits, each once."""
        fits = [self.primary.most_probable, *(self.damping.models[i] for i in self.damping.counted)]
        fits += [self.residue.most_probable] if self.residue is not None else []
        return tuple(dict.fromkeys(said for fit in fits for said in remarks(fit.outputs)))

    @property
    def visit_scatter(self) -> np.ndarray:
        """(k,) sd of ln f from visit to visit, beyond what the modal analysis states."""
        return np.sqrt(self.primary.nugget_variance)

    @property
    def frequency_trust(self) -> np.ndarray:
        """(k,) weight of the simulation in each label's frequency."""
        fused = self.primary.models[0]
        return np.where(fused.uses_low, self.primary.weights[0], 0.0)

    def with_residues(self, seen: ModalObservations) -> "Surrogate":
        """The same with the residues fitted too, which may be exacter than those it has `seen`."""
        k, scale = self.count, _scale(seen)
        wide = np.repeat(scale, 18)
        parts_sd = np.repeat(seen.residue_sd.reshape(len(seen.x), 9 * k), 2, axis=1)
        low = residue_parts(seen.simulated.residue) / wide
        given = FusionData(
            TrainingData(seen.x, residue_parts(seen.residue) / wide, parts_sd / wide, low),
            (RESIDUE_PRIOR,) * (18 * k),
            (RESIDUE_PRIOR_ALONE,) * (18 * k),
            np.zeros(18 * k),
        )
        residue = fit_hedged(given, RESIDUE_SAMPLES, RESIDUE_KEPT)
        return replace(self, residue=residue, scale=scale)

    def frequency_inputs(self, simulated: SimulatedModes) -> np.ndarray:
        """Centred low fidelity (q, k) of the frequency outputs."""
        return self.primary.most_probable.split(_log(simulated.frequency_hz))[1]

    def predict(
        self, x: np.ndarray, simulated: SimulatedModes, visit: bool = True
    ) -> ModalPrediction:
        """Modes at x (q, d) where the simulation says `simulated`; NaN residues if not fitted.

        Frequencies' sds are what a `visit` to the pose would show, scatter included, or else those
        of the pose's mean over many visits, which is what further poses narrow down.
        """
        q, k = len(x), self.count
        f, f_sd = self.frequencies(x, simulated.frequency_hz, visit)
        log_zeta, zeta_sd = self.damping.predict(
            np.clip(x, *DAMPING_RANGE), _log(simulated.damping_ratio)
        )
        zeta = np.exp(log_zeta)
        wide, both = np.repeat(self.scale, 18), np.full((2, q, 18 * k), np.nan)
        if self.residue is not None:
            both = self.residue.predict(x, residue_parts(simulated.residue) / wide)
        parts, parts_sd = (np.reshape(v * wide, (q, k, 3, 3, 2)) for v in both)
        return ModalPrediction(
            f,
            f_sd,
            zeta,
            zeta * _relative_sd(zeta_sd),
            parts[..., 0] + 1j * parts[..., 1],
            np.sqrt(np.mean(parts_sd**2, axis=-1)),
        )

    def frequencies(
        self, x: np.ndarray, simulated_hz: np.ndarray, visit: bool = True
    ) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies and their sds (q, k) in Hz, as of `predict`."""
        mean, sd = self.primary.predict(x, _log(simulated_hz), visit)
        f = np.exp(mean)
        return f, f * _relative_sd(sd)


def _relative_sd(sd: np.ndarray) -> np.ndarray:
    """Sd of a log-normal variable over its median."""
    sd = np.minimum(sd, LARGEST_LOG_SD)
    return np.sqrt(np.expm1(sd**2)) * np.exp(sd**2 / 2)


def _log(value: np.ndarray) -> np.ndarray:
    """Logarithm; NaN (missing) for what is not positive, as of a mode that a fit left unstable."""
    return np.log(np.where(value > 0, value, np.nan))


def residue_parts(residue: np.ndarray) -> np.ndarray:
    """(n, k, 3, 3) complex to (n, 18 k) real: per mode, row by row, real then imaginary."""
    both = np.stack([residue.real, residue.imag], axis=-1)
    both[np.isnan(residue)] = np.nan  # np.nan as a complex number is nan + 0j
    return both.reshape(len(residue), 18 * residue.shape[1])


def fit_primary(
    seen: ModalObservations,
    discrepancy: np.ndarray | None = None,
    belief: float = PRIOR_BELIEF,
    model: str = DEFAULT,
    kernel: str | None = None,
    elsewhere: tuple[np.ndarray, np.ndarray] | None = None,
) -> Average:
    """Fit ln f of every label.

    Args:
        seen: modes by label at n poses, and the simulation's there.
        discrepancy: how far ln f (k,) of a simulation that was fitted to these very modes is off
            elsewhere; its error at the measured poses says too little. None: it was not fitted.
        belief: probability of the simulation before these frequencies.
        model, kernel: names in `frequency_models.MODELS` and `kernels.KERNELS`.
        elsewhere: poses (N, d) and the simulation's frequencies (N, k) in Hz there, for models that
            learn the simulation too.
    """
    k = seen.frequency_hz.shape[1]
    priors = (FREQUENCY_PRIOR,) * k
    if discrepancy is not None:
        priors = tuple(
            replace(FREQUENCY_PRIOR, bias_sd=size, slope_sd=size, amplitude=size, spread=0.5)
            for size in map(float, discrepancy)
        )
    y, low = _log(seen.frequency_hz), _log(seen.simulated.frequency_hz)
    data = FrequencyData(
        TrainingData(seen.x, y, seen.frequency_sd_hz / np.exp(y), low),
        priors,
        (FREQUENCY_PRIOR_ALONE,) * k,
        _centre(low, np.full(k, FREQUENCY_PRIOR_ALONE.mean)),
        None if elsewhere is None else (elsewhere[0], _log(elsewhere[1])),
        belief,
        kernel or KERNEL,
    )
    return MODELS[model].fit(data)


def fit_damping(
    seen: ModalObservations, identified: bool = False, kernel: str | None = None
) -> Average:
    """Fit log ζ of every label: no simulation knows it that was not `identified`.

    A simulation that was is believed as far as the measured damping ratios bear it out, beside
    what they say alone: brakes and friction leave nothing of C = βK in some robots.
    """
    y = _log(seen.damping_ratio)
    low = _log(seen.simulated.damping_ratio) if identified else np.full_like(y, np.nan)
    given = FusionData(
        TrainingData(seen.x, y, seen.damping_sd / np.exp(y), low),
        (DAMPING_PRIOR_IDENTIFIED,) * y.shape[1],
        (DAMPING_PRIOR,) * y.shape[1],
        _centre(low, np.full(y.shape[1], np.nan)),
    )
    doubted = identified and bool(np.isfinite(y).any())  # nothing measured is no reason to doubt
    return fit_shapes(given, (kernel,) if kernel else DAMPING_KERNELS, doubted)


def fit_surrogate(
    seen: ModalObservations,
    primary: Average | None = None,
    residues: bool = True,
    identified: bool = False,
    kernel: str | None = None,
) -> Surrogate:
    """Fit all outputs to the measured modes (n may be 0: then the prior speaks).

    Args:
        seen: modes by label at n poses, and the simulation's there.
        primary: what `fit_primary` gave, where it was called already.
        residues: whether residues are fitted too, which takes two thirds of the time.
        identified: whether the simulation was identified from these measurements' own FRFs and fits
            them, so that damping is nearly its own.
        kernel: as of `fit_primary`; one that is named is the damping's, too.
    """
    if primary is None:
        primary = fit_primary(seen, kernel=kernel)
    damping = fit_damping(seen, identified, kernel)
    found = Surrogate(primary, damping, None, np.ones(seen.frequency_hz.shape[1]))
    return found.with_residues(seen) if residues else found


def _centre(low: np.ndarray, default: np.ndarray) -> np.ndarray:
    """Mean of each column (k,), `default` (k,) where nothing is known."""
    known = np.isfinite(low)
    total = np.where(known, low, 0.0).sum(axis=0)
    return np.where(known.any(axis=0), total / np.maximum(known.sum(axis=0), 1), default)


def _scale(seen: ModalObservations) -> np.ndarray:
    """Size (k,) of each mode's residues: measured, else simulated, else typical."""
    out = np.full(seen.frequency_hz.shape[1], np.nan)
    for residue in (seen.residue, seen.simulated.residue):
        size = np.abs(residue)
        known = np.isfinite(size)
        mean = np.where(known, size, 0.0) ** 2
        count = known.sum(axis=(0, 2, 3))
        rms = np.sqrt(mean.sum(axis=(0, 2, 3)) / np.maximum(count, 1))
        out = np.where(np.isfinite(out), out, np.where(rms > 0, rms, np.nan))
    return np.where(np.isfinite(out), out, TYPICAL_RESIDUE)
