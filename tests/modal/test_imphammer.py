"""Three-storey frame (real recording): its modes come out and its faults are named."""

import pytest

from planner.modal.free_decays import analyse_record
from planner.recording.read import read
from planner.recording.records import TimeRecord

REPORTED_HZ = (2.17, 6.89, 13.26)
FILES = ("imp_ham_set1_nomass.CSV", "imp_ham_set2_nomass.CSV", "imp_ham_set3_no_mass.CSV")


@pytest.mark.parametrize("name", FILES)
def test_three_modes_and_the_faults(shared_data, name):
    (record,) = read(shared_data / "imphammer_mit" / name)
    assert isinstance(record, TimeRecord)
    model, _ = analyse_record(record)
    found = [mode.frequency_hz for mode in model.modes]
    for frequency in REPORTED_HZ:
        assert min(abs(f / frequency - 1) for f in found) < 0.02
    # The three strongest supported modes are those and no others.
    surest = sorted(model.modes, key=lambda mode: -mode.probability)[:3]
    assert sorted(m.frequency_hz for m in surest) == pytest.approx(REPORTED_HZ, rel=0.02)
    text = " ".join(model.remarks)
    assert "under-sampled" in text
    assert "Sensor CH6" in text
