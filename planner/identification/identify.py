"""Identification of a simulation's springs from measured FRFs, in seconds."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.dynamics.gradient import Inertias
from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.frf.frf import Frf
from planner.identification.agreement import MODEL_ERROR, MOST_LINES, agreement
from planner.identification.feasible_inertias import Barrier
from planner.identification.measured_frfs import common_band, stack
from planner.identification.objective import TOO_SOFT, Objective, stands
from planner.identification.parameters import Parametrisation, Priors, parametrise
from planner.identification.result import Identification, estimates, undetermined
from planner.inference.least_squares import Minimum, inverse, minimise
from planner.robot.elastic_model import ElasticModel, Matrices

STAGES = (0.1, 0.28, 0.59, 1.0)  # of the band: 25, 60, 120, 200 Hz of 5 to 200
SETTLED = 0.01  # squared move, in sds, that no further completion is worth
LOG_TOLERANCE = 1e-4
SAME = 1e-3  # relative difference of two starts that found the same minimum
AT_NOISE = 1.1  # misfit that no other start could better by much
STIFFER = float(np.log(1.5))  # by which the springs of a start grow until they carry the weight
STIFFEST = 20  # such steps: a factor of 3,000
STILL_GOOD = 1.5  # factor by which a warm start's misfit may grow before all is searched anew


@dataclass(frozen=True)
class Effort:
    """How exact an identification is: lines a pose and completions of cut-off records.

    Each for a start and for the last fit, which is judged on as many lines; iterations end where a
    step gains less than `tolerance`.
    """

    lines: int = 160
    last_lines: int = MOST_LINES
    completions: int = 2  # after the first: exact to second order
    last_completions: int = 6
    tolerance: float = 1e-6
    sloped: bool = True  # a completion holds to first order, not at one point only
    stages: tuple[float, ...] = STAGES
    log_lines: int = 64  # a pose, in the logarithmic stages
    log_steps: int = 40
    steps: int = 80
    doubtful: bool = True  # of a warm start that fits worse than before: all is searched anew


THOROUGH = Effort()
QUICK = Effort(
    48, 80, 0, 1, 1e-4, False, stages=(0.28, 1.0), log_lines=40, log_steps=12, doubtful=False
)


@dataclass(frozen=True)
class Progress:
    """Where an identification is: start (from 1), stage in words, iteration, misfit so far."""

    start: int
    stage: str
    iteration: int
    misfit: float


@dataclass(frozen=True, eq=False)
class _Problem:
    """All that stays the same from start to start.

    Matrices depend on the springs only in that these carry the weight: they are those of
    robot.toml's until a search has found better ones.
    """

    frfs: tuple[Frf, ...]
    q: np.ndarray
    elastic: ElasticModel
    band_hz: tuple[float, float]
    matrices: Matrices
    inertias: Inertias
    parametrisation: Parametrisation
    progress: Callable[[Progress], None] | None
    effort: Effort
    barrier: Barrier | None

    @property
    def inertial(self) -> bool:
        """Whether inertias are identified too."""
        return bool(self.parametrisation.nuisances)

    def carried(self, x: np.ndarray) -> tuple["_Problem", np.ndarray]:
        """The same where the springs at x = (θ, φ) carry the weight, and x, made to stand there."""
        p = self.parametrisation
        count = len(p.parameters)
        elastic = self.elastic.carried_by(p.elasticity(x[:count]).stiffness)
        inertias = p.inertias(elastic.body_jacobians(self.q))
        there = replace(self, matrices=elastic.matrices(self.q), inertias=inertias)
        return there, np.concatenate([there.standing(x[:count]), x[count:]])

    def standing(self, theta: np.ndarray) -> np.ndarray:
        """θ (P,) with all springs as much stiffer as it takes to carry the robot's weight."""
        p = self.parametrisation
        stiffer = STIFFER * np.array([x.kind == "stiffness" for x in p.parameters])
        for steps in range(STIFFEST + 1):
            tried = p.near(theta + steps * stiffer)
            if stands(self.matrices, p.elasticity(tried).stiffness):
                return theta if steps == 0 else tried
        raise InputError(TOO_SOFT)

    def objective(
        self, share: float, lines: int, logarithmic: bool = False, inertia: bool = False
    ) -> Objective:
        low, high = self.band_hz
        band = low, low + share * (high - low)
        measured = stack(self.frfs, band, lines, MODEL_ERROR)
        parts = self.matrices, self.inertias, self.parametrisation
        return Objective(measured, *parts, logarithmic, inertia, barrier=self.barrier)

    def minimise(
        self, objective: Objective, x: np.ndarray, start: int, stage: str, steps: int
    ) -> Minimum:
        count, tell = max(objective.count, 1), self.progress

        def told(iteration: int, value: float) -> None:
            assert tell is not None
            tell(Progress(start, stage, iteration, 2 * value / count))

        tolerance = LOG_TOLERANCE if objective.logarithmic else self.effort.tolerance
        return minimise(objective, x, tolerance, steps, told if tell else None)


