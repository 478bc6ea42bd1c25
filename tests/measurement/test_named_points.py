"""Points that recordings name: by node, by column, by the table; and what is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.errors import InputError
from planner.recording.folder import read_recordings
from planner.recording.hits import hits_from, located
from planner.recording.named_columns import Named, to_records
from planner.recording.points import Dof, Layout, PointNames, StatedPoints, together
from planner.recording.records import Channel, FrfRecord, TimeRecord

NAMES = PointNames(
    {"elbow": "xyz", "base": "x", "flange": "xyz"},
    {"3": "elbow", "4": "base"},
    ("tcp", "flange"),
    ("sensor",),
)


def record(*responses: tuple[str, int], hit_node: str = "") -> TimeRecord:
    """A force and accelerations at nodes along directions."""
    samples = np.arange(1.0, 9.0)
    channels = [Channel("hammer", "force", "N", 1, samples, hit_node)]
    channels += [
        Channel(f"{node} {direction}", "acceleration", "m/s^2", direction, k * samples, node)
        for k, (node, direction) in enumerate(responses, 1)
    ]
    return TimeRecord(Path("a.uff"), 100.0, tuple(channels))


def test_nodes_of_several_sensors_become_points_in_their_own_axes() -> None:
    given = record(("4", -1), ("3", 2), ("3", 1), ("3", -3), hit_node="3")
    hit = hits_from([given], "+x", StatedPoints(names=NAMES))[0]
    assert hit.hit_point == "elbow"
    assert hit.layout == Layout(("elbow",), ("base", "elbow"))
    assert [str(d) for d in hit.responses] == ["base:x", "elbow:x", "elbow:y", "elbow:z"]
    assert hit.acceleration_m_s2[:, 0].tolist() == [-1.0, 3.0, 2.0, -4.0]
    assert hit.rows == [0, 3, 4, 5]
    assert hit.channels_of("base") is None
    alone = hit.channels_of("elbow")
    assert alone is not None
    assert alone.acceleration_m_s2[:, 0].tolist() == [3.0, 2.0, -4.0]


def test_a_file_of_one_sensor_is_the_tools_whatever_its_node() -> None:
    hit = hits_from([record(("7", 1), ("7", 2), ("7", 3), hit_node="9")])[0]
    assert hit.hit_point == "tcp"
    assert hit.responses == tuple(Dof("sensor", a) for a in "xyz")


ELBOW = PointNames({"elbow": "xyz"}, {"3": "elbow"})
TOOL_AT_2 = replace(NAMES, nodes={**NAMES.nodes, "2": "sensor"})


@pytest.mark.parametrize("names", [PointNames(), TOOL_AT_2])
def test_channels_at_nodes_of_no_point_are_left_out(names: PointNames) -> None:
    given = record(("2", 1), ("2", 2), ("2", 3), ("77", 3), ("78", 0))
    hit = hits_from([given], "+x", StatedPoints(names=names))[0]
    assert hit.responses == tuple(Dof("sensor", a) for a in "xyz")
    assert hit.acceleration_m_s2[:, 0].tolist() == [1.0, 2.0, 3.0]
    assert [fault.text for fault in hit.faults] == [
        "77 3 at node 77 is left out: that is no [[point]].",
        "78 0 at node 78 is left out: that is no [[point]].",
    ]
    assert not any(fault.refuse for fault in hit.faults)


def test_of_two_whole_sensors_none_is_left_out() -> None:
    given = record(*((node, axis) for node in ("2", "77") for axis in (1, 2, 3)))
    with pytest.raises(InputError, match="one acceleration in each"):
        hits_from([given], "+x")


def test_a_point_where_the_tool_is_hit_is_the_tcp() -> None:
    stated = StatedPoints("flange", ("elbow",), names=NAMES)
    hit = hits_from([record(("", 1), ("", 2), ("", 3))], "-x", stated)[0]
    assert (hit.hit_point, hit.layout.sensors, hit.axis) == ("tcp", ("elbow",), "-x")


def test_a_node_that_nobody_listed_is_that_of_the_stated_point_without_one() -> None:
    given = record(("8", 1), ("8", 2), ("8", 3), ("3", 1), hit_node="9")
    hit = hits_from([given], "+x", StatedPoints("tcp", ("flange", "elbow"), 5, NAMES))[0]
    assert (hit.hit_point, hit.layout.sensors) == ("tcp", ("flange", "elbow"))


@pytest.mark.parametrize(
    ("given", "stated", "names", "told"),
    [
        (record(("8", 1)), ("", ()), NAMES, "node 8, which is none of robot.toml"),
        (record(("3", 1)), ("", ("base",)), NAMES, "node 3, which is elbow, the tab"),
        (record(("4", 2)), ("", ()), NAMES, "along y at base, whose sensor has x "),
        (record(("", 1)), ("", ("base", "elbow")), NAMES, "which of base, elbow"),
        (record(("3", 1), hit_node="4"), ("elbow", ()), NAMES,
         "was hit at node 4, which is base, the table says elbow"),
        # An unknown node that may be the tool's.
        (record(("3", 1), hit_node="1"), ("", ()), ELBOW,
         '[[point]] (name = "tcp", node = 1, if it is the'),
        (record(("1", 1), hit_node="3"), ("", ()), ELBOW,
         '(name = "sensor", node = 1, if it is the'),
        (record(("2", 1), hit_node="1"), ("", ()), PointNames({"tcp": "xyz"}, {"2": "tcp"}),
         "add a [[point]]."),
    ],
)  # fmt: skip
def test_what_is_no_point_or_another_is_refused(
    given: TimeRecord, stated: tuple[str, tuple[str, ...]], names: PointNames, told: str
) -> None:
    with pytest.raises(InputError, match=r"^a\.uff \(row 5 of recordings\.csv\)") as refused:
        hits_from([given], "+x", StatedPoints(*stated, 5, names))
    assert told in str(refused.value)


def test_columns_name_points() -> None:
    time = np.arange(16) / 100
    columns = {"time_s": time, "force_n": time, "acceleration_elbow_y_m_s2": time}
    columns |= {"acceleration_fore_arm_z_m_s2": time}
    found = to_records(Path("a.csv"), Named(columns, {}, {"hit_point": "base", "hit": "+z"}))[0]
    assert isinstance(found, TimeRecord)
    told = [(c.node, c.direction) for c in found.channels]
    assert told == [("base", 3), ("elbow", 2), ("fore_arm", 3)]


def test_columns_of_frfs_between_points() -> None:
    lines = np.arange(1.0, 5.0)
    columns = {"frequency_hz": lines, "accelerance_elbow_y_base_x_re": lines}
    columns |= {"accelerance_elbow_y_base_x_im": 2 * lines}
    found = to_records(Path("a.csv"), Named(columns))[0]
    assert isinstance(found, FrfRecord)
    assert np.array_equal(found.values, [lines + 2j * lines])
    own = located(found, StatedPoints(names=NAMES))
    assert own.places == ((("elbow", 2), ("base", 1)),)


def test_layouts_are_joined_and_found_again() -> None:
    one, other = Layout(("tcp", "base"), ("sensor",)), Layout(("base", "base"), ("elbow",))
    whole = together([one, other])
    assert whole == Layout(("tcp", "base", "base"), ("sensor", "elbow"))
    assert whole.rows(other) == [3, 4, 5]
    assert whole.columns(other) == [3, 4, 5, 6, 7, 8]


def table(folder: Path, *cells: str) -> Path:
    """A recordings folder of one row, whose last cells are hit_point and response_points."""
    folder.joinpath("a.uff").write_text("x")
    header = "pose,j_deg,hit,file,hit_point,response_points\n"
    folder.joinpath("recordings.csv").write_text(f"{header}P1,0,+x,a.uff,{','.join(cells)}\n")
    return folder


def test_the_table_names_points(tmp_path: Path) -> None:
    row = read_recordings(table(tmp_path, "elbow", "base elbow"), ("j",), NAMES)[0]
    assert row.stated == StatedPoints("elbow", ("base", "elbow"), 2, NAMES)


@pytest.mark.parametrize(
    ("cells", "told"),
    [
        (("elbo", "base"), 'row 2: hit_point names "elbo", which is none of robot.toml'),
        (("elbow", "base rist"), 'row 2: response_points names "rist", which is none'),
        (("elbow", "base base"), "row 2: response_points names base twice"),
    ],
)
def test_a_table_that_names_no_point_is_refused(
    tmp_path: Path, cells: tuple[str, str], told: str
) -> None:
    with pytest.raises(InputError) as refused:
        read_recordings(table(tmp_path, *cells), ("j",), NAMES)
    assert told in str(refused.value)


@pytest.mark.parametrize("number", range(-6, 7))
def test_a_direction_number_comes_back(number: int) -> None:
    dof = Dof.of_uff(12, number)
    assert (dof.node, dof.number) == ("12", number)
    assert dof.positive.number == abs(number)
    assert dof.sign * dof.positive.number == number


def test_directions_are_spelled_by_axis_and_unknown_ones_refused() -> None:
    assert Dof.of_uff(7, -3) == Dof("7", "-z")
    assert str(Dof("P3", "y")) == "P3:y"
    assert [Dof.of_uff(1, number).is_turn for number in (2, 5)] == [False, True]
    for direction in ("w", "+x", "-scalar", ""):
        with pytest.raises(InputError, match="direction"):
            Dof("3", direction)
    with pytest.raises(InputError, match="direction 7"):
        Dof.of_uff(3, 7)
