"""The linear simulation refitted to the hits of each force level by themselves.

Of joints that are not linear, springs that follow the force level: what each does as the swing
grows tells, joint by joint, about where a law's numbers lie.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import optimize

from planner.dataset.dataset import Dataset
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.laws.equivalent_stiffness import (
    System,
    receptances,
    swing,
    system_of,
    telling,
)
from planner.diagnosis.laws.law_at_joints import LawAtJoints
from planner.diagnosis.laws.starting_values import faded
from planner.diagnosis.laws.torque_laws import LAWS, LEAST_SHARE, Law
from planner.diagnosis.linear.drift_fit import problem_of
from planner.diagnosis.linear.fit import Fit, fit
from planner.diagnosis.linear.problem import FINE, GLANCE, Problem
from planner.diagnosis.thresholds import LAW_ANGLE_LOG_SD, LAW_LOG_SHARE, LAW_LOG_SHARE_SD
from planner.dynamics.simulation import Simulation
from planner.inference.least_squares import minimise

LOG_STEPS = 20
SPRING_SD = 0.05  # of ln stiffness that a refit gives a joint that is not linear
LINEAR_SD = 1.0  # of ln stiffness of a joint without its law
LINEAR, SHARES, ANGLES = (0.6, 1.0, 1.5), (0.1, 0.5, 1.5), (0.05, 0.2, 0.6, 1.5)  # of the grid
MOST_SHARE, MOST_LACKING = 20.0, 0.9


@dataclass(frozen=True, eq=False)
class Refit:
    """A linear fit to one force level: stiffness (m,) of the joints, swing (hits, m) in rad."""

    plain: Fit
    stiffness: np.ndarray
    swing: np.ndarray


def base(recorded: Dataset, nominal: Simulation) -> Fit:
    """The springs that fit best with the stated inertias, by logarithms.

    A full fit would bend inertias until they imitate what is not linear, and does not come back.
    """
    problem = problem_of(recorded, nominal)
    rough = problem.misfit(Effect(""), GLANCE)
    found = minimise(rough, rough.mean, 1e-4, LOG_STEPS)
    misfit = problem.misfit(Effect(""), FINE)
    return Fit(Effect(""), misfit, found.x, misfit.by_pose(found.x))


def bases(recorded: Dataset, nominal: Simulation) -> Iterator[tuple[Problem, Fit]]:
    """Linear fits to the averages that laws may begin from, the most complete first.

    With all that is free where one looks closely; without what every robot's bearings give; and
    `base`. Which of them leads to the law that is there depends on how strong that is.
    """
    for as_built in (True, False):
        problem = problem_of(recorded, nominal, as_built=as_built)
        yield problem, fit(problem, Effect(""))
    yield problem_of(recorded, nominal), base(recorded, nominal)


def refits(recorded: Dataset, nominal: Simulation) -> tuple[Refit, ...]:
    """The linear fit to the hits of each force level, weakest level first."""
    out = []
    for level in range(len(recorded.level_n)):
        of_level = [
            replace(v, hits=tuple(h for h in v.hits if recorded.level(h) == level))
            for v in recorded.visits
        ]
        own = recorded.corrected(v for v in of_level if v.hits)
        plain = base(own, nominal)
        system, swings = system_of(plain), []
        for number, columns in enumerate(own.columns):
            for c in columns:
                s = 2j * np.pi * c.frequency_hz + c.rate_1_s
                swings.append(swing(receptances(system, number, s), c))
        stiffness = system.elasticity.stiffness[system.blocks]
        out.append(Refit(plain, stiffness, np.array(swings)))
    return tuple(out)


def starts_by_level(
    seen: Sequence[Refit], system: System, port: int, x: np.ndarray, own: int
) -> list[LawAtJoints]:
    """Every law (and sign of k) of a joint as springs tell it that follow the force level.

    Of strongly bent laws single hits tell no stiffness: while they ring it changes too much.
    """
    scale, out = float(system.elasticity.stiffness[system.blocks[port]]), []
    if not (most := telling(seen[-1].swing[:, port])):
        return []  # no hit swings it
    middle = float(np.log(most))
    for law in LAWS:
        for sign in (1, -1) if law.signed else (1,):
            moved = x.copy()
            moved[own], share, angle = begin(seen, law, sign, scale, port, middle, telling)
            nu = np.array([[sign * np.exp(share) if law.signed else share], [angle]])
            out.append(
                LawAtJoints(
                    law, 0 if law.signed else 1, np.array([port]), np.array([scale]),
                    np.array([middle]), moved, nu, system.slides[port : port + 1],
                )
            )  # fmt: skip
    return out


def begin(
    seen: Sequence[Refit],
    law: Law,
    sign: int,
    scale: float,
    joint: int,
    middle: float,
    swing_of: Callable[[np.ndarray], float] = np.median,
) -> tuple[float, float, float]:
    """ln of the joint's linear stiffness, ln share of k and ln a / e^middle that refits tell.

    `scale` in N·m/rad and `middle` (ln rad) are about where the stiffness and a lie; `swing_of`
    says by which of its hits' swings a level is told.
    """
    told = np.log([level.stiffness[joint] for level in seen])
    swings = np.array([swing_of(level.swing[:, joint]) for level in seen])
    most = np.log(MOST_LACKING if law.effect == "backlash" or sign < 0 else MOST_SHARE)

    sd = [LINEAR_SD, LAW_LOG_SHARE_SD, LAW_ANGLE_LOG_SD]

    def residual(v: np.ndarray) -> np.ndarray:
        linear, k, a = np.exp(v[0]), sign * scale * np.exp(v[1]), float(np.exp(middle + v[2]))
        each = [linear + k * faded(law, swing, a).real for swing in swings]
        off = (told - np.log(np.maximum(each, 1e-3 * linear))) / SPRING_SD
        prior = (v - [np.log(scale), LAW_LOG_SHARE, 0.0]) / sd
        return np.concatenate([off, prior])

    low = [np.log(scale) - 3, np.log(LEAST_SHARE), -6.0]
    high = [np.log(scale) + 3, most, 3.0]
    grid = [
        np.array([np.log(linear * scale), min(np.log(share), most - 0.01), np.log(a)])
        for linear in LINEAR
        for share in SHARES
        for a in ANGLES
    ]
    start = min(grid, key=lambda v: float(np.sum(residual(v) ** 2)))
    best = optimize.least_squares(residual, start, bounds=(low, high), max_nfev=20).x
    return float(best[0]), float(best[1]), float(best[2])
