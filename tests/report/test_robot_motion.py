"""Shapes of modes on a posed robot: of the simulation, and as measured at several sensors."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from planner.campaign import mode_motion
from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import accelerance
from planner.frf.frf import Frf
from planner.recording.points import Layout
from planner.robot.link_bodies import skeleton
from planner.robot.robot import Robot
from tests.support.arm_with_points import poses, write_arm

COUNT = 3
LAYOUT = Layout(("elbow", "tcp"), ("sensor", "shoulder", "elbow"))
HZ = np.linspace(4.0, 90.0, 700)


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    robot = Robot.load(write_arm(tmp_path_factory.mktemp("arm")))
    return robot, Simulation(robot), poses(1)[0]


def recorded(simulation, q, missing=()) -> tuple[Any, Any]:
    """What a test at all points gives without noise; `missing` rows were not heard."""
    matrices = simulation.elastic.matrices(q, layout=LAYOUT)
    h = accelerance(simulation.solved(matrices), HZ)[0]
    h[list(missing)] = np.nan
    empty = np.full(h.shape, np.nan)
    whole = Frf(HZ, h, empty, empty, (1,) * 6, (4.0, 90.0), layout=LAYOUT)
    modes = simulation.modes(q[None], simulation.elastic.size)
    labelled = [
        SimpleNamespace(
            pole=2 * np.pi * f * complex(-z, np.sqrt(1 - z * z)), frequency_hz=f, shape=None
        )
        for f, z in zip(modes.frequency_hz[0], modes.damping_ratio[0], strict=True)
    ]
    found = SimpleNamespace(modes=labelled)
    measured = SimpleNamespace(whole=whole, modal=found)
    return measured, SimpleNamespace(q=q, modes=(*labelled[:2], None))


@pytest.mark.parametrize("missing", [(), (3, 4, 5)])
def test_shapes_measured_at_several_sensors_are_those_of_the_simulation(arm, missing):
    """A direction that was not heard is left out."""
    robot, simulation, q = arm
    measured, pose = recorded(simulation, q, missing)
    seen = mode_motion.measured_shapes(robot, pose, measured)
    assert seen.names == ("sensor", "shoulder", "elbow")
    assert np.all(np.isnan(seen.motion[:, 1])) == bool(missing)
    layout = Layout(sensors=seen.names)
    _, there = mode_motion.simulated_shapes(simulation, q, skeleton(robot, q), layout, COUNT)
    mac = mode_motion.agreement(seen, there)
    assert np.all(np.diag(mac)[:2] > 0.9999)
    assert np.all(np.isnan(mac[2]))  # the third mode was not found
    matched = mode_motion.matched(seen, there).motion[:2]
    heard = np.isfinite(matched)
    assert np.allclose(matched[heard], there.motion[:2][heard], atol=0.02)


def test_links_move_as_rigid_bodies(arm):
    """To first order the distance of two points of a link stays; links stand sagged, by 1e-4."""
    robot, simulation, q = arm
    drawn = skeleton(robot, q)
    whole, there = mode_motion.simulated_shapes(simulation, q, drawn, Layout(), COUNT)
    assert np.allclose(np.max(np.linalg.norm(np.abs(whole.motion), axis=2), axis=1), 1.0)
    ends = [(drawn.place_m[a], drawn.place_m[b], whole.motion[:, a], whole.motion[:, b])
            for a, b in drawn.lines]  # fmt: skip
    ends.append((drawn.place_m[-1], there.place_m[0], whole.motion[:, -1], there.motion[:, 0]))
    for a, b, of_a, of_b in ends:
        stretch = (of_b - of_a) @ (b - a)
        assert np.max(np.abs(stretch)) < 1e-3 * float(np.linalg.norm(b - a))


def test_without_a_simulation_the_largest_measured_motion_is_one(arm):
    robot, simulation, q = arm
    measured, pose = recorded(simulation, q)
    seen = mode_motion.measured_alone(mode_motion.measured_shapes(robot, pose, measured))
    assert np.allclose(np.max(np.abs(seen.motion[:2]), axis=(1, 2)), 1.0)
    assert np.all(np.isnan(seen.motion[2]))
