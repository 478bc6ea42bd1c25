"""Models of Birk et al. 2025 fitted to hits: within the bounds of Tables 1 and 2, and as ours.

The paper's fit is a genetic algorithm that minimises 1 − Global FRAC and the RMSE between
magnitudes. Here the same figure is minimised within the same hard bounds by L-BFGS-B, which alone
would end in the next hollow: before, least squares of the magnitudes' logarithm, which leads home
from afar, climbs from the end of this program's own fit brought within the bounds, and from that
of a global search (differential evolution) with the paper's population and generations, which
begins as the paper's does: a Latin hypercube with dampings in the lower eighth.

Where to measure: with covariance Σ of the parameters' logarithms and Fisher information F of the
hits at a pose, the next point is that of the largest ½ log det(I + Lᵀ F L), Σ = L Lᵀ (Fedorov
1972), at the stated parameters: before anything is measured, which is when it is asked.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import differential_evolution, least_squares, minimize
from scipy.stats import qmc

from planner.design.parameter_sensitivity import FrfNoise, UncertainParameters
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import CAD_INERTIAS, Priors, parametrise
from planner.fit.identify import identify, robot_prior
from planner.fit.posterior import RobotBelief
from planner.fit.result import TOLD
from planner.frf import metrics
from planner.frf.frf import Frf
from planner.frf.metrics import Agreement
from planner.measurement.nuisances import EXACT_HITS
from planner.robot.robot import Robot

from .data import BAND_HZ, FULL_HZ, PathHits

SEARCHED = {"12P, global search": 32, "24P, global search": 28}  # generations (section 2.3)
FILES = {name: f"robot_{name[:3].lower()}.toml" for name in ("12P", "24P", "24P, ours", *SEARCHED)}
DEGREE = 180 / np.pi  # the tables are in N·m/° and N·m·s/°
TORSION_BOUNDS = ((500, 5000), (500, 5000), (250, 3000), (100, 1500), (30, 1000), (30, 1000))
TRANSVERSE_BOUNDS = (
    (2500, 80000), (2500, 80000), (1250, 40000), (500, 5000), (150, 12000), (150, 12000)
)  # fmt: skip
DAMPING_BOUNDS = (0.0001, 0.7)
LOW_DAMPING = 1 / 8  # of the range, in which first guesses of dampings lie (section 2.3)
POPULATION = 14  # times the parameters: 168 and 336; the paper has 182 and 336
FEW_GENERATIONS = 2  # of the small version
LINES = 60  # that are compared
STEPS, FEW_STEPS = 30, 15  # of either climb; of the small version
AT_BOUND = 0.01  # of a bound's logarithmic width: nearer to it, a parameter is at its bound


@dataclass(frozen=True, eq=False)
class IdentifiedModel:
    """An identified simulation, its agreement with all poses in each band, its misfit.

    `values` (p,) and `bounds` (p, 2) of the parameters; ours has none that are hard.
    """

    simulation: Simulation
    limited: Agreement
    full: Agreement
    misfit: float
    values: np.ndarray
    bounds: np.ndarray

    @property
    def at_bounds(self) -> int:
        """How many parameters lie at a bound, or beyond."""
        low, high = np.log(self.bounds).T
        place = (np.log(self.values) - low) / (high - low)
        return int(np.sum((place < AT_BOUND) | (place > 1 - AT_BOUND)))

    @property
    def ratios(self) -> np.ndarray:
        """Transverse over rotational stiffness, joint by joint (6,)."""
        stiffness = self.simulation.elasticity.stiffness.reshape(6, 3)  # own axis, both across
        return stiffness[:, 1] / stiffness[:, 0]


@dataclass(frozen=True, eq=False)
class Design:
    """Points (k,), how many parameters they determine, and FRAC in % at all others.

    FRAC is NaN where nothing was identified from them.
    """

    name: str
    rows: np.ndarray
    determined: int
    frac: float


def stated(name: str) -> Simulation:
    """The model with the paper's own parameters."""
    return Simulation(Robot.load(Path(__file__).parent / "robot" / FILES[name]))


def paper_priors(simulation: Simulation) -> Priors:
    """A prior from the bounds for each parameter of `robot_12p.toml` or `robot_24p.toml`."""
    bounds = {}
    for name in (p.name for p in parametrise(simulation, Priors()).parameters):
        joint = int(name.partition("joint_")[2][0]) - 1
        stiffness = (TRANSVERSE_BOUNDS if name.endswith("across") else TORSION_BOUNDS)[joint]
        low, high = stiffness if name.startswith("stiffness") else DAMPING_BOUNDS
        bounds[name] = low * DEGREE, high * DEGREE
    return Priors(bounds=bounds)


