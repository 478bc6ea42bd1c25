"""A delay is the analyser's: one that a single sensor shows is something else."""

import numpy as np
import pytest

from planner.diagnosis.screens.artefacts import Chain, _delay
from planner.diagnosis.thresholds import CLEAR
from planner.measurement.nuisances import Tolerances


def chain(sensor: str, delay_s: float, sd_s: float) -> Chain:
    return Chain(sensor, np.eye(3), 1e-6 * np.eye(9), delay_s, sd_s, 1.0, 500.0)


def test_sensors_that_agree_tell_it_better_than_one() -> None:
    alone = _delay([chain("sensor", 2e-3, 2e-4)], Tolerances())
    both = _delay([chain("sensor", 2e-3, 2e-4), chain("elbow", 2.1e-3, 2e-4)], Tolerances())
    assert (both.effect, both.at) == ("channel_delay", "sensor")
    assert both.parameters["delay"][0] == pytest.approx(2.05e-3, rel=1e-3)
    assert both.log_evidence > alone.log_evidence > CLEAR


def test_one_that_disagrees_makes_none() -> None:
    """As where a link bends: the shoulder alone seems late."""
    told = [chain("sensor", 0.0, 4.7e-4), chain("shoulder", 3.3e-3, 3.4e-4)]
    told += [chain("elbow", 1.6e-3, 4e-4), chain("foot", 0.0, 5e-3)]
    assert _delay(told, Tolerances()).log_evidence < CLEAR
    assert _delay(told[1:2], Tolerances()).log_evidence > CLEAR
