"""An elastic model that several threads use at once, as a session and its diagnosis do."""

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from planner.robot.elastic_model import ElasticModel
from planner.robot.robot import Robot
from planner.truth.arms import KR10


@pytest.fixture
def often():
    """Threads take turns as often as they can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.mark.parametrize("gravity", [False, True])
def test_threads_may_share_an_elastic_model(tmp_path, often, gravity):
    path = KR10.write(tmp_path, 2)
    if not gravity:
        path.write_text("geometric_stiffness = false\n" + path.read_text())
    model = ElasticModel(Robot.load(path))
    poses = [KR10.poses(3, seed) for seed in range(200)]

    def matrices(q: np.ndarray) -> tuple[np.ndarray, ...]:
        found = model.matrices(q)
        return found.mass, found.hit, found.sensor, found.geometric, model.body_jacobians(q)

    with ThreadPoolExecutor(2) as pool:
        shared = list(pool.map(matrices, poses))
    for alone, there in zip(map(matrices, poses), shared, strict=True):
        for one, other in zip(alone, there, strict=True):
            assert np.array_equal(one, other)