def identify(
    frfs: Sequence[Frf],
    q: np.ndarray,
    simulation: Simulation,
    priors: Priors | None = None,
    *,
    band_hz: tuple[float, float] | None = None,
    starts: int | np.ndarray = 8,
    seed: int = 0,
    warm: Identification | None = None,
    progress: Callable[[Progress], None] | None = None,
    effort: Effort = THOROUGH,
) -> Identification:
    """Springs (and, where their priors are not 0, inertias) that explain FRFs at poses q.

    q is (n, dof) in rad, one row an FRF matrix. From each of several starts the logarithm of the
    FRFs is fitted in a band that widens in stages, then the FRFs themselves in units of their
    noise; the best is refined on all lines. The first start is the prior's median, the others are
    quasi-random between the bounds; starts (k, P) as an array, in the parameters' own units, are
    taken as they are. No more are tried once one has reached the noise, or the best two of three
    or more have met. A `warm`
    identification of the same parameters is refined alone where it still fits. `band_hz` is
    robot.toml's unless given. Raises InputError where FRFs and poses do not fit together.
    """
    started = time.perf_counter()
    q = np.atleast_2d(np.asarray(q, dtype=float))
    _check(frfs, q, simulation)
    band = common_band(frfs, band_hz or simulation.robot.config.band_hz)
    p, elastic = parametrise(simulation, priors or Priors()), simulation.elastic
    inertias = p.inertias(elastic.body_jacobians(q))
    barrier = Barrier.around(elastic.inertia, p)
    problem = _Problem(
        tuple(frfs), q, elastic, band, elastic.matrices(q), inertias, p, progress, effort, barrier
    )
    best = None if warm is None else _warm(problem, warm)
    misfits: tuple[float, ...] = ()
    if best is None:
        x, misfits = _search(problem, _starting_points(p, starts, seed))
        best = _refine(*problem.carried(x))
    seconds = time.perf_counter() - started
    return _result(problem, simulation, q, best, misfits, seconds)


def _check(frfs: Sequence[Frf], q: np.ndarray, simulation: Simulation) -> None:
    dof = len(simulation.robot.joint_names)
    if not frfs or q.shape != (len(frfs), dof) or not np.all(np.isfinite(q)):
        raise InputError(
            f"{len(frfs)} FRF matrices and joint angles of shape {q.shape} do not fit together; "
            f"give {dof} finite angles for each of at least one."
        )


def _starting_points(p: Parametrisation, starts: int | np.ndarray, seed: int) -> np.ndarray:
    """θ (k, P): the prior's median, then quasi-random between the bounds; or those given."""
    if not isinstance(starts, int):
        return p.near(np.log(np.atleast_2d(starts)))
    if starts == 1:
        return p.mean[None]
    from scipy.stats import qmc  # scipy.stats takes most of a second to import

    lower, upper = np.log([(x.lower, x.upper) for x in p.parameters]).T
    sampler = qmc.Sobol(len(lower), scramble=True, rng=np.random.default_rng(seed))
    unit = sampler.random_base2(int(np.ceil(np.log2(starts))))[: starts - 1]
    return np.vstack([p.mean, lower + unit * (upper - lower)])


def _search(problem: _Problem, points: np.ndarray) -> tuple[np.ndarray, tuple[float, ...]]:
    """Best (θ, φ) of all starts, and the misfit of each."""
    found: list[Minimum] = []
    misfits: list[float] = []
    for number, point in enumerate(points, 1):
        x = _approach(problem, problem.standing(point), number)
        effort, stage = problem.effort, "FRFs in units of their noise"
        end, objective = _plain(problem, x, number, effort.lines, stage, effort.completions)
        found.append(end)
        misfits.append(end.at.chi2 / max(objective.count, 1))
        values = sorted(m.at.value for m in found)
        met = len(values) > 2 and values[1] - values[0] < SAME * values[0]
        if met or min(misfits) < AT_NOISE:
            break
    best = min(found, key=lambda m: m.at.value)
    return best.x, tuple(misfits)


