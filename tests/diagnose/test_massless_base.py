"""A base without <inertial>, as most URDFs have it, is no reason to give up a diagnosis."""

import itertools
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from planner.diagnosis.effects import library
from planner.diagnosis.effects.combined import Both
from planner.dynamics.simulation import Simulation
from planner.robot.massless_base import massless_base
from planner.robot.robot import Robot
from tests.support.plain_arm import make_plain_arm

Q = np.deg2rad([[20.0, -40.0, 50.0, 10.0]])
LINES = np.linspace(3.0, 60.0, 40)


@pytest.fixture(scope="module")
def simulation(tmp_path_factory) -> Simulation:
    """An arm whose joint 1 gives about two axes already, on a base without mass."""
    path = make_plain_arm(tmp_path_factory.mktemp("arm"))
    block = 'joint = "joint_1"\naxis = [0, 1, 0]\nstiffness = 6e4\ndamping = 20.0\n'
    path.write_text(f"{path.read_text()}[[compliance]]\n{block}")
    return Simulation(Robot.load(path))


def test_every_two_effects_can_be_there_together(simulation):
    soft = [e for e in library(simulation) if e.springs(simulation) and not e.absorbed]
    assert {"base_compliance", "transverse_compliance"} <= {e.name for e in soft}
    for a, b in itertools.combinations(soft, 2):
        if (a.name, a.at) != (b.name, b.at):
            _ = Both.of(a, b).structure(simulation).elastic


def test_the_little_mass_changes_no_frf(simulation):
    base = max(
        (e for e in library(simulation) if e.name == "base_compliance"),
        key=lambda e: len(e.springs(simulation)),
    )
    with_foot = base.structure(simulation)
    assert massless_base(with_foot.robot) == with_foot.robot.config.payload
    h = with_foot.accelerance(Q, LINES)
    [light] = with_foot.robot.config.payload
    assert light.mass < 1e-3
    twice = msgspec.structs.replace(with_foot.robot.config, payload=(light, light))
    heavier = Simulation(replace(with_foot.robot, config=twice))
    assert np.abs(heavier.accelerance(Q, LINES) - h).max() < 1e-4 * np.abs(h).max()


def test_a_base_that_has_a_mass_is_given_none(tmp_path):
    path = make_plain_arm(tmp_path)
    urdf = tmp_path / "plain.urdf"
    own = (
        '<link name="base_link"><inertial><mass value="30"/><inertia ixx="1" iyy="1" izz="1" '
        'ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )
    urdf.write_text(urdf.read_text().replace('<link name="base_link"/>', own))
    assert massless_base(Robot.load(path)) == ()
