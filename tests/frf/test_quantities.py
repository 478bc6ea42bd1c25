"""Receptance, mobility and accelerance: laws, a known oscillator, and what cannot be done."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.errors import InputError
from planner.frf.quantities import DERIVATIVE, convert

KINDS = st.sampled_from(sorted(DERIVATIVE))


def test_oscillator_of_known_mass_damping_and_stiffness():
    f = np.linspace(1.0, 60.0, 200)
    w, m, c, k = 2 * np.pi * f, 40.0, 300.0, 6e5
    receptance = 1 / (k - m * w**2 + 1j * c * w)
    # Force over motion instead, written out: dynamic mass and impedance.
    accelerance = 1 / (m + c / (1j * w) - k / w**2)
    mobility = 1 / (1j * w * m + c + k / (1j * w))
    np.testing.assert_allclose(convert(f, receptance, "receptance", "mobility"), mobility)
    np.testing.assert_allclose(convert(f, mobility, "mobility", "accelerance"), accelerance)
    np.testing.assert_allclose(convert(f, accelerance, "accelerance", "receptance"), receptance)


@settings(max_examples=30, deadline=None)
@given(KINDS, KINDS, KINDS, st.integers(0, 2**31))
def test_conversions_compose(a, b, c, seed):
    rng = np.random.default_rng(seed)
    f = np.sort(rng.uniform(0.5, 2000.0, 9))
    h = rng.normal(size=(2, 3, 9)) + 1j * rng.normal(size=(2, 3, 9))
    direct = convert(f, h, a, c)
    np.testing.assert_allclose(convert(f, convert(f, h, a, b), b, c), direct, rtol=1e-12)
    np.testing.assert_allclose(convert(f, direct, c, a), h, rtol=1e-12)


def test_what_cannot_be_converted_is_said():
    f, h = np.array([0.0, 1.0]), np.ones(2, complex)
    assert convert(f, h, "receptance", "accelerance")[0] == 0
    with pytest.raises(InputError, match="0 Hz of accelerance"):
        convert(f, h, "accelerance", "mobility")
    with pytest.raises(InputError, match="'compliance' is not known"):
        convert(f, h, "compliance", "mobility")
