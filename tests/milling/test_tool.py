"""What tool.toml may say, and what it is told where it says it wrong."""

import numpy as np
import pytest

from planner.errors import InputError
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
    assert shank.weight == pytest.approx(7850 * np.pi / 4 * (0.02**2 - 0.004**2) * 0.04)
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
    assert one.mass == pytest.approx(load_tool(written(tmp_path, GOOD)).mass + 0.01)
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
        ("length_m = 0.04", "length = 0.04", "write length_m"),
        ("length_m = 0.04", "length_mm = 40", "write length_m"),
        ("density_kg_m3 = 7850.0", "density = 7850.0", "write density_kg_m3"),
        ("stiffness_n_m = 5e7", "stiffness = 5e7", "write stiffness_n_m"),
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
