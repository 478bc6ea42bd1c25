"""Laws of joints fitted to the hits in the course of time: one engine, for one joint or several.

The strongest hits hold the linear parameters (with priors, inertias among them); the differences
between weaker hits and the strongest ones hold the law, because what the simulation lacks
otherwise is the same at all levels and drops out of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from planner.diagnosis.laws.equivalent_stiffness import System, receptances, system_of
from planner.diagnosis.laws.law_at_joints import LawAtJoints, LawMisfit
from planner.diagnosis.laws.level_data import (
    LevelData,
    LinearSlopes,
    own_parameter,
    stiffened_slopes,
)
from planner.diagnosis.laws.one_joint_response import Strokes, seen, side_by_side_views, spectra
from planner.diagnosis.laws.one_joint_response import torques as one_joint_torques
from planner.diagnosis.laws.several_joint_response import Joints, joints_of, rates, torque_spectra
from planner.diagnosis.linear.fit import Fit
from planner.inference.least_squares import Damping, Iterate, accept, begin, propose
from planner.inference.parallel import side_by_side

STEP = 1e-3  # of finite differences in ν and in the joint's own ln stiffness
BATCH_DAMPING = Damping(first=1e-2, least=1e-6, most=2e4, lighter=0.1, heavier=10.0)
GAIN = 1e-3  # of the value: what a round must gain for a fit to go on


@dataclass(frozen=True, eq=False)
class LawProblem:
    """What laws are fitted to: columns, the linear fit to them, and the hits as integrated.

    `linear` are derivatives by the linear parameters, taken as the same wherever a law is; without
    them they are those at every point, which takes longer.
    """

    data: LevelData
    plain: Fit
    hits: Strokes
    linear: LinearSlopes | None = None

    def start(self, law: LawAtJoints, rule: Damping) -> Iterate[LawMisfit]:
        """A fit where nothing is evaluated yet."""
        return begin(law.coordinates, LawMisfit(law), rule, law.limits(self.plain))


def misfits(problem: LawProblem, laws: Sequence[LawAtJoints]) -> list[LawMisfit]:
    """The objective of each law; with gradient and matrix where `problem.linear` is given.

    Laws at one joint are integrated many at a time by compiled code, which is much faster than the
    integrator of several joints, and with derivatives by differences as cheap as the angles.
    """
    if problem.linear is None or any(len(law.ports) > 1 for law in laws):
        return [_misfit_of_several(problem, law) for law in laws]
    order = sorted(range(len(laws)), key=lambda i: laws[i].effect)
    half = (len(order) + 1) // 2
    halves = [[laws[i] for i in part] for part in (order[:half], order[half:]) if part]
    done = side_by_side(partial(_misfits_of_one, problem), halves)
    found = dict(zip(order, (c for part in done for c in part), strict=True))
    return [found[i] for i in range(len(laws))]


def advance(
    problem: LawProblem,
    fits: Sequence[Iterate[LawMisfit]],
    rounds: int,
    tolerance: float = GAIN,
) -> list[Iterate[LawMisfit]]:
    """All fits some steps further, evaluated together; those that gain nothing more are left."""
    out = list(fits)
    fresh = [i for i, fit in enumerate(out) if not np.isfinite(fit.at.value)]
    for i, at in zip(fresh, misfits(problem, [out[i].at.law for i in fresh]), strict=True):
        out[i] = replace(out[i], at=at)
    active = [np.isfinite(fit.at.value) for fit in out]
    for _ in range(rounds):
        todo = [i for i, on in enumerate(active) if on]
        if not todo:
            break
        x = [propose(out[i]) for i in todo]
        laws = [out[i].at.law.at(one) for i, one in zip(todo, x, strict=True)]
        for i, one, at in zip(todo, x, misfits(problem, laws), strict=True):
            before, out[i] = out[i], accept(out[i], one, at)
            moved = out[i].gained > 0
            enough = out[i].gained > tolerance * before.at.value
            active[i] = enough if moved else not out[i].stuck
    return out


def descended(
    problem: LawProblem, law: LawAtJoints, rounds: int, gain: float, rule: Damping
) -> LawMisfit:
    """Where `rounds` steps lead, each of which lowers the value; the last one by less than `gain`.

    Gradient and matrix, which take longer than the value, are asked for only where a step led.
    """
    fit = problem.start(law, rule)
    fit = replace(fit, at=misfits(problem, [law])[0])
    for _ in range(rounds):
        if not np.isfinite(fit.at.value):
            break
        sloped = _sloped(problem, fit.at)
        if not np.isfinite(sloped.value):
            break
        before = replace(fit, at=sloped)
        fit = _stepped(problem, before)
        if not fit.gained:
            break
        fit = replace(fit, at=fit.at.sloped(None, before.at.normal))
        if fit.gained < gain * fit.at.value:
            break
    return fit.at


def _stepped(problem: LawProblem, fit: Iterate[LawMisfit]) -> Iterate[LawMisfit]:
    """After a step that lowers the value, as short as need be; stuck where there is none."""
    while True:
        x = propose(fit)
        fit = accept(fit, x, misfits(problem, [fit.at.law.at(x)])[0])
        if fit.gained or fit.stuck:
            return fit


def _misfit_of_several(problem: LawProblem, law: LawAtJoints) -> LawMisfit:
    data, system = problem.data, system_of(problem.plain, law.x)
    joints = _joints(problem, law, system)
    with np.errstate(over="ignore", invalid="ignore"):
        try:
            found = torque_spectra(law.kind, law.k, law.a, joints, problem.hits, data.s)
        except np.linalg.LinAlgError:  # swings without bounds
            return LawMisfit(law)
        h = frfs(data, system, law.ports, found.spectrum[None])[0]
        return _weighed(problem, law, h, found.stiffer)


def _joints(problem: LawProblem, law: LawAtJoints, system: System) -> Joints:
    joints = joints_of(system, problem.hits, problem.data.fastest_hz)
    return replace(joints, rest=law.rest_at(problem.hits.visit))


def _sloped(problem: LawProblem, at: LawMisfit) -> LawMisfit:
    """The objective with its gradient and Gauss-Newton matrix.

    Those by the law and by the joints' own springs follow the swings in time; those by all other
    parameters take the joints as springs that are stiffer by what each hit makes of them.
    """
    data, law, plain = problem.data, at.law, problem.plain
    assert at.stiffer is not None
    system = system_of(plain, law.x)
    with np.errstate(over="ignore", invalid="ignore"):
        try:
            joints = _joints(problem, law, system)
            moved = rates(law.kind, law.k, law.a, joints, problem.hits, data.s)
        except np.linalg.LinAlgError:  # swings without bounds
            return LawMisfit(law)
        slopes = frfs(data, system, law.ports, moved.reshape(-1, *moved.shape[2:]), 0.0)
    blocks = system.blocks[law.ports]
    linear = problem.linear or stiffened_slopes(data, plain, law.x, blocks, at.stiffer)
    return _with_normal(problem, at, linear, slopes)


def _misfits_of_one(problem: LawProblem, laws: Sequence[LawAtJoints]) -> list[LawMisfit]:
    """Laws at one joint each, all integrated together."""
    linear = problem.linear
    assert linear is not None
    out = []
    with np.errstate(over="ignore", invalid="ignore"):  # of laws that swing without bounds
        found = one_joint_frfs(problem, laws)
        weighed = [_weighed(problem, law, h) for law, (h, _) in zip(laws, found, strict=True)]
    for at, (_, slopes) in zip(weighed, found, strict=True):
        if np.isfinite(at.value):
            at = _with_normal(problem, at, linear, slopes)
        # A batch of fits holds many points: what they do not need any more is left behind.
        out.append(replace(at, residual=None))
    return out


def one_joint_frfs(
    problem: LawProblem, laws: Sequence[LawAtJoints]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """FRFs (c, 3, F) of all columns, and derivatives (3, c, 3, F) by ν and the own ln stiffness."""
    data, hits = problem.data, problem.hits
    systems = [system_of(problem.plain, law.x) for law in laws]
    c = len(data.h)
    views, follow, numbers, rest = [], [], [], []
    shifts = np.concatenate([np.zeros((1, 2)), STEP * np.eye(2), np.zeros((1, 2))])
    for number, (law, system) in enumerate(zip(laws, systems, strict=True)):
        port = int(law.ports[0])
        views += 4 * [seen(system, port, hits, data.fastest_hz)]
        own = system.elasticity.stiffness[system.blocks[port]]
        moved = [replace(law, nu=law.nu + shift[:, None]) for shift in shifts]
        extra = [0.0, 0.0, 0.0, STEP * own]
        numbers += [(m.k[0], m.a[0], e) for m, e in zip(moved, extra, strict=True)]
        rest += [m.rest_at(hits.visit)[:, 0] for m in moved]
        first, last = 4 * number * c, 4 * (number + 1) * c
        if follow and follow[-1][0] is law.kind:  # neighbours that follow the same law, as one
            first = follow.pop()[1].start
        follow.append((law.kind, slice(first, last)))
    k, a, extra = np.repeat(np.array(numbers), c, axis=0).T
    view = side_by_side_views(views)
    torque = one_joint_torques(follow, k, a, extra, view, np.concatenate(rest))
    parts = spectra(torque, hits, data.s).reshape(len(laws), 4, 1, c, -1)
    out = []
    for law, system, part in zip(laws, systems, parts, strict=True):
        h = frfs(data, system, law.ports, part)
        out.append((h[0], (h[1:] - h[0]) / STEP))
    return out


def frfs(
    data: LevelData, system: System, ports: np.ndarray, torque: np.ndarray, share: float = 1.0
) -> np.ndarray:
    """H = s² (share · G − G_ports T / F) of all columns (v, c, 3, F), in m/s²/N.

    For v variants of the torques' spectra (v, m, c, F) in N·m·s at the joints `ports` (m,).
    """
    out = np.empty((len(torque), *data.h.shape), dtype=complex)
    for visit in np.unique(data.hits.visit):
        g = receptances(system, int(visit), data.s)
        through = g.sensor_port[:, :, ports]
        for c in np.flatnonzero(data.hits.visit == visit):
            part = np.moveaxis(torque[:, :, c] / data.force[c], 1, 2)[..., None]  # (v, F, m, 1)
            h = share * g.sensor_hit[:, :, data.hits.axis[c]] - (through @ part)[..., 0]
            out[:, c] = np.swapaxes(data.s[:, None] ** 2 * h, 1, 2)
    return out


def _weighed(
    problem: LawProblem, law: LawAtJoints, h: np.ndarray, stiffer: np.ndarray | None = None
) -> LawMisfit:
    """χ² and the objective of FRFs (c, 3, F)."""
    data = problem.data
    residual = data.compared(data.h) - data.compared(h)
    each = data.chi2(residual)
    chi2, differing = float(np.sum(each)), float(np.sum(each[data.weaker[:, 0, 0]]))
    mean, sd = law.prior(problem.plain)
    away = (law.coordinates - mean) / sd
    value = chi2 + 0.5 * float(away @ away)
    if not np.isfinite(value):
        return LawMisfit(law)
    return LawMisfit(law, chi2, value, differing, residual, stiffer)


def _with_normal(
    problem: LawProblem, at: LawMisfit, linear: LinearSlopes, slopes: np.ndarray
) -> LawMisfit:
    """The objective with its gradient and Gauss-Newton matrix; ∞ where these have no bounds.

    `slopes` (3 m, c, 3, F) are derivatives of FRFs by ν and by the joints' own springs, which are
    told by them alone. Swings that stay small may be so sensitive that these overflow.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        gradient, normal = _gradient_and_normal(problem, at, linear, slopes)
    bounded = np.isfinite(gradient).all() and np.isfinite(normal).all()
    return at.sloped(gradient, normal) if bounded else LawMisfit(at.law)


