"""`planner modes --operating`: responses alone, a tone of a machine among them."""

import numpy as np
import pytest

from planner.modal.mac import mac
from planner.proof.recordings import uff_channel, write_sets
from tests.support.outside import only_told, refused
from tests.support.rerun_columns import lines_of
from tests.support.running import response
from tests.support.structures import plate

RATE_HZ, TONE_HZ = 640.0, 180.0
POINTS = [0, 5, 8, 15, 18, 23]
BAND = (30.0, 250.0)


@pytest.fixture(scope="module")
def structure():
    return plate(6, 4, ratio=(0.01, 0.01))


@pytest.fixture(scope="module")
def record(structure, tmp_path_factory):
    values = response(structure, POINTS, 100.0, RATE_HZ, np.random.default_rng(0))
    t = np.arange(values.shape[1]) / RATE_HZ
    values += np.std(values, axis=1, keepdims=True) * np.sin(2 * np.pi * TONE_HZ * t)
    sets = []
    for number, (point, samples) in enumerate(zip(POINTS, values, strict=True)):
        turned = -1 if number == 2 else 1
        felt = structure.nodes[point], 3 * turned
        sets.append(uff_channel(turned * samples, RATE_HZ, felt, (0, 0)))
    return write_sets(tmp_path_factory.mktemp("operating") / "running.uff", sets)


def test_modes_without_a_scale_and_the_tone_named(structure, record, tmp_path):
    drawn = "--plot", tmp_path, "--rrd", tmp_path / "modes.rrd"
    answer = only_told("modes", record, "--operating", "--band-hz", *BAND, *drawn)
    poles, shapes = structure.poles()
    hz, damping = np.abs(poles) / (2 * np.pi), -poles.real / np.abs(poles)
    inside = np.flatnonzero((hz > BAND[0]) & (hz < BAND[1]))
    assert len(answer["modes"]) == inside.size
    for k, mode in zip(inside, answer["modes"], strict=True):
        shape = np.array([complex(*value) for value in mode["shape"]])
        assert mode["frequency_hz"] == pytest.approx(hz[k], rel=3e-3)
        assert abs(mode["frequency_hz"] - hz[k]) < 4 * mode["frequency_sd_hz"]
        assert mode["damping_ratio"] == pytest.approx(damping[k], rel=0.25)
        assert mac(shape, shapes[POINTS, k]) > 0.98
        assert mode["scaled"] is False
    assert answer["dofs"] == [[structure.nodes[p], "z"] for p in POINTS]
    assert answer["scaled"] is False
    assert answer["tones_hz"] == [pytest.approx(TONE_HZ, rel=1e-3)]
    assert "UNSCALED" in " ".join(answer["remarks"])
    assert [path.rsplit("/", 1)[1] for path in answer["plots"]] == ["stabilisation.png", "mac.png"]
    lines = {f"/figures/stabilisation/0/singular_value_{k}" for k in (1, 2, 3)}
    assert lines <= set(lines_of(tmp_path / "modes.rrd"))


def test_two_files_are_refused(record):
    assert "one record at a time" in refused("modes", record, record, "--operating")
