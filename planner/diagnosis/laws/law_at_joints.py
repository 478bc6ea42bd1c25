"""A law at one joint or several, with all linear parameters beside it, as it is fitted."""

from dataclasses import dataclass, replace

import numpy as np

from planner.dataset.level_columns import Column
from planner.diagnosis.laws.torque_laws import Law
from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.linear.problem import Problem
from planner.diagnosis.thresholds import (
    LAW_ANGLE_LOG_SD,
    LAW_FARTHEST,
    LAW_LOG_SHARE,
    LAW_LOG_SHARE_SD,
    LAW_SHARE_SD,
)
from planner.inference.least_squares import Limits

FIRMEST = 0.99  # of a joint's stiffness, lacking in its gap
LONGEST = 0.7  # of a step: in the logarithms of the law, in sds of the linear parameters


@dataclass(frozen=True, eq=False)
class LawAtJoints:
    """A law at m joints, at linear parameters x (D,) and ν (2, m): stiffness share and ln angle.

    k is the share times the joints' stiffness `scale` (m,) in N·m/rad, ln a is `middle` (m,) + ν.
    With `sign` 0 ν holds the share itself, which may change its sign; otherwise its logarithm.
    `ports` (m,) are the joints, as numbered by `System.ports`; of those that `slides` (m,) says,
    k is in N/m and a in m. Springs of the joints' stiffness would give by `sag` (n, m) under their
    weight at each visit (rad, of joints that slide m), of which gears bear the share `borne`.
    """

    kind: Law
    sign: int
    ports: np.ndarray
    scale: np.ndarray
    middle: np.ndarray
    x: np.ndarray
    nu: np.ndarray
    slides: tuple[bool, ...] = ()
    sag: np.ndarray | None = None
    borne: float = 0.0

    def rest_at(self, visit: np.ndarray) -> np.ndarray:
        """(c, m): how far from the middle of their gap joints rest, before hits of visits (c,).

        In the unit of `sag`. There a spring that lacks k within ± a bears the weight's share.
        """
        if self.sag is None:
            return np.zeros((len(visit), len(self.ports)))
        held, share = self.borne * self.sag[visit], np.clip(self.k / self.scale, 0.0, FIRMEST)
        beyond = held + share * self.a * np.sign(held)
        return np.where(np.abs(beyond) > self.a, beyond, held / (1 - share))

    @property
    def effect(self) -> str:
        """Name of the effect, such as "friction"."""
        return self.kind.effect

    @property
    def k(self) -> np.ndarray:
        """k (m,) in N·m/rad."""
        share = self.sign * np.exp(self.nu[0]) if self.sign else self.nu[0]
        return self.scale * share

    @property
    def a(self) -> np.ndarray:
        """a (m,) in rad."""
        return np.exp(self.middle + self.nu[1])

    def parameters(
        self, joint: int, spread: np.ndarray, inexact: float
    ) -> dict[str, tuple[float, float, str]]:
        """Value, sd and unit of one joint's two numbers; `spread` (2, 2) is ν's covariance there.

        `inexact` is a relative sd besides.
        """
        k, a = float(self.k[joint]), float(self.a[joint])
        by_k = np.array([1.0 if self.sign else 1 / self.nu[0, joint], 0.0])  # ∂ ln k / ∂ν
        values, slopes = (k, a), (by_k, np.array([0.0, 1.0]))
        if self.effect == "friction":
            values, slopes = (k, k * a), (by_k, by_k + slopes[1])
        out = {}
        names = self.kind.names_at(bool(self.slides) and self.slides[joint])
        for (name, unit), value, slope in zip(names, values, slopes, strict=True):
            relative = np.hypot(np.sqrt(slope @ spread @ slope), inexact)
            out[name] = (value, float(relative * abs(value)), unit)
        return out

    @property
    def coordinates(self) -> np.ndarray:
        """(D + 2 m,): x, then the shares, then the angles."""
        return np.concatenate([self.x, self.nu.ravel()])

    def at(self, coordinates: np.ndarray) -> "LawAtJoints":
        """The same at other coordinates (D + 2 m,)."""
        d = len(self.x)
        return replace(self, x=coordinates[:d], nu=coordinates[d:].reshape(self.nu.shape))

    def law_prior(self) -> tuple[np.ndarray, np.ndarray]:
        """Prior mean and sd of ν, (2 m,) each."""
        m = len(self.ports)
        share = (LAW_LOG_SHARE, LAW_LOG_SHARE_SD) if self.sign else (0.0, LAW_SHARE_SD)
        return np.repeat([share[0], 0.0], m), np.repeat([share[1], LAW_ANGLE_LOG_SD], m)

    def prior(self, plain: Fit) -> tuple[np.ndarray, np.ndarray]:
        """Prior mean and sd of the coordinates, (D + 2 m,) each."""
        mean, sd = self.law_prior()
        misfit = plain.misfit
        return np.concatenate([misfit.mean, mean]), np.concatenate([misfit.sd, sd])

    def limits(self, plain: Fit) -> Limits:
        """How far a step goes, and the box that is looked at."""
        m, mean, sd = len(self.ports), plain.misfit.mean, plain.misfit.sd
        low, high = self.kind.share_bounds(self.sign)
        reach = LAW_FARTHEST * sd
        return Limits(
            longest=np.concatenate([LONGEST * sd, np.full(2 * m, LONGEST)]),
            lower=np.concatenate([mean - reach, np.repeat([low, -LAW_FARTHEST], m)]),
            upper=np.concatenate([mean + reach, np.repeat([high, LAW_FARTHEST], m)]),
            entrywise=True,
        )


@dataclass(frozen=True, eq=False)
class LawMisfit:
    """The objective of a law: χ² over complex values, and the value χ² + prior/2 = −ln posterior.

    `differing` is the χ² of what weaker hits differ from the strongest by. `residual` (c, 3, F) is
    measured less simulated, of what is compared; `stiffer` (c, m) in N·m/rad is what the law adds
    to the joints' stiffness, on the whole, while a hit rings. Gradient (D + 2 m,) and Gauss-Newton
    matrix are those of the value, `normal` that of the last step where they were not asked for.
    """

    law: LawAtJoints
    chi2: float = np.inf
    value: float = np.inf
    differing: float = np.inf
    residual: np.ndarray | None = None
    stiffer: np.ndarray | None = None
    _gradient: np.ndarray | None = None
    _normal: np.ndarray | None = None

    @property
    def gradient(self) -> np.ndarray:
        """See `GaussNewton.gradient`."""
        assert self._gradient is not None
        return self._gradient

    @property
    def normal(self) -> np.ndarray:
        """See `GaussNewton.normal`."""
        assert self._normal is not None
        return self._normal

    def sloped(self, gradient: np.ndarray | None, normal: np.ndarray | None) -> "LawMisfit":
        """With gradient (D + 2 m,) and Gauss-Newton matrix (D + 2 m, D + 2 m)."""
        return replace(self, _gradient=gradient, _normal=normal)

    def covariance(self, temper: float) -> np.ndarray:
        """Of the coordinates, (D + 2 m, D + 2 m), where the value counts 1/`temper`."""
        return np.linalg.inv(self.normal / temper)


@dataclass(frozen=True, eq=False)
class Laws:
    """Laws fitted at one joint beside the linear fit `plain`, and how probable each is.

    χ² counts 1/`temper`; `hit` is the hardest of the columns that told.
    """

    problem: Problem
    plain: Fit
    candidates: tuple[LawMisfit, ...]
    probability: tuple[float, ...]
    temper: float
    hit: Column