def _approach(problem: _Problem, theta: np.ndarray, number: int) -> np.ndarray:
    """(θ, φ) from where the plain residual leads home: logarithms in bands that widen."""
    low, high = problem.band_hz
    effort = problem.effort
    for share in effort.stages:
        stage = f"logarithms up to {low + share * (high - low):.0f} Hz"
        objective = problem.objective(share, effort.log_lines, logarithmic=True)
        theta = problem.minimise(objective, theta, number, stage, effort.log_steps).x
    x = np.concatenate([theta, np.zeros(len(problem.parametrisation.nuisances))])
    if problem.inertial:
        objective = problem.objective(1.0, effort.log_lines, logarithmic=True, inertia=True)
        x = problem.minimise(objective, x, number, "logarithms, inertias free", effort.log_steps).x
    return x


def _plain(
    problem: _Problem, x: np.ndarray, number: int, lines: int, stage: str, completions: int
) -> tuple[Minimum, Objective]:
    """Least plain residual from x; what the records lack is filled in again and again."""
    objective = problem.objective(1.0, lines, inertia=problem.inertial)
    tail = bool(np.isfinite(objective.measured.tail_s).any())
    sloped = problem.effort.sloped
    objective = objective.completed(x, sloped) if tail else objective
    end = problem.minimise(objective, x, number, stage, problem.effort.steps)
    for _ in range(completions if tail else 0):
        objective = objective.completed(end.x, sloped)
        before, end = end.x, problem.minimise(objective, end.x, number, stage, problem.effort.steps)
        moved = end.x - before
        # Where the misfit exceeds the noise, so do the sds in which a move counts.
        settled = SETTLED * max(1.0, end.at.chi2 / max(objective.count, 1))
        if objective.completion is None or moved @ end.at.normal @ moved < settled:
            break
    return end, objective


def _refine(problem: _Problem, x: np.ndarray) -> tuple[Minimum, float]:
    """Minimum over springs and inertias on all lines from (θ, φ), and its misfit."""
    effort = problem.effort
    end, objective = _plain(problem, x, 0, effort.last_lines, "all lines", effort.last_completions)
    return end, end.at.chi2 / max(objective.count, 1)


def _warm(problem: _Problem, warm: Identification) -> tuple[Minimum, float] | None:
    """Refined from an earlier identification; None where that leads to a much worse misfit."""
    p = problem.parametrisation
    known = {e.name: np.log(e.value) for e in warm.estimates}
    known |= dict(zip(warm.nuisances, warm.mean[len(warm.estimates) :], strict=True))
    theta = [known.get(x.name, m) for x, m in zip(p.parameters, p.mean, strict=True)]
    phi = [known.get(name, 0.0) for name in p.nuisances]
    end, misfit = _refine(*problem.carried(np.array([*p.near(np.array(theta)), *phi])))
    good = misfit < STILL_GOOD * max(warm.misfit, 1.0)
    return (end, misfit) if good or not problem.effort.doubtful else None


def _result(
    problem: _Problem,
    simulation: Simulation,
    q: np.ndarray,
    best: tuple[Minimum, float],
    starts: tuple[float, ...],
    seconds: float,
) -> Identification:
    end, misfit = best
    p, count = problem.parametrisation, len(problem.parametrisation.parameters)
    scale = np.concatenate([1 / p.log_sd**2, np.ones(len(p.nuisances))])
    # Where the misfit is above the noise, the noise is at least as large as the misfit.
    data = (end.at.normal - np.diag(scale)) / max(misfit, 1.0)
    covariance = inverse(data + np.diag(scale))
    change = p.inertia_change(end.x[count:]) if p.nuisances else None
    fitted = simulation.changed(p.elasticity(end.x[:count]), change)
    lines = problem.effort.last_lines
    left, similarity = agreement(fitted, problem.frfs, q, problem.band_hz, lines)
    return Identification(
        fitted,
        estimates(p, end.x[:count], covariance),
        p.nuisances,
        end.x,
        covariance,
        misfit,
        round(end.at.chi2 / misfit),
        left.by_pose,
        similarity,
        undetermined(p, covariance),
        starts,
        end.converged,
        seconds,
    )