def fitted(
    hits: PathHits, rows: np.ndarray, name: str, small: bool, searched: np.ndarray | None = None
) -> IdentifiedModel:
    """A model of FILES from the hits at some points: within hard bounds, or as ours.

    `searched` (p,): where a global search ended, from which least squares begin, too.
    """
    nominal, ours = stated(name), name.endswith("ours")
    frfs, q = [hits.hit_poses.frfs[i] for i in rows], hits.hit_poses.q[rows]
    priors, misfit = CAD_INERTIAS if ours else paper_priors(nominal), np.nan
    starts, steps = [], FEW_GENERATIONS if small else SEARCHED.get(name, 0)
    if name not in SEARCHED:
        tolerances = None if ours else EXACT_HITS
        found = identify(
            frfs, q, nominal, priors, band_hz=BAND_HZ, tolerances=tolerances, extend=ours
        ).identified
        values, misfit = np.array([e.value for e in found.estimates]), found.misfit
        if ours:
            return _model(hits, found.simulation, misfit, values, np.empty((0, 2)))
        starts = [values] if searched is None else [values, searched]
        steps = FEW_STEPS if small else STEPS
    values, p = within_bounds(nominal, priors, frfs, q, starts, steps), parametrise(nominal, priors)
    bounds = np.array([priors.bounds[x.name] for x in p.parameters])
    return _model(hits, nominal.changed(p.elasticity(np.log(values))), misfit, values, bounds)


def _model(
    hits: PathHits, simulation: Simulation, misfit: float, values: np.ndarray, bounds: np.ndarray
) -> IdentifiedModel:
    limited, full = (_agreement(hits, simulation, band) for band in (BAND_HZ, FULL_HZ))
    return IdentifiedModel(simulation, limited, full, misfit, values, bounds)


def within_bounds(
    nominal: Simulation, priors: Priors, frfs: Sequence[Frf], q: np.ndarray,
    starts: Sequence[np.ndarray], steps: int,
) -> np.ndarray:  # fmt: skip
    """Parameters (p,) of the least 1 − Global FRAC + relative RMSE within `priors`' bounds.

    From the best of `starts` (p,) by so many steps of least squares, and of L-BFGS-B; without any
    by a global search of the paper's population, and so many generations.
    """
    p = parametrise(nominal, priors)
    low, high = np.log([priors.bounds[x.name] for x in p.parameters]).T
    lines = np.linspace(*BAND_HZ, LINES)
    measured = np.array([_direct(frf.accelerance, frf.frequency_hz, lines) for frf in frfs])

    def simulated(theta: np.ndarray) -> np.ndarray:
        h = nominal.changed(p.elasticity(theta)).accelerance(q, lines)
        return np.abs(np.einsum("niif->nif", h))

    def logarithms(theta: np.ndarray) -> np.ndarray:
        return np.log(simulated(theta) / measured).ravel()

    def cost(theta: np.ndarray) -> float:
        told = simulated(theta)
        off = np.linalg.norm(told - measured) / np.linalg.norm(measured)
        return float(1 - np.mean(metrics.frac(measured, told)) + off)

    bounds = list(zip(low, high, strict=True))
    if not starts:
        damped = np.array([x.kind == "damping" for x in p.parameters])
        eighth = np.log(np.exp(low) + LOW_DAMPING * (np.exp(high) - np.exp(low)))
        unit = qmc.LatinHypercube(len(low), rng=0).random(POPULATION * len(low))
        first = low + unit * (np.where(damped, eighth, high) - low)
        found = differential_evolution(
            cost, bounds, init=first, maxiter=steps, tol=0, polish=False, rng=0
        )
        return np.exp(found.x)
    inside = [np.clip(np.log(start), low + 1e-3, high - 1e-3) for start in starts]
    near = [
        least_squares(logarithms, one, bounds=(low, high), loss="soft_l1", max_nfev=steps).x
        for one in inside
    ]
    end = minimize(cost, min((*inside, *near), key=cost), method="L-BFGS-B", bounds=bounds,
                   options={"maxiter": steps})  # fmt: skip
    return np.exp(end.x)


def _direct(h: np.ndarray, frequency_hz: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Magnitudes (3, F) of the direct FRFs at `lines` in Hz."""
    return np.array([np.interp(lines, frequency_hz, np.abs(h[i, i])) for i in range(3)])


def _agreement(hits: PathHits, simulation: Simulation, band_hz: tuple[float, float]) -> Agreement:
    """Of all poses, each on its own lines in the band."""
    parts = []
    for q, frf in zip(hits.hit_poses.q, hits.hit_poses.frfs, strict=True):
        seen = frf.within(band_hz)
        simulated = simulation.accelerance(q[None], seen.frequency_hz)
        parts.append(metrics.agreement(seen.accelerance[None], simulated))
    return Agreement.joined(parts)


def percent(agreement: Agreement) -> tuple[float, float]:
    """FRAC and Frobenius similarity in %, means over the direct FRFs."""
    return (
        100 * metrics.direct_mean(agreement.global_frac),
        100 * metrics.direct_mean(agreement.frobenius),
    )


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
        robot = RobotBelief.stated(robot_prior(simulation, priors), EXACT_HITS)
        open_ = UncertainParameters(robot, FrfNoise.of(tuple(frfs), band_hz, misfit), band_hz)
        springs = slice(0, len(robot.structure.parameters))
        told = open_.information(q)[:, :, springs, springs]
        return cls(open_.covariance[springs, springs], told)

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
