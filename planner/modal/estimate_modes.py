"""From the FRF matrix of one pose to its modes, without an expert."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.errors import RefusedError
from planner.frf.frf import Frf
from planner.modal.fit_data import Data, too_few_lines
from planner.modal.least_squares import WeightedSets, reduced_together
from planner.modal.mode_selection import doubt, fit, presences, scales, strongest
from planner.modal.modes import LEAST_PROBABILITY, ModalModel, Mode
from planner.modal.plscf import Diagram, plscf
from planner.modal.pole_fit import PoleFit, shared_error
from planner.modal.residues import rank_one

# Of the band's span, taken away above, then below; at most half of what lies beside a mode there,
# so that it is judged by lines that hold it.
CUT = 0.12
LEAST_LINES = 32
COPIES = 1e6  # of the square of what a fit misses, in the scatter of hits: these do not scatter


def inflation(data: Data, fitted: PoleFit, shared: np.ndarray) -> np.ndarray:
    """(m,) factors ≥ 1 on the covariance of each mode for what noise does not explain.

    For poles in the s-plane (accelerance). `shared` (2m, 2m) is the covariance of the poles from
    errors that lines have in common: it moves the poles of parts of the band too.
    """
    m, scale = fitted.poles.size, np.tile(scales(data, fitted), 2)
    own = np.maximum(np.diag(fitted.covariance), 0.0) * scale
    factor = np.ones(m)
    for part, judged in _parts(data, fitted.poles).items():
        moved, covariance = _step(data, fitted, slice(*part))
        variance = np.maximum(np.diag(covariance) * scale, own)
        by_chance = variance - own + np.maximum(np.diag(shared), 0.0)
        # An error of the model, too, moves a pole the farther the less the lines hold it.
        beyond = np.maximum(moved**2 - by_chance, 0.0)
        # A pole that exact FRFs hold has no variance to inflate.
        beyond = np.divide(beyond, variance, out=np.zeros_like(beyond), where=variance > 0)
        # Real and imaginary parts suffer from the same cause: one factor a mode.
        here = 1 + np.max(beyond.reshape(2, m), axis=0)[judged]
        factor[judged] = np.maximum(factor[judged], here)
    return factor


def _parts(data: Data, poles: np.ndarray) -> dict[tuple[int, int], list[int]]:
    """Ranges of lines, first and end, and the poles that each judges."""
    frequency = data.frequency_hz
    low, high = frequency[[0, -1]]
    cut = CUT * (high - low)
    found: dict[tuple[int, int], list[int]] = {}
    for k, hz in enumerate(np.abs(poles) / (2 * np.pi)):
        if not low < hz < high:
            continue
        below = int(np.searchsorted(frequency, low + min(cut, (hz - low) / 2)))
        above = int(np.searchsorted(frequency, high - min(cut, (high - hz) / 2)))
        for part in ((0, above), (below, frequency.size)):
            if part[1] - part[0] >= LEAST_LINES:
                found.setdefault(part, []).append(k)
    return found


def _step(data: Data, fitted: PoleFit, part: slice) -> tuple[np.ndarray, np.ndarray]:
    """How the poles move (2m,) when part of the lines is fitted, and their covariance (2m, 2m).

    Linearised where all lines have them: poles that a part does not hold would stray in a fit, to
    where their variance is that of another place.
    """
    sets = WeightedSets(data.lines.part(part), data.values[:, part], fitted.variance[:, part])
    point = reduced_together(sets, fitted.poles)
    unit = np.sqrt(np.maximum(np.diag(fitted.covariance), 1e-300))
    turned = np.outer(unit, unit)
    # Of the information on the best held pole: below, rounding rules
    covariance = np.linalg.pinv(point.normal * turned, rcond=1e-10, hermitian=True) * turned
    return -covariance @ point.gradient, covariance


MAX_ORDER = 40


@dataclass(frozen=True, eq=False)
class PoleIdentification:
    """Poles fitted to data, the diagram that they came from, and which of them are modes."""

    data: Data
    diagram: Diagram
    fit: PoleFit

    @property
    def fit_error(self) -> float:
        """‖H − fit‖/‖H‖."""
        return float(np.linalg.norm(self.fit.error) / np.linalg.norm(self.data.response))

    @cached_property
    def scale(self) -> np.ndarray:
        """(m,) factor by which noise around each pole exceeds its variance."""
        return scales(self.data, self.fit)

    @cached_property
    def weak(self) -> np.ndarray:
        """(m,) above 1 where a pole is not established, as `mode_selection.doubt`."""
        return doubt(self.data, self.fit)

    @cached_property
    def presence(self) -> np.ndarray:
        """(m,) share of the response at each pole's frequency that is the mode's."""
        return presences(self.data, self.fit.poles, self.fit.residue)

    def natural(
        self, scale: np.ndarray, shared: np.ndarray | float = 0.0
    ) -> list[tuple[float, float, float, float]]:
        """Frequency (Hz), its sd, damping ratio, its sd (linearised) of each of the m poles.

        The poles' covariance counts `scale` (m,) times; `shared` (2m, 2m) is added.
        """
        poles, m = self.fit.poles, self.fit.poles.size
        covariance = np.tile(scale, 2)[:, None] * self.fit.covariance + shared
        own = np.einsum("akbk->kab", covariance.reshape(2, m, 2, m))
        size, real, imag = np.abs(poles), poles.real, poles.imag
        slope = np.stack([real / size, imag / size, -(imag**2) / size**3, real * imag / size**3])
        slope = slope.T.reshape(m, 2, 2) / np.array([[2 * np.pi], [1.0]])
        sd = np.sqrt(np.maximum(0.0, np.einsum("kia,kab,kib->ik", slope, own, slope)))
        each = (part.tolist() for part in (size / (2 * np.pi), sd[0], -real / size, sd[1]))
        return list(zip(*each, strict=True))

    def probability(self, k: int, pole: complex) -> float:
        """That a pole (index), in the diagram at `pole`, is a mode: logistic in what tells modes.

        That is: the share of the response that is the mode's, its support in the diagram, and how
        far it is from the limits of `weak`. Coefficients from 200 simulated poses (2-s records,
        hits that disagree by 0.3 %, a 3 % ripple, short records, weak modes; 1,100 poles).
        """
        size = np.log(np.clip(self.presence[k], 1e-3, 1.0))
        score = 1.2 * self.diagram.support(pole) - 3.1 * np.log(max(self.weak[k], 1e-6))
        return float(1 / (1 + np.exp(0.3 - score - 2.1 * size)))

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        """The poles that are established, in increasing frequency."""
        data, fitted, scale = self.data, self.fit, self.scale
        shared_pole, shared_residue = shared_error(data, fitted)
        if data.step_s is None:
            scale = scale * inflation(data, fitted, shared_pole)
        told, shape = self.natural(scale, shared_pole), data.response.shape[:2]
        sd = np.sqrt(scale * fitted.residue_variance + shared_residue)
        modes = []
        for k in np.flatnonzero(self.weak <= 1).tolist():
            residue = fitted.residue[:, k].reshape(shape), sd[:, k].reshape(shape)
            likely = self.probability(k, fitted.poles[k] - data.rate_1_s)
            modes.append(Mode(*told[k], *residue, rank_one(residue[0])[0], likely))
        return tuple(sorted(modes, key=lambda mode: mode.frequency_hz))


def identify(data: Data, max_order: int = MAX_ORDER) -> PoleIdentification | None:
    """All modes that the lines of `data` carry, None where there is no pole."""
    weight = None if data.variance is None else 1 / np.mean(data.variance, axis=1)
    found = plscf(data.frequency_hz, data.response, max_order, weight)
    start = found.start + data.rate_1_s
    start = start if start.size else strongest(data)
    if start.size == 0:
        return None
    return PoleIdentification(data, found, fit(data, data.with_one_above(start)))


# Lines beyond the band that are fitted too, so that modes at its edges are met from both sides.
MARGIN = 0.15


def estimate_modes(frf: Frf, band_hz: tuple[float, float]) -> ModalModel:
    """All modes in `band_hz` (Hz), with standard deviations and probabilities.

    Poles are those of the structure: an exponential window of the records is part of the fitted
    model. Standard deviations follow from `frf.variance`, enlarged where the error of the fit
    exceeds it, and from the error alone where the variance is unknown. Raises RefusedError where
    no mode can be found.
    """
    found, hit = identification(frf, band_hz), np.flatnonzero(frf.measured)
    sure: tuple[list[Mode], list[Mode]] = ([], [])
    for mode in found.modes if found else ():
        if band_hz[0] <= mode.frequency_hz <= band_hz[1]:
            both = np.full((3, 3), np.nan + 1j * np.nan), np.full((3, 3), np.nan)
            both[0][:, hit], both[1][:, hit] = mode.residue, mode.residue_sd
            certain = mode.probability >= LEAST_PROBABILITY
            sure[certain].append(replace(mode, residue=both[0], residue_sd=both[1]))
    doubtful, modes = map(tuple, sure)
    if found is None or not modes:
        raise RefusedError(
            f"No mode could be found between {band_hz[0]:g} and {band_hz[1]:g} Hz: hit harder or"
            " with another tip, or check that the band holds a resonance."
        )
    remarks = _remarks(found, doubtful)
    return ModalModel(modes, band_hz, found.fit_error, found.diagram.order, remarks, doubtful)


def identification(frf: Frf, band_hz: tuple[float, float]) -> PoleIdentification | None:
    """The same with everything in between (stabilisation diagram, fit), None without a mode.

    Raises RefusedError where too few frequency lines are usable.
    """
    usable = frf.usable_band_hz
    low = max(band_hz[0] / (1 + MARGIN), usable[0], 1e-9)
    high = min(band_hz[1] * (1 + MARGIN), usable[1])
    columns = np.flatnonzero(frf.measured)
    h = frf.accelerance[:, columns]
    chosen = (frf.frequency_hz >= low) & (frf.frequency_hz <= high)
    chosen &= np.all(np.isfinite(h), axis=(0, 1))
    if columns.size == 0 or np.count_nonzero(chosen) < 8 or not np.any(h[..., chosen]):
        raise too_few_lines(chosen, frf.frequency_hz, band_hz)
    variance = frf.variance[:, columns][..., chosen]
    known = np.all(np.isfinite(variance) & (variance > 0))
    force = frf.force_share
    data = Data(
        frf.frequency_hz[chosen],
        h[..., chosen],
        variance if known else None,
        frf.exponential_rate_1_s,
        tail_s=frf.tail_s,
        force_share=None if force is None else force[columns][:, chosen],
        force_window_s=frf.force_window_s,
    )
    return identify(data)


def _remarks(found: PoleIdentification, doubtful: tuple[Mode, ...]) -> tuple[str, ...]:
    remarks = []
    excess = float(np.median(found.fit.excess)) / found.data.correlated
    if found.data.variance is not None and excess >= COPIES:
        remarks.append(
            "The hits of an axis are equal to rounding, so their scatter tells nothing: are they"
            " copies of one recording?"
        )
    elif found.data.variance is not None and excess >= 4:
        remarks.append(
            f"The fit misses the FRFs by {np.sqrt(excess):.2g} times their scatter between hits:"
            " standard deviations were enlarged accordingly."
        )
    if doubtful:
        left_out = [f"{mode.frequency_hz:.4g}" for mode in doubtful]
        remarks.append(
            f"Poles that this FRF alone does not show to be modes (probability below"
            f" {LEAST_PROBABILITY:g}): {', '.join(left_out)} Hz."
        )
    return tuple(remarks)
