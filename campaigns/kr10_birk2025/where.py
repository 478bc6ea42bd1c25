"""Where to measure for Birk et al. 2025: which of the poses tell most.

Two answers, before anything is measured. D-optimal poses tell most of the parameters: with
covariance Σ of their logarithms and Fisher information F of the hits at a pose, the next is that of
the largest ½ log det(I + Lᵀ F L), Σ = L Lᵀ (Fedorov 1972), at the stated parameters.

What is wanted are FRFs everywhere, and no parameters are the robot's own: what a model cannot
follow is a good share of every FRF, and at near poses the same, which hitting both does not
average. V-optimal poses (Atkinson, Donev & Tobias 2007) leave the least mean square error of the
FRFs predicted at all poses, tr(B (Σ⁻¹ + Jᵀ R⁻¹ J)⁻¹) with B = Σ JᵤᵀJᵤ over all of them. R makes two
poses as alike as their FRFs are: what no parameter follows goes with the pose as FRFs do. It is the
mean over parameters drawn from their prior; poses are added, then exchanged one by one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.design.parameter_sensitivity import FrfNoise, OpenParameters
from planner.dynamics.gradient import laplace, response_gradient
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Parametrisation, Priors, parametrise
from planner.fit.misfit import SHARE
from planner.fit.result import TOLD
from planner.frf.frf import Frf

# Chosen: what 24P cannot follow, in shares of |H|; of its square, what a pose has for itself; lines
# of the band; drawn parameters; rounds of exchanges.
UNEXPLAINED, OWN, LINES, DRAWS, ROUNDS = 0.2, 0.02, 60, 8, 3


@dataclass(frozen=True, eq=False)
class Design:
    """Points (k,), how many parameters they determine, and FRAC in % at all others.

    FRAC is NaN where nothing was identified from them.
    """

    name: str
    rows: np.ndarray
    determined: int
    frac: float


@dataclass(frozen=True, eq=False)
class Informative:
    """What hits at n poses would tell of p parameters' logarithms.

    `covariance` (p, p) before, `information` (n, 3, p, p) of a hit along each axis.
    """

    covariance: np.ndarray
    information: np.ndarray

    @classmethod
    def of(
        cls, simulation: Simulation, priors: Priors, frfs: Sequence[Frf], q: np.ndarray,
        misfit: float, band_hz: tuple[float, float],
    ) -> "Informative":  # fmt: skip
        """At poses q (n, dof) in rad, with the noise of these FRFs and a misfit as found."""
        p = parametrise(simulation, priors)
        covariance = np.diag([parameter.log_sd**2 for parameter in p.parameters])
        noise = FrfNoise.of(tuple(frfs), band_hz, misfit)
        open_ = OpenParameters(simulation, p, covariance, noise, band_hz)
        return cls(covariance, open_.information(q))

    def best(self, count: int) -> np.ndarray:
        """Rows (count,), the most informative first, each hit along all axes."""
        covariance, told = self.covariance, self.information.sum(axis=1)
        chosen: list[int] = []
        for _ in range(count):
            root = np.linalg.cholesky(covariance)
            gained = np.eye(len(root)) + root.T @ told @ root
            gain = np.linalg.slogdet(gained)[1]
            gain[chosen] = -np.inf
            chosen.append(int(np.argmax(gain)))
            covariance = root @ np.linalg.inv(gained[chosen[-1]]) @ root.T
            covariance = (covariance + covariance.T) / 2
        return np.array(chosen)

    def determined(self, rows: np.ndarray, axes: Sequence[int] = (0, 1, 2)) -> int:
        """How many parameters hits along `axes` determine: sd less than half of before."""
        told = self.information[rows][:, list(axes)].sum(axis=(0, 1))
        after = np.linalg.inv(np.linalg.inv(self.covariance) + told)
        return int(np.sum(np.sqrt(np.diag(after) / np.diag(self.covariance)) < TOLD))


@dataclass(frozen=True, eq=False)
class Predictive:
    """What hits at some of n poses leave open of FRFs at all n, for each of some draws.

    `precision` (p, p) of the parameters' logarithms before; of each draw Jᵢᵀ Jⱼ (n, n, p, p), in
    shares of |H|, and how much alike the FRFs of poses are (n, n).
    """

    precision: np.ndarray
    products: tuple[np.ndarray, ...]
    alike: tuple[np.ndarray, ...]

    @classmethod
    def of(
        cls, simulation: Simulation, priors: Priors, q: np.ndarray, band_hz: tuple[float, float]
    ) -> "Predictive":
        """At poses q (n, dof) in rad."""
        p = parametrise(simulation, priors)
        sd, mean = np.array([(x.log_sd, np.log(x.median)) for x in p.parameters]).T
        drawn = mean + sd * np.random.default_rng(0).standard_normal((DRAWS, len(sd)))
        lines = np.linspace(*band_hz, LINES)
        pairs = [_products(simulation, p, theta, q, lines) for theta in drawn]
        return cls(np.diag(sd**-2), *map(tuple, zip(*pairs, strict=True)))

    @cached_property
    def everywhere(self) -> list[np.ndarray]:
        """B (p, p) of each draw."""
        return [np.einsum("nnpq->pq", product) / len(product) for product in self.products]

    def left(self, rows: Sequence[int]) -> float:
        """ln of the mean square error of FRFs everywhere once some poses are hit, mean of draws."""
        some, each = np.ix_(rows, rows), []
        draws = zip(self.products, self.alike, self.everywhere, strict=True)
        for product, alike, everywhere in draws:
            r = UNEXPLAINED**2 * (alike[some] + OWN * np.eye(len(rows)))
            told = np.einsum("ij,ijpq->pq", np.linalg.inv(r), product[some])
            each.append(np.log(np.sum(np.linalg.inv(self.precision + told) * everywhere)))
        return float(np.mean(each))

    def best(self, count: int) -> np.ndarray:
        """Rows (count,) that leave least, by greed and exchanges; the first ones tell most."""
        rows: list[int] = []
        for _ in range(count):
            rows = self._with(rows, len(rows))
        for _ in range(ROUNDS):
            before = rows
            for place in range(count):
                rows = self._with(rows[:place] + rows[place + 1 :], place)
            if rows == before:
                break
        return np.array(rows)

    def _with(self, rows: list[int], place: int) -> list[int]:
        free = (i for i in range(len(self.alike[0])) if i not in rows)
        tried = ([*rows[:place], i, *rows[place:]] for i in free)
        return min(tried, key=self.left)


def _products(
    simulation: Simulation, p: Parametrisation, theta: np.ndarray, q: np.ndarray, lines: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Of one draw: see `Predictive`."""
    matrices, frequency = simulation.elastic.matrices(q), np.tile(lines, (len(q), 1))
    h, slope = response_gradient(matrices, p.elasticity(theta), laplace(frequency))
    rms = np.sqrt(np.mean(np.abs(h) ** 2, axis=(1, 2), keepdims=True))
    size = np.hypot(np.abs(h), SHARE * rms)
    by_parameter = np.einsum("kp,nkijf->npijf", p.spread, slope) / size[:, None]
    j = by_parameter.reshape(*by_parameter.shape[:2], -1).view(float)
    shown = (h / size).reshape(len(q), -1).view(float)
    shown /= np.linalg.norm(shown, axis=1, keepdims=True)
    return np.einsum("npl,mql->nmpq", j, j, optimize=True), shown @ shown.T
