"""What is fitted, and the plane in which its poles lie."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from planner.errors import RefusedError
from planner.modal.residues import Lines, laplace


@dataclass(frozen=True, eq=False)
class Data:
    """What is fitted: responses on frequency lines, and the plane in which their poles lie.

    Accelerance (`step_s` None): the s-plane. Transforms of free decays sampled every `step_s`,
    taken at the lines of the DFT without padding: the z-plane, where they are exactly rational
    (the end of the record only scales the residues). `rate_1_s` is that of the exponential
    window which the records carry; poles are those of the structure, without it. `tail_s` is the
    time from the pulse to the end of the record (see `residues`). `force_share` and
    `force_window_s` say how the noise of the force spoils whole columns (see `Frf`). `near`:
    modes may lie close below the band. `above`: a pole above the lines stands for all modes there.
    `steady`: nothing changes between hits, so that poles close to each other are modes, however
    alike. Of responses (e, 1, F) that were measured in several `sets` these are the entries
    (indices) of each, `row` and `column` (e,) those of the matrix, rows of the points that roved,
    which were `hit` or else felt, columns of the few that stayed.
    """

    frequency_hz: np.ndarray  # (F,)
    response: np.ndarray  # (outputs, inputs, F)
    variance: np.ndarray | None  # like response, None where unknown
    rate_1_s: float = 0.0
    step_s: float | None = None
    tail_s: float = np.inf
    force_share: np.ndarray | None = None  # (inputs, F)
    force_window_s: float = 0.0
    near: bool = False
    above: bool = False
    steady: bool = False
    sets: tuple[np.ndarray, ...] = ()
    row: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    column: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    hit: bool = False

    @cached_property
    def lines(self) -> Lines:
        if self.step_s is None:
            return laplace(self.frequency_hz, self.rate_1_s, self.tail_s, self.near)
        s = 2j * np.pi * self.frequency_hz + self.rate_1_s
        x = np.exp(s * self.step_s)
        return Lines(x, x, np.stack([np.ones_like(x), x]))

    def to_plane(self, poles: np.ndarray) -> np.ndarray:
        """From rad/s to the plane of the lines."""
        return poles if self.step_s is None else np.exp(poles * self.step_s)

    def to_poles(self, values: np.ndarray) -> np.ndarray:
        """From the plane of the lines to rad/s."""
        return values if self.step_s is None else np.log(values) / self.step_s

    def is_above(self, poles: np.ndarray) -> np.ndarray:
        """(m,) bool: which poles stand for the modes above the lines."""
        return self.above & (poles.imag > 2 * np.pi * self.frequency_hz[-1])

    def with_one_above(self, poles: np.ndarray) -> np.ndarray:
        """Poles (m,) to start from, with one just above the lines where none is."""
        if not self.above or not poles.size or np.any(self.is_above(poles)):
            return poles
        ratio = float(np.median(-poles.real / np.abs(poles)))
        return np.append(poles, 2 * np.pi * 1.05 * self.frequency_hz[-1] * (1j - ratio))

    def allowed(self, values: np.ndarray) -> bool:
        """Near the band, and decaying as recorded (under the window)."""
        if np.any(values == 0):
            return False
        poles = self.to_poles(values)
        low, high = 2 * np.pi * self.frequency_hz[[0, -1]]
        span = high - low
        inside = (poles.imag > max(0.0, low - span)) & (poles.imag < high + span)
        damped = (poles.real < self.rate_1_s) & (-poles.real < 0.5 * np.abs(poles))
        return bool(np.all(inside & damped))

    @property
    def correlated(self) -> float:
        """Lines that carry one line's worth of information: the window smears noise over them.

        The noise of neighbours k lines apart correlates as 1/(1 + iπk·Δf/rate); the sum of the
        real parts, over all k, is what the variance of anything wider than that grows by.
        """
        lines = self.rate_1_s / (self.frequency_hz[1] - self.frequency_hz[0])
        return float(lines / np.tanh(lines)) if lines > 1e-6 else 1.0

    def force_errors(self, response: np.ndarray) -> np.ndarray:
        """What noise of the force adds to responses (e, F), one sd of each source.

        Returns (n, e, F): white noise of the window is a sum of independent pulses,
        as many as tell its spectra apart in the band, each of which scales one input's column.
        """
        assert self.force_share is not None
        count = int(np.ceil(2 * self.force_window_s * self.frequency_hz[-1])) + 4
        times = self.force_window_s * ((np.arange(count) + 0.5) / count - 0.5)
        pulses = np.exp(-2j * np.pi * times[:, None] * self.frequency_hz) / np.sqrt(count)
        response, inputs = response.reshape(self.response.shape), self.response.shape[1]
        errors = np.zeros((inputs, count, *response.shape), complex)
        for j, share in enumerate(self.force_share):
            scale = np.sqrt(share) * pulses
            errors[j, :, :, j] = -scale[:, None] * response[:, j]
        return errors.reshape(-1, *self.values.shape)

    @property
    def entries(self) -> int:
        return self.response.shape[0] * self.response.shape[1]

    @property
    def values(self) -> np.ndarray:
        """(e, F) responses, one entry after the other."""
        return self.response.reshape(self.entries, -1)

    @property
    def places(self) -> tuple[np.ndarray, np.ndarray]:
        """Response and reference (indices) of each entry."""
        return (self.column, self.row) if self.hit else (self.row, self.column)

    def table(self, values: np.ndarray) -> np.ndarray:
        """(r, c, …) of values (e, …), 0 where nothing was measured."""
        out = np.zeros((self.row.max() + 1, self.column.max() + 1, *values.shape[1:]), complex)
        out[self.row, self.column] = values
        return out

    @property
    def threshold(self) -> float:
        """Fall of χ² that a mode (pole and residues) reaches by chance with negligible odds."""
        k = 2 * self.entries + 2
        # Chance, in standard normal quantiles, that noise alone passes as a mode somewhere in the
        # band.
        return k * (1 - 2 / (9 * k) + 5.0 * np.sqrt(2 / (9 * k))) ** 3


BAND = "--band-hz, or [modes] band_hz of a campaign"


def too_few_lines(
    usable: np.ndarray, frequency_hz: np.ndarray, band_hz: tuple[float, float]
) -> RefusedError:
    """The refusal of FRFs at lines (F,), of which those that are `usable` (F,) are too few."""
    first, last = float(frequency_hz[0]), float(frequency_hz[-1])
    band = f"{band_hz[0]:g} to {band_hz[1]:g} Hz"
    if last < band_hz[0]:
        off = f"The FRFs end at {last:g} Hz, below the band of {band}"
    elif first > band_hz[1]:
        off = f"The FRFs begin at {first:g} Hz, above the band of {band}"
    else:
        return RefusedError(
            f"Only {np.count_nonzero(usable)} usable frequency lines lie in the band of {band}, of "
            f"FRFs between {first:g} and {last:g} Hz: give another band ({BAND}), "
            f"record longer or hit with a harder tip."
        )
    return RefusedError(f"{off} in which modes are looked for; give another ({BAND}).")
