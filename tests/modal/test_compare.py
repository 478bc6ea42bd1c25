"""Laws of MAC."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from planner.modal.mac import mac

numbers = st.floats(-1e3, 1e3).filter(lambda x: x == 0 or abs(x) > 1e-3)
shapes = st.builds(
    lambda r, i: r + 1j * i, arrays(float, 3, elements=numbers), arrays(float, 3, elements=numbers)
).filter(lambda s: np.any(s != 0))


@given(shapes, shapes)
def test_mac_is_between_zero_and_one(a, b):
    assert 0.0 <= mac(a, b) <= 1.0
    assert abs(mac(a, b) - mac(b, a)) < 1e-12
    assert abs(mac(a, a) - 1.0) < 1e-12


@given(shapes, shapes, st.floats(1e-3, 1e3), st.floats(0, 6.3))
def test_mac_ignores_scale_and_phase(a, b, scale, phase):
    assert abs(mac(a * scale * np.exp(1j * phase), b) - mac(a, b)) < 1e-9
