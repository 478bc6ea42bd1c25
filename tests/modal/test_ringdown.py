"""Free decays: exact without noise, within their intervals with it, faults named."""

from pathlib import Path

import numpy as np
import pytest

from planner.errors import InputError, RefusedError
from planner.modal.free_decays import analyse_record
from planner.recording.records import Channel, TimeRecord
from tests.support.decays import ringdown

RATE = 500.0


def decay(n: int, frequency: float, zeta: float, amplitude: complex) -> np.ndarray:
    w = 2 * np.pi * frequency
    pole = -zeta * w + 1j * w * np.sqrt(1 - zeta**2)
    return np.real(amplitude * np.exp(pole * np.arange(n) / RATE))


@pytest.mark.parametrize("n", [501, 700])
def test_truncated_decays_are_exact(n):
    """Neither the end of the record nor the sampling biases anything."""
    samples = decay(n, 12.0, 0.004, 1.0) + decay(n, 12.3, 0.008, 0.5j) + decay(n, 41.0, 0.001, -0.2)
    found = sorted(ringdown(samples, RATE, (5.0, 60.0)), key=lambda d: d.frequency_hz)
    assert [d.frequency_hz for d in found] == pytest.approx([12.0, 12.3, 41.0], rel=1e-7)
    assert [d.damping_ratio for d in found] == pytest.approx([0.004, 0.008, 0.001], rel=1e-5)
    assert [d.amplitude for d in found] == pytest.approx([1.0, 0.5, 0.2], rel=1e-5)


def test_intervals_of_decays_cover_the_truth():
    scores = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        clean = decay(800, 14.0, 0.01, 1.0) + decay(800, 30.0, 0.005, 0.5j)
        found = ringdown(clean + 0.05 * rng.normal(size=(2, 800)), RATE, (5.0, 60.0))
        for frequency, zeta in ((14.0, 0.01), (30.0, 0.005)):
            best = min(found, key=lambda d: abs(d.frequency_hz - frequency))
            scores.append((best.frequency_hz - frequency) / best.frequency_sd_hz)
            scores.append((best.damping_ratio - zeta) / best.damping_sd)
    assert 0.88 < np.mean(np.abs(scores) < 1.96) < 0.99


def test_noise_holds_no_decay():
    rng = np.random.default_rng(0)
    assert ringdown(rng.normal(size=600), RATE, (5.0, 60.0)) == ()
    assert ringdown(np.zeros(600), RATE, (5.0, 60.0)) == ()
    assert ringdown(rng.normal(size=20), RATE, (5.0, 60.0)) == ()


def struck(hits: tuple[int, ...] = (100, 2600), n: int = 5200, dead: bool = False) -> TimeRecord:
    """Two modes after every hit, in three channels, and the hammer in volts."""
    rng = np.random.default_rng(1)
    shape = np.array([[1.0, 0.5], [0.7, -1.0], [-0.4, 0.8]])
    force, x = 0.002 * rng.normal(size=n), 0.01 * rng.normal(size=(3, n))
    for size, hit in enumerate(hits, 1):
        force[hit] += size
        modes = np.stack([decay(n - hit, 8.0, 0.01, size), decay(n - hit, 21.0, 0.006, 1j * size)])
        x[:, hit:] += shape @ modes
    if dead:
        x[1] = 0.05 * np.cumsum(rng.normal(size=n))
    channels = [Channel(f"A{k}", "acceleration", "m/s^2", 0, x[k]) for k in range(3)]
    channels.append(Channel("HAMMER", "voltage", "V", 0, force))
    return TimeRecord(Path("struck.csv"), RATE, tuple(channels))


@pytest.mark.parametrize("hits", [(100,), (100, 2600)])
def test_modes_after_hits(hits):
    model, _ = analyse_record(struck(hits), band_hz=(3.0, 50.0))
    assert [m.frequency_hz for m in model.modes] == pytest.approx([8.0, 21.0], rel=1e-3)
    assert [m.damping_ratio for m in model.modes] == pytest.approx([0.01, 0.006], rel=0.05)
    for mode, shape in zip(model.modes, ([1.0, 0.7, -0.4], [0.5, -1.0, 0.8]), strict=True):
        expected = np.array(shape) / np.linalg.norm(shape)
        assert np.abs(np.vdot(expected, mode.shape)) > 0.999
        assert np.all(np.isnan(mode.residue))
    assert any("under-sampled" in remark for remark in model.remarks)


def test_dead_sensor_is_named_and_left_out():
    model, _ = analyse_record(struck(dead=True), band_hz=(3.0, 50.0))
    assert [m.frequency_hz for m in model.modes] == pytest.approx([8.0, 21.0], rel=1e-3)
    assert any("Sensor A1" in remark for remark in model.remarks)
    assert all(mode.shape.shape == (2,) for mode in model.modes)


def test_unknown_force_channel_is_an_input_error():
    with pytest.raises(InputError, match="no channel 'X'"):
        analyse_record(struck(), force_channel="X")


def test_record_without_oscillation_is_refused():
    rng = np.random.default_rng(2)
    channel = Channel("A", "acceleration", "m/s^2", 0, rng.normal(size=3000))
    with pytest.raises(RefusedError, match="no decaying oscillation"):
        analyse_record(TimeRecord(Path("noise.csv"), RATE, (channel,)))


def test_mode_that_changes_with_amplitude_is_one_mode():
    """A decay with friction-like amplitude dependence is told as one mode, with a remark."""
    t = np.arange(6000) / RATE
    rng = np.random.default_rng(3)
    rate = 0.6 + 2.0 * np.exp(-t / 0.6)  # decay rate falls as the amplitude does
    phase = 2 * np.pi * np.cumsum(9.0 - 0.25 * np.exp(-t / 0.6)) / RATE
    wave = np.exp(-np.cumsum(rate) / RATE) * np.cos(phase)
    x = np.outer([1.0, 0.6, -0.5], wave) + 0.002 * rng.normal(size=(3, t.size))
    channels = tuple(Channel(f"A{k}", "acceleration", "m/s^2", 0, x[k]) for k in range(3))
    model, _ = analyse_record(TimeRecord(Path("friction.csv"), RATE, channels), band_hz=(4, 20))
    assert len(model.modes) == 1
    assert model.modes[0].frequency_hz == pytest.approx(9.0, rel=0.02)
    assert any("depends on amplitude" in remark for remark in model.remarks)
