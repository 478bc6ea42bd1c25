"""Transfer functions without scale or labels."""

from pathlib import Path

import numpy as np
import pytest

from planner.errors import InputError, RefusedError
from planner.frf.synthesis import accelerance, pole
from planner.modal.transfer_functions import modes_from_transfer_functions
from planner.recording.read import read
from planner.recording.records import End, FrfRecord

# Peaks picked by eye from the CMIF, below 2 kHz and above the suspension (6.7 and 9.2 Hz), and
# what else stands there: mains hum at 50, 150 and 250 Hz.
BY_EYE_HZ = (39.5, 108.5, 212, 353, 518, 551.5, 729, 825, 968, 1110, 1245, 1400, 1715)
HUM_HZ = (50, 150, 250)


def record(values: np.ndarray, lines: np.ndarray, quantity: str = "unknown") -> FrfRecord:
    nothing = np.full(values.shape, np.nan)
    places = ((End("", 0), End("", 0)),) * len(values)
    return FrfRecord(Path("some.mat"), lines, values, places, quantity, "", nothing)


def synthetic(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Twelve modes over six octaves, ten responses, 2 % noise."""
    frequency = np.geomspace(20, 1500, 12) * np.exp(rng.uniform(-0.1, 0.1, 12))
    lines = np.arange(4097) * 0.5
    poles = pole(frequency, rng.uniform(0.003, 0.02, 12))
    residues = rng.normal(size=(12, 10)) / poles.imag[:, None] * -1j
    values = accelerance(lines, poles, residues)
    noise = rng.normal(size=values.shape) + 1j * rng.normal(size=values.shape)
    return lines, values * (1 + 0.02 * noise), frequency


@pytest.mark.parametrize("seed", range(3))
def test_modes_over_many_octaves(seed):
    lines, values, true_hz = synthetic(np.random.default_rng(seed))
    modal = modes_from_transfer_functions(record(values, lines), "accelerance", (10, 1900))
    found = np.array([m.frequency_hz for m in modal.modes])
    near = np.abs(found / true_hz[:, None] - 1) < 0.005
    assert np.sum(near.any(axis=1)) >= 11
    assert np.sum(~near.any(axis=0)) <= 1


def test_the_quantity_must_be_known():
    lines, values, _ = synthetic(np.random.default_rng(0))
    with pytest.raises(InputError, match="--quantity"):
        modes_from_transfer_functions(record(values, lines))
    labelled = modes_from_transfer_functions(record(values, lines, "accelerance"), None, (10, 300))
    assert len(labelled.modes) >= 6


def test_noise_is_refused():
    rng = np.random.default_rng(0)
    values = rng.normal(size=(4, 2000)) + 1j * rng.normal(size=(4, 2000))
    with pytest.raises(RefusedError, match="stays put"):
        modes_from_transfer_functions(record(values, np.arange(2000) * 1.0), "mobility", (50, 1500))


def test_ruler_grid_against_peaks_picked_by_eye(shared_data):
    (frfs,) = read(shared_data / "ruler_grid" / "ruler_grid_acc_3.mat")
    assert isinstance(frfs, FrfRecord)
    first = frfs.frequency_hz[frfs.frequency_hz > 0][0]  # nothing uses the line at 0 Hz
    assert first == pytest.approx(0.6104, abs=1e-4)
    modal = modes_from_transfer_functions(frfs, "accelerance", (15.0, 2000.0))
    found = np.array([m.frequency_hz for m in modal.modes])
    peaks = np.array(BY_EYE_HZ)
    seen = np.abs(found / peaks[:, None] - 1) < 0.015
    assert np.all(seen[:7].any(axis=1))
    assert np.sum(seen.any(axis=1)) >= 10
    assert np.sum(~seen.any(axis=0)) <= 2
    assert not np.any(np.abs(found / np.array(HUM_HZ)[:, None] - 1) < 0.01)
