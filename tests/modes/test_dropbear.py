"""Beam on a moving roller: first mode of every dwell from its ring-down (real recording)."""

import numpy as np
import pytest

from planner.recording.read import read
from planner.recording.records import TimeRecord
from tests.support.decays import ringdown

# Pin location (V) and first mode (Hz), as the shared data's README states them.
FIRST_MODE = {1.645: 28.23, 2.081: 30.82, 2.502: 33.89, 2.933: 37.56, 3.365: 41.97}


def dwells(pin: np.ndarray, rate_hz: float) -> list[slice]:
    """Stretches of half a second or more in which the pin stands still."""
    smooth = np.convolve(pin, np.ones(100) / 100, "same")
    span = int(0.05 * rate_hz)
    still = np.zeros(pin.size, bool)
    still[span // 2 : pin.size - span + span // 2] = np.abs(smooth[span:] - smooth[:-span]) < 0.02
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(int), [0]])))
    pairs = zip(edges[::2], edges[1::2], strict=True)
    return [slice(a, b) for a, b in pairs if b - a > 0.5 * rate_hz]


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
