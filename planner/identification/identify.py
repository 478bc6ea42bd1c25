"""Identification of a simulation's springs from measured FRFs, in seconds."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Parametrisation, Priors, parametrise
from planner.errors import InputError
from planner.fit.identify import TOO_SOFT
from planner.fit.result import Identification, estimates, undetermined
from planner.frf.frf import Frf
from planner.identification.effort import THOROUGH, Effort
from planner.identification.feasible_inertias import Barrier
from planner.identification.objective import Objective
from planner.identification.staged_problem import Progress, StagedProblem
from planner.inference.block_diagonal import block_diagonal
from planner.inference.least_squares import Minimum, inverse
from planner.measurement.measured_frfs import common_band, matrices_at
from planner.measurement.nuisances import Tolerances

SETTLED = 0.01  # squared move, in sds, that no further completion is worth
SAME = 1e-3  # relative difference of two starts that found the same minimum
AT_NOISE = 1.1  # misfit that no other start could better by much
STILL_GOOD = 1.5  # factor by which a warm start's misfit may grow before all is searched anew


@dataclass(frozen=True, eq=False)
class _Refined:
    """Where an identification ended, with χ² per real value, in all and of each pose (n,)."""

    end: Minimum
    misfit: float
    by_pose: np.ndarray


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
    tolerances: Tolerances | None = None,
) -> Identification:
    """Springs (and, where their priors are not 0, inertias) that explain FRFs at poses q.

    q is (n, dof) in rad, one row an FRF matrix. From each of several starts the logarithm of the
    FRFs is fitted in a band that widens in stages, then the FRFs themselves in units of their
    noise; the best is refined on all lines. The first start is the prior's median, the others are
    quasi-random between the bounds; starts (k, P) as an array, in the parameters' own units, are
    taken as they are. No more are tried once one has reached the noise, or the best two of three
    or more have met. A `warm`
    identification of the same parameters is refined alone where it still fits. `band_hz` is
    robot.toml's unless given. What `tolerances` leave open of hits, measuring chain and readback
    is integrated out; without them all are exact. Raises InputError where FRFs and poses do not
    fit together.
    """
    started = time.perf_counter()
    q = np.atleast_2d(np.asarray(q, dtype=float))
    _check(frfs, q, simulation)
    band = common_band(frfs, band_hz or simulation.robot.config.band_hz)
    p, elastic = parametrise(simulation, priors or Priors()), simulation.elastic
    inertias = p.inertias(elastic.body_jacobians(q))
    barrier = Barrier.around(elastic.inertia, p)
    matrices = matrices_at(elastic, q, frfs, tolerances is not None)
    problem = StagedProblem(
        tuple(frfs), q, elastic, band, matrices, inertias, p, progress, effort, barrier, tolerances
    )
    best = None if warm is None else _warm(problem, warm)
    misfits: tuple[float, ...] = ()
    if best is None:
        x, misfits = _search(problem, _starting_points(p, starts, seed))
        best = _refine(*problem.carried(x))
        if not np.isfinite(best.misfit):  # it can't be with the weight that these springs carry
            best = _refine(problem, x)
    if not np.isfinite(best.misfit):
        raise InputError(TOO_SOFT)
    seconds = time.perf_counter() - started
    return _result(problem, simulation, best, misfits, seconds)


def _check(frfs: Sequence[Frf], q: np.ndarray, simulation: Simulation) -> None:
    dof = len(simulation.robot.joint_names)
    if not frfs or q.shape != (len(frfs), dof) or not np.all(np.isfinite(q)):
        raise InputError(
            f"{len(frfs)} FRF matrices and joint angles of shape {q.shape} do not fit together; "
            f"give {dof} finite angles for each of at least one."
        )


def _starting_points(
    p: Parametrisation, starts: int | np.ndarray, seed: int
) -> Iterator[np.ndarray]:
    """θ (P,): the prior's median, then quasi-random between the bounds; or those given."""
    if not isinstance(starts, int):
        yield from p.near(np.log(np.atleast_2d(starts)))
        return
    yield p.mean
    if starts > 1:
        from scipy.stats import qmc  # scipy.stats takes most of a second to import

        lower, upper = np.log([(x.lower, x.upper) for x in p.parameters]).T
        sampler = qmc.Sobol(len(lower), scramble=True, rng=np.random.default_rng(seed))
        unit = sampler.random_base2(int(np.ceil(np.log2(starts))))[: starts - 1]
        yield from lower + unit * (upper - lower)


