"""Where fits in time begin, from the equivalent stiffness that a law's hits have."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from planner.diagnosis.laws.equivalent_stiffness import Equivalent, telling
from planner.diagnosis.laws.level_refits import starts_by_level
from planner.diagnosis.laws.starting_values import faded, starts
from planner.diagnosis.laws.torque_laws import LAWS

SCALE, ANGLE = 1e5, 2e-4  # of the joint's stiffness in N·m/rad, at which the law bends in rad
SWING = ANGLE * np.array([[0.3, 1.5], [0.5, 2.0], [0.2, 1.0], [0.8, 2.5]])  # weak and strong hits


def system_of_one() -> Any:
    springs = SimpleNamespace(stiffness=np.array([SCALE]))
    ports = {"ports": ("joint_1",), "slides": ()}
    return SimpleNamespace(elasticity=springs, blocks=np.array([0]), **ports)


def begun(law, share):
    delta = share * SCALE * (faded(law, SWING[:, 0], ANGLE) - faded(law, SWING[:, 1], ANGLE))
    nothing, column = np.zeros(len(SWING)), np.ones((len(SWING), 1))
    found = Equivalent(
        nothing, nothing, nothing, SWING[:, :, None], delta[:, None], 1e2 * column,
        nothing, nothing, nothing, nothing,
    )  # fmt: skip
    return starts(found, system_of_one(), 0, np.array([np.log(SCALE)]), 0)


@pytest.mark.parametrize(
    ("law", "share"), [(LAWS[0], 0.8), (LAWS[0], -0.5), (LAWS[1], 0.6), (LAWS[2], 0.4)]
)
def test_a_law_is_begun_near_itself_and_from_several_angles(law, share):
    own = [one for one in begun(law, share) if one.kind is law and one.k[0] * share > 0]
    assert len({float(one.a[0]) for one in own}) >= 3
    assert min(abs(np.log(one.a[0] / ANGLE)) for one in own) < np.log(2)
    nearest = min(own, key=lambda one: abs(np.log(one.a[0] / ANGLE)))
    assert nearest.k[0] / SCALE == pytest.approx(share, rel=0.5)


@pytest.mark.parametrize(
    ("law", "share"), [(LAWS[0], 0.8), (LAWS[0], -0.5), (LAWS[1], 0.6), (LAWS[2], 0.4)]
)
def test_springs_that_follow_the_force_level_begin_a_law(law, share):
    """Most hits hardly swing the joint: of those that do, refits tell the stiffness."""
    levels = [0.2, 0.6, 1.8]
    seen = [
        SimpleNamespace(
            stiffness=SCALE * (1 + share * faded(law, np.array([level * ANGLE]), ANGLE).real),
            swing=level * ANGLE * np.concatenate([np.ones(3), np.full(20, 0.01)])[:, None],
        )
        for level in levels
    ]
    found = starts_by_level(cast(Any, seen), system_of_one(), 0, np.zeros(1), 0)
    (own,) = [one for one in found if one.kind is law and one.k[0] * share > 0]
    told = [
        np.exp(own.x[0]) + own.k[0] * faded(law, np.array([level * ANGLE]), own.a[0]).real[0]
        for level in levels
    ]
    assert told == pytest.approx([float(one.stiffness[0]) for one in seen], rel=0.05)


def test_the_swing_that_tells_is_that_of_the_few_that_swing():
    assert telling(np.concatenate([np.full(50, 1e-6), np.full(5, 3e-4)])) == 3e-4
    assert telling(np.full(4, 2e-5)) == 2e-5
