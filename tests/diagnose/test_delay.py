"""A delay of the channels is found whether it turns the phase by little or by a whole turn."""

from dataclasses import replace

import numpy as np
import pytest

from planner.dataset.dataset import Dataset
from planner.diagnosis.screens import artefacts
from planner.dynamics.simulation import Simulation
from planner.recording.records import Hit
from planner.robot.robot import Robot
from tests.support.known_robots import KR10
from tests.support.synthetic_hits import RATE_HZ, recorded


def late(hit: Hit, delay_s: float) -> Hit:
    n = len(hit.force_n)
    turn = np.exp(-2j * np.pi * np.fft.rfftfreq(n, 1 / RATE_HZ) * delay_s)
    moved = np.fft.irfft(np.fft.rfft(hit.acceleration_m_s2) * turn, n)
    return replace(hit, acceleration_m_s2=moved)


@pytest.mark.parametrize("delay_s", [0.8e-3, 7e-3])
def test_a_delay_is_measured(tmp_path, delay_s):
    simulation = Simulation(Robot.load(KR10.write(tmp_path / "robot")))
    plain = recorded(simulation, KR10.poses(4, 3))
    visits = (replace(v, hits=tuple(late(h, delay_s) for h in v.hits)) for v in plain.visits)
    found = artefacts.screen(Dataset.of_visits(tuple(visits), plain.band_hz), simulation)
    assert [f.effect for f in found] == ["channel_delay"]
    value, sd, unit = found[0].parameters["delay"]
    assert unit == "s"
    assert value == pytest.approx(delay_s, abs=4 * sd)
    assert sd < 1e-4


def test_no_delay_where_there_is_none(tmp_path):
    simulation = Simulation(Robot.load(KR10.write(tmp_path / "robot")))
    assert artefacts.screen(recorded(simulation, KR10.poses(4, 3)), simulation) == ()