def _search(
    problem: StagedProblem, points: Iterable[np.ndarray]
) -> tuple[np.ndarray, tuple[float, ...]]:
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


def _approach(problem: StagedProblem, theta: np.ndarray, number: int) -> np.ndarray:
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
    problem: StagedProblem,
    x: np.ndarray,
    number: int,
    lines: int,
    stage: str,
    completions: int,
    near: bool = False,
) -> tuple[Minimum, Objective]:
    """Least plain residual from x; what the records lack is filled in again and again.

    So is what the measurement leaves open, both as they are where the last round ended. Where x is
    `near`, what the data tell of hits and chain there can be believed from the first round.
    """
    objective = problem.objective(1.0, lines, inertia=problem.inertial)
    tail = bool(np.isfinite(objective.measured.tail_s).any())
    for _ in range(2 if near and problem.tolerances else 1):
        objective = problem.prepared(objective, x, tail)
    end = problem.minimise(objective, x, number, stage, problem.effort.steps)
    rounds = max(completions if tail else 0, problem.effort.openings if problem.tolerances else 0)
    for _ in range(rounds):
        objective = problem.prepared(objective, end.x, tail)
        before, end = end.x, problem.minimise(objective, end.x, number, stage, problem.effort.steps)
        moved = end.x - before
        # Where the misfit exceeds the noise, so do the sds in which a move counts.
        settled = SETTLED * max(1.0, end.at.chi2 / max(objective.count, 1))
        fixed = objective.completion is None and objective.left_open is None
        if fixed or moved @ end.at.normal @ moved < settled:
            break
    return end, objective


def _refine(problem: StagedProblem, x: np.ndarray) -> _Refined:
    """Minimum over springs and inertias on all lines from (θ, φ)."""
    effort = problem.effort
    end, objective = _plain(
        problem, x, 0, effort.last_lines, "all lines", effort.last_completions, near=True
    )
    return _Refined(end, end.at.chi2 / max(objective.count, 1), objective.by_pose(end.x))


def _warm(problem: StagedProblem, warm: Identification) -> _Refined | None:
    """Refined from an earlier identification; None where that leads to a much worse misfit."""
    p = problem.parametrisation
    known = {e.name: np.log(e.value) for e in warm.estimates}
    known |= dict(zip(warm.nuisances, warm.mean[len(warm.estimates) :], strict=True))
    theta = [known.get(x.name, m) for x, m in zip(p.parameters, p.mean, strict=True)]
    phi = [known.get(name, 0.0) for name in p.nuisances]
    found = _refine(*problem.carried(np.array([*p.near(np.array(theta)), *phi])))
    good = found.misfit < STILL_GOOD * max(warm.misfit, 1.0)
    return found if good or not problem.effort.doubtful else None


def _result(
    problem: StagedProblem,
    simulation: Simulation,
    best: _Refined,
    starts: tuple[float, ...],
    seconds: float,
) -> Identification:
    end, misfit = best.end, best.misfit
    p, count = problem.parametrisation, len(problem.parametrisation.parameters)
    prior = block_diagonal(p.precision, np.eye(len(p.nuisances)))
    # Where the misfit is above the noise, the noise is at least as large as the misfit.
    data = (end.at.normal - prior) / max(misfit, 1.0)
    covariance = inverse(data + prior)
    change = p.inertia_change(end.x[count:]) if p.nuisances else None
    fitted = simulation.changed(p.elasticity(end.x[:count]), change)
    return Identification(
        fitted,
        estimates(p, end.x[:count], covariance),
        p.nuisances,
        end.x,
        covariance,
        misfit,
        round(end.at.chi2 / misfit),
        best.by_pose,
        undetermined(p, covariance),
        starts,
        end.converged,
        seconds,
    )
