"""Free decays: exact without noise, within their intervals with it, faults named; real records."""

from pathlib import Path

import numpy as np
import pytest

from planner.errors import InputError, RefusedError
from planner.modal.free_decays import analyse_record, identify_decays
from planner.modal.modes import Mode
from planner.recording.read import read
from planner.recording.records import Channel, TimeRecord

RATE = 500.0
# Three-storey frame: what was reported of it.
REPORTED_HZ = (2.17, 6.89, 13.26)
FRAME = ("imp_ham_set1_nomass.CSV", "imp_ham_set2_nomass.CSV", "imp_ham_set3_no_mass.CSV")
# Beam on a moving roller (DROPBEAR): pin location (V) and first mode (Hz), as its README has them.
FIRST_MODE = {1.645: 28.23, 2.081: 30.82, 2.502: 33.89, 2.933: 37.56, 3.365: 41.97}


def amplitude(mode: Mode, samples: int, rate_hz: float) -> float:
    """The largest of all channels at the first of so many samples: x ≈ Re(A e^{λt})."""
    # Σ_k A/2 p^k z^{-k} over n samples = A/2 (1 − pⁿ) z/(z − p) at the lines of the DFT.
    return float(np.max(np.abs(2 * mode.residue / (1 - np.exp(mode.pole * samples / rate_hz)))))


def ringdown(samples: np.ndarray, rate_hz: float, band_hz: tuple[float, float]) -> list[Mode]:
    """Free decays in a band of samples (n,) or (channels, n), greatest energy ∫x² dt first."""
    free = np.atleast_2d(np.asarray(samples, float))[:, None, :]
    found = identify_decays(free, rate_hz, band_hz)
    modes = found.modes if found else ()

    def energy(mode: Mode) -> float:
        square = amplitude(mode, free.shape[-1], rate_hz) ** 2
        return square / (mode.damping_ratio * mode.frequency_hz)

    inside = (mode for mode in modes if band_hz[0] <= mode.frequency_hz <= band_hz[1])
    return sorted(inside, key=energy, reverse=True)


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
    assert [amplitude(d, n, RATE) for d in found] == pytest.approx([1.0, 0.5, 0.2], rel=1e-5)


def test_intervals_of_decays_cover_the_truth():
    scores = []
    for seed in range(30):
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
    assert ringdown(rng.normal(size=600), RATE, (5.0, 60.0)) == []
    assert ringdown(np.zeros(600), RATE, (5.0, 60.0)) == []
    assert ringdown(rng.normal(size=20), RATE, (5.0, 60.0)) == []


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
    model, _ = analyse_record(struck(hits), "HAMMER", band_hz=(3.0, 50.0))
    assert [m.frequency_hz for m in model.modes] == pytest.approx([8.0, 21.0], rel=1e-3)
    assert [m.damping_ratio for m in model.modes] == pytest.approx([0.01, 0.006], rel=0.05)
    for mode, shape in zip(model.modes, ([1.0, 0.7, -0.4], [0.5, -1.0, 0.8]), strict=True):
        expected = np.array(shape) / np.linalg.norm(shape)
        assert np.abs(np.vdot(expected, mode.shape)) > 0.999
        assert np.all(np.isnan(mode.residue))
    assert any("under-sampled" in remark for remark in model.remarks)


def test_dead_sensor_is_named_and_left_out():
    model, _ = analyse_record(struck(dead=True), "HAMMER", band_hz=(3.0, 50.0))
    assert [m.frequency_hz for m in model.modes] == pytest.approx([8.0, 21.0], rel=1e-3)
    assert any("Sensor A1" in remark for remark in model.remarks)
    assert all(mode.shape.shape == (2,) for mode in model.modes)


def test_unknown_force_channel_is_an_input_error():
    with pytest.raises(InputError, match="no channel 'X'"):
        analyse_record(struck(), "X")


def hit_first(name: str, *channels: Channel) -> TimeRecord:
    """A record that begins with a hit."""
    force = Channel("HAMMER", "voltage", "V", 0, np.eye(2, channels[0].samples.size)[1])
    return TimeRecord(Path(name), RATE, (*channels, force))


def test_record_without_oscillation_is_refused():
    rng = np.random.default_rng(2)
    channel = Channel("A", "acceleration", "m/s^2", 0, rng.normal(size=3000))
    with pytest.raises(RefusedError, match="no decaying oscillation"):
        analyse_record(hit_first("noise.csv", channel), "HAMMER")


def test_mode_that_changes_with_amplitude_is_one_mode():
    """A decay with friction-like amplitude dependence is told as one mode, with a remark."""
    t = np.arange(6000) / RATE
    rng = np.random.default_rng(3)
    rate = 0.6 + 2.0 * np.exp(-t / 0.6)  # decay rate falls as the amplitude does
    phase = 2 * np.pi * np.cumsum(9.0 - 0.25 * np.exp(-t / 0.6)) / RATE
    wave = np.exp(-np.cumsum(rate) / RATE) * np.cos(phase)
    x = np.outer([1.0, 0.6, -0.5], wave) + 0.002 * rng.normal(size=(3, t.size))
    channels = (Channel(f"A{k}", "acceleration", "m/s^2", 0, x[k]) for k in range(3))
    model, _ = analyse_record(hit_first("friction.csv", *channels), "HAMMER", (4, 20))
    assert len(model.modes) == 1
    assert model.modes[0].frequency_hz == pytest.approx(9.0, rel=0.02)
    assert any("depends on amplitude" in remark for remark in model.remarks)


@pytest.mark.parametrize("name", FRAME)
def test_three_modes_and_the_faults(shared_data, name):
    (record,) = read(shared_data / "imphammer_mit" / name)
    assert isinstance(record, TimeRecord)
    model, _ = analyse_record(record, "CH8")
    found = [mode.frequency_hz for mode in model.modes]
    for frequency in REPORTED_HZ:
        assert min(abs(f / frequency - 1) for f in found) < 0.02
    # The three strongest supported modes are those and no others.
    surest = sorted(model.modes, key=lambda mode: -mode.probability)[:3]
    assert sorted(m.frequency_hz for m in surest) == pytest.approx(REPORTED_HZ, rel=0.02)
    text = " ".join(model.remarks)
    assert "under-sampled" in text
    assert "Sensor CH6" in text


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
