"""Laws of MAC and of the alignment of measured with expected modes."""

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from planner.modal.mac import mac
from planner.modal.modes import ModalModel, Mode
from tests.support.alignment import align

numbers = st.floats(-1e3, 1e3).filter(lambda x: x == 0 or abs(x) > 1e-3)
shapes = st.builds(
    lambda r, i: r + 1j * i, arrays(float, 3, elements=numbers), arrays(float, 3, elements=numbers)
).filter(lambda s: np.any(s != 0))
EXPECTED = np.array([7.0, 11.0, 20.0, 28.0, 41.0])


def mode(frequency: float, shape=(1.0, 0.0, 0.0), probability: float = 1.0) -> Mode:
    nothing = np.full((3, 3), np.nan)
    return Mode(
        float(frequency),
        0.01,
        0.02,
        0.001,
        nothing + 0j,
        nothing,
        np.array(shape, complex),
        probability,
    )


def model(frequencies) -> ModalModel:
    return ModalModel(tuple(mode(f) for f in frequencies), (4.0, 60.0), 0.0, 0)


@given(shapes, shapes)
def test_mac_is_between_zero_and_one(a, b):
    assert 0.0 <= mac(a, b) <= 1.0
    assert abs(mac(a, b) - mac(b, a)) < 1e-12
    assert abs(mac(a, a) - 1.0) < 1e-12


@given(shapes, shapes, st.floats(1e-3, 1e3), st.floats(0, 6.3))
def test_mac_ignores_scale_and_phase(a, b, scale, phase):
    assert abs(mac(a * scale * np.exp(1j * phase), b) - mac(a, b)) < 1e-9


@given(st.lists(st.floats(-0.05, 0.05), min_size=5, max_size=5), st.integers(0, 4))
@settings(max_examples=60)
def test_removing_one_measured_mode_removes_one_label(errors, gone):
    frequencies = EXPECTED * np.exp(errors)
    full = align(model(frequencies), EXPECTED, expected_sd=0.05)
    assert [m.frequency_hz for m in full.modes if m] == list(frequencies)
    rest = align(model(np.delete(frequencies, gone)), EXPECTED, expected_sd=0.05)
    assert rest.modes[gone] is None
    for k in range(5):
        if k != gone:
            kept = rest.modes[k]
            assert kept is not None
            assert kept.frequency_hz == frequencies[k]


@given(st.floats(4.0, 60.0))
@settings(max_examples=60)
def test_an_unexpected_mode_takes_no_foreign_label(extra):
    assume(np.min(np.abs(np.log(EXPECTED / extra))) > 0.12)
    found = align(model(np.sort(np.append(EXPECTED * 1.01, extra))), EXPECTED, expected_sd=0.03)
    assert [m.frequency_hz for m in found.modes if m] == list(EXPECTED * 1.01)


def test_shapes_decide_between_close_modes():
    expected = np.array([10.0, 10.3])
    shape = np.eye(3)[:2]
    only_y = ModalModel((mode(10.1, (0, 1, 0)),), (4.0, 60.0), 0.0, 0)
    found = align(only_y, expected, shape, 0.03)
    assert found.modes[0] is None
    assert found.modes[1] is not None
    assert found.probability[1] > 0.9


def test_probability_falls_where_labels_are_ambiguous():
    clear = align(model([10.0, 20.0]), np.array([10.0, 20.0]), expected_sd=0.05)
    vague = align(model([10.0]), np.array([9.9, 10.1]), expected_sd=0.05)
    assert np.min(clear.probability) > 0.95
    assert np.max(vague.probability) < 0.7
