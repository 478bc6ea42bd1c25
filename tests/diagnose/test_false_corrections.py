"""Corrections of the measuring chain that were none: recordings are looked at again as they are."""

import numpy as np

from planner.diagnosis.diagnose import explain
from planner.diagnosis.finding import Finding
from planner.diagnosis.screens import artefacts
from planner.dynamics.simulation import Simulation
from planner.progress import quietly
from planner.robot.robot import Robot
from tests.support.known_robots import KR210
from tests.support.synthetic_hits import recorded

FALSE = Finding("sensor_gain", "sensor_x", 99.0, {"gain": (1.5, 0.05, "1")}, sure=0.98)


def test_a_gain_that_the_explanation_only_takes_back_is_told_of_nothing(tmp_path, monkeypatch):
    simulation = Simulation(Robot.load(KR210.write(tmp_path)))
    plain = recorded(simulation, KR210.poses(2, 3), peaks_n=(300.0,))
    asked = []

    def screen(data, nominal, *, chain=True):
        asked.append(chain)
        return (FALSE,) if chain else ()

    monkeypatch.setattr(artefacts, "screen", screen)
    found = explain(plain, simulation, quietly)
    assert asked == [True, False]
    assert found.whole.verdict == "consistent"
    assert not found.whole.established
    was, now = (d.visits[0].hits[0].acceleration_m_s2 for d in (plain, found.recorded))
    np.testing.assert_array_equal(was, now)
