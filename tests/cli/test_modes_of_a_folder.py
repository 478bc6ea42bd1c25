"""`planner modes FOLDER`: every pose of recordings.csv, labelled over poses, with its Campbell."""

import numpy as np
import pytest

from planner.demo import shipped
from planner.recording.folder import TABLE
from tests.support.outside import call, part_of, refused, told
from tests.support.robots import make_arm


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three poses of the shipped recordings."""
    poses, target = ("A21", "A22", "A23"), tmp_path_factory.mktemp("some") / "recordings"
    return part_of(shipped("kr240_plane") / "recordings", target, poses)


@pytest.mark.parametrize("robot", [True, False])
def test_every_pose_and_its_labels(folder, tmp_path, robot):
    toml = shipped("kr240_plane") / "robot" / "robot.toml"
    options = ["--robot", str(toml)] if robot else []
    answer = told("modes", str(folder), "--plot", str(tmp_path / "plots"), *options)
    assert [pose["pose"] for pose in answer["poses"]] == ["A21", "A22", "A23"]
    rows = [{m["label"]: m["frequency_hz"] for m in pose["modes"]} for pose in answer["poses"]]
    table = np.array([[row[label] for label in (1, 2, 3, 4)] for row in rows])
    assert np.all(np.ptp(table, axis=0) / table.mean(axis=0) < 0.2)
    assert answer["plots"] == [str(tmp_path / "plots" / "campbell.png")]
    assert answer["simulated"]
    assert answer["modes"] == answer["poses"][0]["modes"]


def test_a_robot_with_other_joints_is_refused(folder, tmp_path):
    toml = make_arm(tmp_path)
    assert "joint_a1" in refused("modes", folder, "--robot", toml)


def test_a_folder_of_one_pose_is_that_pose(folder, tmp_path):
    one = part_of(folder, tmp_path / "one", ("A21",))
    answer = told("modes", str(one))
    files = told("modes", *(str(p) for p in sorted(one.glob("data/A21*"))))
    assert answer["modes"] == files["modes"]
    assert answer.keys() == files.keys()
    toml = str(shipped("kr240_plane") / "robot" / "robot.toml")
    labelled = told("modes", str(one), "--robot", toml)
    assert [pose["pose"] for pose in labelled["poses"]] == ["A21"]
    found = [mode["frequency_hz"] for mode in labelled["modes"]]
    assert found == pytest.approx([mode["frequency_hz"] for mode in answer["modes"]], rel=1e-3)


def test_poses_named_twice_in_scripts_that_fonts_lack(folder, tmp_path):
    """The robot stood still between two poses; their names draw no warning."""
    names = {"1": "\u59ff\u52bf", "2": "\U00012000 2"}  # by the number of the hit
    two = part_of(folder, tmp_path / "two", ("A21",))
    header, *rows = (line.split(",") for line in (two / TABLE).read_text().splitlines())
    rows = [[names[row[8]], *row[1:]] for row in rows if row[8] in names]
    (two / TABLE).write_text("\n".join(map(",".join, [header, *rows])), encoding="utf-8")
    code, out, err = call("modes", two, "--plot", tmp_path / "plots")
    assert (code, err) == (0, "")
    assert "Modes of 2 poses" in out
    assert "SIMULATED" in out.upper()
    assert (tmp_path / "plots" / "campbell.png").stat().st_size > 10_000


@pytest.mark.parametrize("option", [("--real",), ("--export", "files"), ("--operating",)])
def test_what_is_for_other_points_is_refused_for_hits_at_the_tool(folder, option):
    said = refused("modes", folder, *option)
    assert f"holds several poses; leave {option[0]} out." in said
    if option[0] != "--operating":
        hits = sorted((folder / "data").glob("A21_p?_1.uff"))
        assert "holds hits of one pose" in refused("modes", *hits, *option)
