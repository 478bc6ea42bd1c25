"""How much each measured FRF counts: by noise, and by a discrepancy proportional to |H|."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.measurement.measured_frfs import Measured

ELL = 0.03  # of the frequency: lines so near share the discrepancy, about a half-power band
SHARE = 0.3  # of the rms of all FRFs of a pose at a line, in the size of each
LOG_FLOOR, LOG_DROP = 0.3, 0.3  # relative sds: no logarithm counts more; from which it counts none
LOG_PRIOR = 10.0  # far away data err alike, and the prior counts for more
UNUSED = 1e4  # sds of what was not measured, in the size of FRFs
JITTER = 1e-6  # of the discrepancy's variance, that each line has for itself


@dataclass(frozen=True, eq=False)
class Weights:
    """Of measured FRFs; what is found of a discrepancy's size ρ is kept."""

    measured: Measured

    @cached_property
    def size(self) -> np.ndarray:
        """(n, r, c, F) of FRFs, to which the discrepancy is proportional; at least a share of
        the rms of all of the pose at that frequency."""
        m = self.measured
        square = np.where(m.used, np.abs(m.accelerance) ** 2, 0.0)
        count = np.maximum(m.used.sum(axis=(1, 2), keepdims=True), 1)
        rms = np.sqrt(square.sum(axis=(1, 2), keepdims=True) / count)
        size = np.sqrt(square + SHARE**2 * rms**2)
        return np.where(size > 0, size, 1.0)

    @cached_property
    def logarithmic(self) -> np.ndarray:
        """(n, r, c, F) of logarithms."""
        m = self.measured
        relative = np.where(m.used, m.sd, np.inf) / np.abs(m.accelerance)
        kept = relative < LOG_DROP
        sd = np.hypot(np.where(kept, relative, 1.0), LOG_FLOOR)
        return np.where(kept, np.sqrt(2 / LOG_PRIOR) / sd, 0.0)

    @cached_property
    def _known(self) -> dict[float, np.ndarray]:
        return {}

    def __getstate__(self) -> Mapping[str, object]:
        """For another process, which finds the rest itself."""
        return {"measured": self.measured}

    def whitening(self, rho: float) -> np.ndarray:
        """(n, r, c, F, F): inverse of the covariance's root, of real and imaginary part each."""
        if rho not in self._known:
            self._known[rho] = self._whitening(rho)
        return self._known[rho]

    def _whitening(self, rho: float) -> np.ndarray:
        m, size = self.measured, self.size
        width = ELL * m.frequency_hz
        apart = (m.frequency_hz[:, :, None] - m.frequency_hz[:, None]) ** 2
        both = width[:, :, None] ** 2 + width[:, None] ** 2
        alike = np.sqrt(2 * width[:, :, None] * width[:, None] / both) * np.exp(-apart / both)
        lines = np.arange(alike.shape[-1])
        relative = np.repeat(alike[:, None, None] * (rho**2 / 2), size.shape[1], axis=1)
        relative = np.repeat(relative, size.shape[2], axis=2)
        noise = np.where(m.used, m.sd**2 / (2 * size**2), UNUSED**2)
        relative[..., lines, lines] += noise + JITTER * rho**2
        return np.linalg.inv(np.linalg.cholesky(relative)) / size[..., None, :]

    def volume(self, rho: float) -> float:
        """ln of the determinant of the residuals' covariance."""
        diagonal = np.log(np.einsum("...ff->...f", self.whitening(rho)))
        return -4 * float(np.sum(np.where(self.measured.used, diagonal, 0.0)))
