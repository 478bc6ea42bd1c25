"""Beam on a moving roller: first mode of every dwell from its ring-down (real recording)."""

import numpy as np
import pytest

from planner.recording.read import read
from planner.recording.records import TimeRecord
from tests.support.decays import ringdown
from tests.support.dropbear import FIRST_MODE, dwells


@pytest.mark.parametrize("number", range(5))
def test_first_mode_of_every_dwell(shared_data, number):
    (record,) = read(shared_data / "dropbear" / f"slow10_test{number}.txt.gz")
    assert isinstance(record, TimeRecord)
    assert record.sampling_rate_hz == pytest.approx(5000.0, rel=1e-3)
    acceleration, _, pin = (channel.samples for channel in record.channels[:3])
    seen = []
    for dwell in dwells(pin, record.sampling_rate_hz):
        volts = float(np.median(pin[dwell]))
        nearest = min(FIRST_MODE, key=lambda v: abs(v - volts))
        if abs(nearest - volts) > 0.05:
            continue  # the rest position, where nothing was struck or stated
        decays = ringdown(acceleration[dwell], record.sampling_rate_hz, (15.0, 60.0))
        assert decays, f"no mode at {volts:.3f} V"
        assert decays[0].frequency_hz == pytest.approx(FIRST_MODE[nearest], abs=0.5)
        seen.append(nearest)
    assert seen == [1.645, 2.081, 2.502, 2.933, 3.365, 2.933, 2.502, 2.081, 1.645]
