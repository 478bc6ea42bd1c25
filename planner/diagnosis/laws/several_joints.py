"""One law at several joints at once, as of drives that all harden: fitted to the hits in time."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.dataset.dataset import Dataset
from planner.diagnosis.laws.equivalent_stiffness import system_of
from planner.diagnosis.laws.fit_in_time import LawProblem, descended, misfits
from planner.diagnosis.laws.law_at_joints import LawAtJoints, LawMisfit
from planner.diagnosis.laws.level_data import (
    LAID,
    LevelData,
    level_data,
    own_parameter,
)
from planner.diagnosis.laws.level_refits import Refit, begin
from planner.diagnosis.laws.one_joint_response import strokes
from planner.diagnosis.laws.open_misses import OpenMisses
from planner.diagnosis.laws.torque_laws import LEAST_SHARE, Law
from planner.diagnosis.linear.fit import Fit
from planner.inference.least_squares import Damping

FINER, LASTS_S = 2, 0.7  # steps a sample, and how long hits are followed
LEAST_LEFT = 0.05  # of a spring
STILL = 1e-12  # rad or m, of a joint that no hit swings
# Each round takes seconds: few of them, and damping that is raised fast where a step fails.
ROUNDS, GAIN = 5, 0.03  # of a descent at most, and what a round must gain of the value
DAMPING = Damping(first=1e-4, least=0.0, most=9.0, lighter=0.1, heavier=30.0)


def problem_of_levels(
    recorded: Dataset, plain: Fit, misses: OpenMisses | None = None
) -> LawProblem:
    """What laws are fitted to, and judged by; `misses` are as in `level_data`."""
    places = [(n, c) for n, group in enumerate(recorded.columns_at(LAID)) for c in group]
    hits = strokes([n for n, _ in places], [c for _, c in places], FINER, LASTS_S)
    return LawProblem(level_data(recorded, plain, misses), plain, hits)


def beginning(refits: Sequence[Refit], law: Law, sign: int, plain: Fit) -> LawAtJoints:
    """Where the refits of force levels say that the law lies."""
    system = system_of(plain)
    scale = system.elasticity.stiffness[system.blocks]
    middle = np.log(np.maximum(np.median(refits[-1].swing, axis=0), STILL))
    x = np.mean([level.plain.x for level in refits], axis=0)
    nu = np.zeros((2, len(scale)))
    for j, block in enumerate(system.blocks):
        own = own_parameter(plain, int(block))
        x[own], *nu[:, j] = begin(refits, law, sign, float(scale[j]), j, float(middle[j]))
    return LawAtJoints(law, sign, np.arange(len(scale)), scale, middle, x, nu, system.slides)


def softened(data: LevelData, share: float) -> LevelData:
    """With errors of a share of the FRFs besides: so that fits find their way from afar."""
    square = np.abs(data.h) ** 2 + np.where(data.weaker, np.abs(data.h[data.best]) ** 2, 0.0)
    error = 1 / np.maximum(data.weight, 1e-300) + share**2 * square
    return replace(data, weight=np.where(data.weight > 0, 1 / error, 0.0))


def settled(problem: LawProblem, law: LawAtJoints, softness: Sequence[float]) -> LawMisfit:
    """Where the descent ends, errors being taken as softened by one share after the other."""
    at = LawMisfit(law)
    for share in softness:
        now = replace(problem, data=softened(problem.data, share))
        at = descended(now, at.law, ROUNDS, GAIN, DAMPING)
        if not np.isfinite(at.value):
            break
    return at


def straightened(plain: Fit, at: LawMisfit, joint: int) -> LawAtJoints:
    """With a spring in the stead of one joint's law, as stiff as that was in the mean."""
    law = at.law
    assert at.stiffer is not None
    own = own_parameter(plain, int(system_of(plain).blocks[joint]))
    x, nu = law.x.copy(), law.nu.copy()
    added = float(np.median(at.stiffer[:, joint])) / float(np.exp(x[own]))
    x[own] += np.log(max(1 + added, LEAST_LEFT))
    nu[0, joint] = np.log(LEAST_SHARE)
    return replace(law, x=x, nu=nu)


def differences(problem: LawProblem, law: LawAtJoints) -> tuple[float, float, float]:
    """Of the weaker hits' differences to the strongest: χ² with and without the law, and values."""
    data = problem.data
    found = misfits(problem, [law])[0]
    weaker = data.weaker[:, 0, 0]
    count = float(np.count_nonzero(data.weight[weaker]))
    before = float(np.sum(data.chi2(data.compared(data.h))[weaker]))
    if found.residual is None:
        return np.inf, before, count
    return float(np.sum(data.chi2(found.residual)[weaker])), before, count
