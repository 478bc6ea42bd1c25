"""Which springs are named beside a joint's law."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from planner.diagnosis.linear.problem import PRIORS
from planner.diagnosis.screens.implausible_springs import strayed
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import parametrise
from planner.robot.robot import Robot
from tests.support.known_robots import KR210


def named(tmp_path, away_sds: dict[str, float], per_value: float = 0.9) -> list[str]:
    """Joints named where these springs are so many prior sds off; joint_2 has the law."""
    simulation = Simulation(Robot.load(KR210.write(tmp_path / "robot")))
    p = parametrise(simulation, PRIORS)
    mean, sd = p.mean, p.log_sd
    x = mean.copy()
    for i, parameter in enumerate(p.parameters):
        for joint, away in away_sds.items():
            if parameter.name.startswith(f"stiffness of {joint} "):
                x[i] += away * sd[i]
    misfit = SimpleNamespace(
        parametrisation=p, setting=SimpleNamespace(simulation=simulation), mean=mean, sd=sd
    )
    plain = cast(Any, SimpleNamespace(misfit=misfit))
    found = strayed(plain, x, np.full(len(x), 0.01), "joint_2", per_value)
    return [f.at for f in found if f.at is not None]


def test_a_spring_far_off_is_named_that_of_the_law_too(tmp_path):
    assert named(tmp_path, {"joint_3": -4.0, "joint_5": 2.0}) == ["joint_3"]
    assert named(tmp_path, {"joint_2": -4.0}) == ["joint_2"]


def test_several_others_at_once_imitate_what_the_law_lacks(tmp_path):
    far = {"joint_3": -4.0, "joint_5": 5.0}
    assert named(tmp_path, far) == []
    assert named(tmp_path, {"joint_2": -4.0, **far}) == ["joint_2"]


def test_beside_a_law_that_does_not_fit_none_is_named(tmp_path):
    assert named(tmp_path, {"joint_3": -4.0}, per_value=4.0) == []
