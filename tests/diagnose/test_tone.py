"""A tone sounds on; a resonance that changes with the force dies away, though it stands still."""

from dataclasses import replace

import numpy as np
import pytest

from planner.dataset.dataset import Dataset
from planner.diagnosis.screens.tone import screen_tone
from planner.dynamics.simulation import Simulation
from planner.robot.robot import Robot
from tests.support.known_robots import KR210
from tests.support.synthetic_hits import RATE_HZ, recorded

TONE_HZ, SIZE = 17.3, 0.3  # of the weakest hit's rms response


@pytest.fixture(scope="module")
def simulation(tmp_path_factory):
    return Simulation(Robot.load(KR210.write(tmp_path_factory.mktemp("robot"))))


@pytest.fixture(scope="module")
def poses():
    """Close together, so that resonances stay where they are."""
    return KR210.poses(1, 3) + 0.01 * np.random.default_rng(1).standard_normal((4, 6))


def sounding(plain: Dataset) -> Dataset:
    """The same with a tone whose phase no hit knows."""
    rng = np.random.default_rng(5)
    weak = [h for v in plain.visits for h in v.hits if not plain.level(h)]
    size = SIZE * float(np.mean([np.sqrt(np.mean(h.acceleration_m_s2**2)) for h in weak]))
    visits = []
    for visit in plain.visits:
        hits = []
        for hit in visit.hits:
            t = np.arange(len(hit.force_n)) / RATE_HZ
            wave = np.cos(2 * np.pi * TONE_HZ * t + rng.uniform(0, 2 * np.pi))
            hits.append(replace(hit, acceleration_m_s2=hit.acceleration_m_s2 + size * wave))
        visits.append(replace(visit, hits=tuple(hits)))
    return plain.corrected(visits)


def test_a_tone_is_named_by_its_frequency(simulation, poses):
    found = screen_tone(sounding(recorded(simulation, poses)))
    assert found is not None
    assert found.effect == "unknown"
    assert found.parameters["frequency"][0] == pytest.approx(TONE_HZ, abs=0.4)


def test_a_resonance_that_depends_on_the_force_is_no_tone(simulation, poses):
    first = np.array([b.joint == "joint_1" for b in simulation.robot.config.compliance])

    def softer(visit: int, level: int) -> np.ndarray:
        return 1.0 - 0.15 * level * first

    assert screen_tone(recorded(simulation, poses, softer)) is None


def test_recordings_that_agree_hold_no_tone(simulation, poses):
    assert screen_tone(recorded(simulation, poses)) is None
