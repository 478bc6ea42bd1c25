"""How well simulated FRFs and modes agree with measured ones (Birk et al. 2025, appendix B).

FRFs have the shape (pose, response, hit, F), accelerance in m/s²/N. Columns that were never hit
are NaN in the measured FRFs and in every figure made from them; averages leave them out. Two FRFs
that are zero on every line agree (1); a zero FRF and any other do not (0). Every pair of response
and hit has its own figures. The paper's direction d is taken as the direct FRF, response = hit:
cross FRFs that vanish by symmetry hold noise alone, on which every model, the true one included,
fails.
"""

from dataclasses import dataclass

import numpy as np

from planner.inference.per_pose import PerPose


def frac(measured: np.ndarray, simulated: np.ndarray) -> np.ndarray:
    """FRAC over magnitudes, (..., F) and (..., F) to (...), in [0, 1].

    (|a|ᵀ|b|)² / (|a|ᵀ|a| · |b|ᵀ|b|): Birk et al. 2025, appendix B.1. It sees shape only, neither
    scale nor phase counts.
    """
    return complex_frac(np.abs(measured), np.abs(simulated))


def complex_frac(measured: np.ndarray, simulated: np.ndarray) -> np.ndarray:
    """FRAC with phase, |aᴴb|² / (aᴴa · bᴴb), (..., F) and (..., F) to (...), in [0, 1].

    The usual criterion (Birk et al. 2025, reference 25): one complex factor for all
    lines does not count.
    """
    a, b = np.broadcast_arrays(measured, simulated)
    if a.shape[-1] == 0:
        raise ValueError("no frequency line to compare on")
    if np.any(np.isfinite(a) & ~np.isfinite(b)):
        raise ValueError("the simulated FRF has no number where one was measured")
    a, b = unit_and_length(a)[0], unit_and_length(b)[0]
    inner = np.abs(np.sum(a.conj() * b, axis=-1)) ** 2
    both_zero = ~(np.any(a != 0, axis=-1) | np.any(b != 0, axis=-1))
    return np.where(both_zero, 1.0, np.minimum(inner, 1.0))


@dataclass(frozen=True, eq=False)
class Agreement(PerPose):
    """Agreement of n poses in one band, per pose and direction: all (n, response, hit).

    `frac` is in [0, 1]; `error` and `size` (m/s²/N) are the Euclidean norms over lines of
    |H_meas| − |H_sim| and of |H_meas|. Poses may have frequency lines of their own.
    """

    frac: np.ndarray
    error: np.ndarray
    size: np.ndarray

    @property
    def global_frac(self) -> np.ndarray:
        """Global FRAC G_d (response, hit): the mean of the poses' FRAC (appendix B.1)."""
        return mean_known(self.frac, axis=0)

    @property
    def frobenius(self) -> np.ndarray:
        """Frobenius similarity S_d (response, hit) over magnitudes, in [0, 1].

        max(0, 1 − ‖|M_meas| − |M_sim|‖ / ‖|M_meas|‖), the norms over poses and lines (Birk et al.
        2025, appendix B.2).
        """
        unknown = np.isnan(self.size)
        parts = (np.where(unknown, 0.0, part) ** 2 for part in (self.error, self.size))
        whole, measured = (np.sqrt(np.sum(part, axis=0)) for part in parts)
        relative = np.divide(whole, measured, out=np.ones_like(whole), where=measured > 0)
        relative = np.where((measured == 0) & (whole == 0), 0.0, relative)
        return np.where(np.all(unknown, axis=0), np.nan, np.maximum(0.0, 1 - relative))


def agreement(measured: np.ndarray, simulated: np.ndarray) -> Agreement:
    """Agreement of FRFs (n, response, hit, F).

    Raises ValueError where there is no line, or no simulated number where one was measured.
    """
    a, b = np.broadcast_arrays(np.abs(measured), np.abs(simulated))
    return Agreement(frac(measured, simulated), unit_and_length(a - b)[1], unit_and_length(a)[1])


def direct_mean(values: np.ndarray) -> float:
    """Mean of a figure (response, hit) over the direct FRFs xx, yy, zz, as in Birk et al. 2025.

    Between several points, rows and columns going by threes, those of every sensor and hit point.
    """
    rows, columns = values.shape
    points = np.moveaxis(values.reshape(rows // 3, 3, columns // 3, 3), 2, 1)
    return float(mean_known(np.diagonal(points, axis1=2, axis2=3)))


def mean_known(values: np.ndarray, axis: int | tuple[int, ...] | None = None) -> np.ndarray:
    """Mean over an axis of the entries that are not NaN; NaN where there are none."""
    known = ~np.isnan(values)
    count = np.sum(known, axis=axis)
    total = np.sum(np.where(known, values, 0.0), axis=axis)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def unit_and_length(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vectors (..., F) scaled to length 1, and their lengths (...).

    The largest entry goes first, so that no square overflows; zero stays zero.
    """
    unit = np.array(vectors, np.result_type(vectors, 1.0))
    length = np.ones((*unit.shape[:-1], 1))
    for ord_ in (np.inf, 2):
        size = np.linalg.norm(unit, ord_, axis=-1, keepdims=True)
        np.divide(unit, size, out=unit, where=size > 0)
        length = length * size
    return unit, length[..., 0]
