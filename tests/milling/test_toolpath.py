"""Programs as paths: G-code and APT; the feed along them, seen at poses of a robot."""

import numpy as np
import pytest

from planner.errors import InputError
from planner.milling.cut import cuts_at, no_pose
from planner.milling.toolpath import read_toolpath
from tests.support.milling_cases import cut

GCODE = """%
N10 G21 G90 (a comment with X9)
G0 X0 Y0 Z5
G1 Z-1 F200 ; a plunge is no milling
X30 F900
G3 X40 Y10 I0 J10
G91
G1 Y20
G90 G0 Z50
X0 Y0
"""


def read(path, text, name="part.nc"):
    file = path / name
    file.write_text(text)
    return read_toolpath(file)


def length(path):
    return float(np.sum(np.linalg.norm(path.end - path.start, axis=1)))


def test_cutting_moves_of_g_code(tmp_path):
    path = read(tmp_path, GCODE)
    assert length(path) == pytest.approx(0.030 + np.pi / 2 * 0.010 + 0.020, rel=1e-3)
    assert path.start[0] == pytest.approx([0, 0, -0.001])
    assert path.end[-1] == pytest.approx([0.040, 0.030, -0.001])
    position, feed, names = path.points(4)
    assert position[0] == pytest.approx([length(path) / 8, 0, -0.001])
    assert feed[0] == pytest.approx([1, 0, 0])
    assert feed[-1] == pytest.approx([0, 1, 0])
    assert names[0] == "line 5 (1)"
    assert len(set(names)) == 4


@pytest.mark.parametrize("arc", ["G2 X10 Y10 I10 J0", "G2 X10 Y10 R10", "G2 X10 Y10 J0 I10"])
def test_arcs_by_centre_or_radius(tmp_path, arc):
    """A quarter clockwise from (0, 0) about (10, 0): it bulges to the upper left."""
    path = read(tmp_path, f"G21 G1 X0 Y0 Z0\n{arc}\n")
    assert length(path) == pytest.approx(np.pi / 2 * 0.010, rel=1e-3)
    middle = path.end[len(path.end) // 2 - 1]
    assert np.linalg.norm(middle[:2] - [0.010, 0.0]) == pytest.approx(0.010, rel=1e-6)
    assert middle[1] > middle[0]


def test_a_full_circle_and_inches(tmp_path):
    path = read(tmp_path, "G20 G1 X0 Y0 Z0\nG3 X0 Y0 I1 J0\n")
    assert length(path) == pytest.approx(2 * np.pi * 0.0254, rel=2e-3)


def test_apt_with_one_tool_axis(tmp_path):
    text = "UNITS/MM\nRAPID\nGOTO/0,0,50,0,1,0\n$$ note\nGOTO/0,0,0,0,1,0\n"
    path = read(tmp_path, text + "GOTO/10,$\n0,0\nGODLTA/5,0,5\n", "part.apt")
    assert path.spindle == pytest.approx([0, 1, 0])
    assert path.end[-1] == pytest.approx([0.015, 0, 0.005])
    assert length(path) == pytest.approx(0.050 + 0.010 + np.sqrt(50) * 1e-3)


@pytest.mark.parametrize(
    ("text", "name", "told"),
    [
        ("G90 G1 X0 Y0 Z0\nX10\n", "a.nc", "G21"),
        ("G21 G1 X0 Y0 Z0 A0\nX10 A5\n", "a.nc", "A turns the tool's axis"),
        ("G21 G1 X0 Y0 Z0\nG81 X5 Z-2 R1\n", "a.nc", "drilling cycle"),
        ("G21 G1 X0 Y0 Z0\nG92 X5\n", "a.nc", "moves the frame"),
        ("G21 G1 X0 Y0 Z0\nG2 X5\n", "a.nc", "centre or radius"),
        ("G21 G1 X0 Y0 Z0\nG2 X5 R1\n", "a.nc", "radius joins its ends"),
        ("G21 G0 X0 Y0 Z0\nG1 Z-5\n", "a.nc", "no cutting moves"),
        ("G21 G1 X0 Y0 Z0\nX99999999999\n", "a.nc", "no coordinate"),
        ("", "a.nc", "no cutting moves"),
        ("UNITS/MM\nGOTO/0,0,0,0,0,1\nGOTO/9,0,0,0,0.1,0.99\n", "a.apt", "turns"),
        ("GOTO/0,0,0\nGOTO/9,0,0\n", "a.apt", "UNITS"),
        ("UNITS/MM\nGOTO/0,0\n", "a.apt", "3 or 6"),
        ("UNITS/MM\nGOTO/0,b,0\n", "a.apt", "no number"),
    ],
)
def test_what_is_no_plain_path_is_said_in_a_sentence(tmp_path, text, name, told):
    with pytest.raises(InputError, match=told) as error:
        read(tmp_path, text, name)
    assert len(str(error.value).splitlines()) == 1


NAMES = ("a", "b", "c")
AXIS = (0.0, 0.0, -1.0)


def turned(angles_deg):
    c, s, one = *(f(np.deg2rad(angles_deg)) for f in (np.cos, np.sin)), np.ones(len(angles_deg))
    return np.moveaxis(np.array([[c, -s, 0 * c], [s, c, 0 * c], [0 * c, 0 * c, one]]), -1, 0)


def test_a_feed_in_the_base_frame_turns_against_the_tcp():
    """The tcp turned by 90° about z sees a feed along x along its own −y."""
    given = cut(feed=(1.0, 0.0, 0.3), feed_in="base", axis=AXIS)
    found = cuts_at(given, turned([0, 90, 180]), np.zeros((3, 3)), NAMES)
    wanted = [(1, 0, 0), (0, -1, 0), (-1, 0, 0)]
    assert np.array([one.feed for one in found]) == pytest.approx(np.array(wanted), abs=1e-12)
    assert {one.feed_in for one in found} == {"frf"}
    for one, turn in zip(found, turned([0, 90, 180]), strict=True):
        assert turn @ one.plane[0] == pytest.approx([1, 0, 0], abs=1e-12)


def test_a_feed_along_the_path():
    position = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0]])
    given = cut(feed_in="path", axis=AXIS)
    found = cuts_at(given, turned([0, 0, 0]), position, NAMES)
    half = np.sqrt(0.5)
    wanted = np.array([(1, 0, 0), (half, half, 0), (0, 1, 0)])
    assert np.array([one.feed for one in found]) == pytest.approx(wanted)


def test_what_has_no_direction_is_refused():
    plunge = cut(feed=(0.0, 0.0, 1.0), feed_in="base", axis=AXIS)
    with pytest.raises(InputError, match="along the tool's axis"):
        cuts_at(plunge, turned([0]), np.zeros((1, 3)), ("a",))
    along = cut(feed_in="path", axis=AXIS)
    with pytest.raises(InputError, match="one pose"):
        cuts_at(along, turned([0]), np.zeros((1, 3)), ("a",))
    with pytest.raises(InputError, match="along the tool's axis, or there is none"):
        cuts_at(along, turned([0, 0, 0]), np.zeros((3, 3)), NAMES)
    with pytest.raises(InputError, match="how the robot stands"):
        no_pose(along, "frfs.npz")
