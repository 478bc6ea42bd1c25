"""Beams of the tools against closed formulas, and what physics asks of any beam."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.milling.beam import Section, Segment, ToolMaterial, transfer

STEEL = ToolMaterial(2.1e11, 7850.0, 0.3)
LOSSY = ToolMaterial(5.4e11, 14500.0, 0.25, 0.002)
J = np.block([[np.zeros((6, 6)), np.eye(6)], [-np.eye(6), np.zeros((6, 6))]])


def rod(length, diameter, material=STEEL):
    return Segment(length, diameter, diameter, material)


def free_free(segments, omega):
    """Receptances (F, 12, 12) of tip, then holder's end, forces from outside at both."""
    t = transfer(segments, omega)
    uu, uf, fu, ff = t[:, :6, :6], t[:, :6, 6:], t[:, 6:, :6], t[:, 6:, 6:]
    # What the tip's side exerts on the holder is less what is exerted on the beam from there.
    tip_base = -np.linalg.inv(fu)
    tip_tip = tip_base @ ff
    return np.block([[tip_tip, tip_base], [uu @ tip_tip + uf, uu @ tip_base]])


def roots(value, omega):
    """Where a real function over omega changes its sign, by linear interpolation."""
    k = np.flatnonzero(np.diff(np.sign(value)))
    return omega[k] - value[k] * np.diff(omega)[k] / np.diff(value)[k]


@pytest.mark.parametrize("thick", [0.02, 0.1, 0.25])
def test_simply_supported_rod_has_timoshenkos_frequencies(thick):
    """Closed: (1 + …)ω² of Timoshenko's equation with sines (Weaver et al. 1990, 5.12)."""
    length = 0.1
    s, m = Section(thick * length, 0.0, STEEL), STEEL
    k = np.pi * 2 / length
    r2 = s.second_moment / s.area
    e, g = m.youngs_modulus_pa, s.shear_coefficient * m.youngs_modulus_pa / 2.6
    rho = m.density_kg_m3
    a, b, c = rho * r2 / g, -(1 + r2 * k**2 * (1 + e / g)), e * r2 * k**4 / rho
    expected = np.sqrt((-b - np.sqrt(b * b - 4 * a * c)) / (2 * a))
    omega = expected * np.linspace(0.9951, 1.005, 41)  # no line on the root itself
    t = transfer([rod(length, thick * length)], omega)
    supported = t[:, [0, 10]][:, :, [4, 6]]  # no motion, no moment at both ends
    assert roots(np.linalg.det(supported).real, omega) == pytest.approx([expected], rel=1e-6)


def test_far_below_its_modes_a_beam_moves_as_a_rigid_body():
    segments = [rod(0.03, 0.02), Segment(0.02, 0.02, 0.01, STEEL, bore=0.004, mass=0.05)]
    omega = np.array([2 * np.pi * 3.0])
    r = free_free(segments, omega)[0]
    mass = sum(s.weight for s in segments)
    assert r[2, 2] == pytest.approx(-1 / (mass * omega[0] ** 2), rel=1e-4)
    assert r[8, 2] == pytest.approx(r[2, 2], rel=1e-4)
    # A lever: the base follows the tip's motion and rotation.
    assert r[6] == pytest.approx(r[0] - 0.05 * r[4], rel=1e-3, abs=1e-6 * abs(r[0, 0]))


widths = st.floats(0.004, 0.04)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.floats(0.005, 0.05), widths, widths), min_size=1, max_size=4),
       st.floats(1.0, 5000.0), st.floats(0.0, 0.2))  # fmt: skip
def test_any_beam_is_reciprocal_and_takes_energy(pieces, frequency, mass):
    segments = [Segment(a, d, e, LOSSY, mass=mass) for a, d, e in pieces]
    omega = np.array([2 * np.pi * frequency])
    t = transfer(segments, omega)[0]
    size = np.sqrt(np.abs(np.diag(free_free(segments, omega)[0][:6, :6])))
    unit = np.diag(np.concatenate([size, 1 / size]))
    scaled = np.linalg.inv(unit) @ t @ unit
    norm = np.linalg.norm(scaled, 2) ** 2
    assert np.abs(scaled.T @ J @ scaled - J).max() < 1e-10 * norm
    r = free_free(segments, omega)[0]
    both = np.concatenate([size, size])
    lost = -(r - r.conj().T) / 2j / np.outer(both, both)
    assert np.linalg.eigvalsh(lost).min() > -1e-8 * np.abs(r / np.outer(both, both)).max()