def _gradient_and_normal(
    problem: LawProblem, at: LawMisfit, linear: LinearSlopes, slopes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    data, law, plain = problem.data, at.law, problem.plain
    assert at.residual is not None
    m, d = len(law.ports), len(plain.x)
    flat, rest = data.scaled(data.compared(slopes)), data.scaled(at.residual[None])[0]
    blocks = system_of(plain).blocks[law.ports]
    own = [own_parameter(plain, int(block)) for block in blocks]
    # Where each of ours belongs among the coordinates: tied springs share a parameter.
    into = np.zeros((3 * m, d + 2 * m))
    into[np.arange(3 * m), np.concatenate([d + np.arange(2 * m), own])] = 1.0
    others = np.ones(d)
    others[own] = 0.0
    theirs = data.of_rows(np.concatenate([flat, rest[None]]), linear.rows)
    cross = (linear.scaled @ theirs[:-1].T) * others[:, None] @ into
    normal = into.T @ (flat @ flat.T) @ into
    normal[:d] += cross
    normal[:, :d] += cross.T
    normal[:d, :d] += linear.gram * np.outer(others, others)
    gradient = -(flat @ rest) @ into
    gradient[:d] -= others * (linear.scaled @ theirs[-1])
    mean, sd = law.prior(plain)
    away = (law.coordinates - mean) / sd
    # χ² over complex values is twice half the sum over real ones.
    return 2 * gradient + away / sd, 2 * normal + np.diag(1 / sd**2)
