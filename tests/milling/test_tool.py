"""What tool.toml may say; its beams against closed formulas, and what physics asks of any beam."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.errors import InputError
from planner.milling.beam import Section, Segment, ToolMaterial, transfer
from planner.milling.tool import load_tool

GOOD = """
to_spindle = [0.0, 0.0, -2.0]
[material.steel]
youngs_modulus_pa = 2.1e11
density_kg_m3 = 7850.0
poisson_ratio = 0.3
[[segment]]
material = "steel"
length_m = 0.04
diameter_m = 0.02
bore_m = 0.004
[segment.contact]
stiffness_n_m = 5e7
stiffness_nm_rad = 4e6
[[segment]]
material = "steel"
length_m = 0.03
diameter_m = 0.02
flutes = 4
"""


def written(path, text):
    file = path / "tool.toml"
    file.write_text(text)
    return file


def test_a_tool_as_stated(tmp_path):
    tool = load_tool(written(tmp_path, GOOD))
    shank, flutes = tool.parts
    assert tool.length == pytest.approx(0.07)
    assert tool.axis == (0.0, 0.0, 1.0)
    assert flutes.diameter == pytest.approx(0.016)  # Kops and Vo's 80 %
    assert shank.bore == 0.004
    assert tool.parts[0].contact is not None
    assert tool.parts[1].contact is None


def test_the_axis_of_older_files_means_what_it_meant(tmp_path):
    """From the holder to the tip; and so where a file says nothing."""
    for old in ("axis = [0.0, 0.0, 2.0]", ""):
        text = GOOD.replace("to_spindle = [0.0, 0.0, -2.0]", old)
        assert load_tool(written(tmp_path, text)).axis == (0.0, 0.0, 1.0)
    turned = load_tool(written(tmp_path, GOOD.replace("-2.0", "2.0")))
    assert turned.axis == (0.0, 0.0, -1.0)


def test_a_sensors_mass_sits_where_it_was_measured(tmp_path):
    """As a tool in two pieces whose lower one carries it."""
    points = "[[point]]\nnode = 7\nfrom_tip_m = 0.03\nsensor_mass_kg = 0.01\n"
    one = load_tool(written(tmp_path, GOOD + points))
    assert sum(part.mass for part in one.parts) == 0.01
    other = GOOD.replace("bore_m = 0.004", "bore_m = 0.004\nmass_kg = 0.01")
    omega = np.array([6000.0])
    expected = load_tool(written(tmp_path, other)).transfer(omega)
    assert one.transfer(omega) == pytest.approx(expected, rel=1e-9)


def test_a_section_within_a_tool(tmp_path):
    tool = load_tool(written(tmp_path, GOOD))
    assert tool.above(0.05).length == pytest.approx(0.05)
    assert tool.above(0.07).parts[0].contact is None  # that is below the section
    assert tool.above(0.0).parts == ()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("length_m = 0.04", "length = 0.04", '"length_m" may be meant'),
        ("length_m = 0.04", "length_mm = 40", '"length_m" may be meant'),
        ("density_kg_m3 = 7850.0", "density = 7850.0", '"density_kg_m3" may be meant'),
        ("stiffness_n_m = 5e7", "stiffness = 5e7", '"stiffness_n_m" may be meant'),
        ("length_m = 0.04", "length_m = -0.04", "segment 1: length_m is -0.04"),
        ("diameter_m = 0.02\nbore", "diameter_m = nan\nbore", "diameter_m is nan"),
        ("length_m = 0.04", "length_m = inf", "length_m is inf"),
        ("bore_m = 0.004", "bore_m = 0.02", "leaves nothing"),
        ("stiffness_n_m = 5e7", "stiffness_n_m = 0.0", "has to be above zero"),
        ("poisson_ratio = 0.3", "poisson_ratio = 0.7", "poisson_ratio"),
        ("flutes = 4", "flutes = -4", "flutes is -4"),
        (
            'material = "steel"\nlength_m = 0.04',
            'material = "tin"\nlength_m = 0.04',
            "material.tin",
        ),
        ("[0.0, 0.0, -2.0]", "[0.0, 0.0, 0.0]", "no direction"),
        ("to_spindle", "axis = [0.0, 0.0, 2.0]\nto_spindle", "leave axis out"),
        ("flutes = 4", "flutes = 4\nflute_length_m = 0.02", "flute_length_m"),
        ("flutes = 4", "flutes = 4\n[[point]]\nnode=1\nfrom_tip_m=0.2", "0.2 m from the tip"),
        (GOOD, "", "tool.toml"),
        (GOOD, "segment = []\nmaterial = {}", "no [[segment]]"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(tmp_path, old, new, words):
    file = written(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(InputError) as error:
        load_tool(file)
    assert words in str(error.value)
    assert str(file) in str(error.value)


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
    cone = (0.02**2 + 0.02 * 0.01 + 0.01**2) / 3 - 0.004**2
    mass = 0.05 + 7850 * np.pi / 4 * (0.03 * 0.02**2 + 0.02 * cone)
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
