"""`planner modes FOLDER`: every pose, labelled, with its Campbell; pictures of what was found.

Files, a Rerun recording, and sentences for bad folders.
"""

import subprocess
import sys

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font

from planner.demo import shipped
from planner.recording.folder import TABLE
from planner.report.pictures import rendered
from tests.support.outside import call, part_of, refused, told
from tests.support.rerun_columns import entities_of
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


def test_folders_of_several_poses_are_not_averaged_as_one(folder, tmp_path):
    for name in ("A21", "A22"):
        part_of(folder, tmp_path / "deep" / name, (name,))
    assert "several poses (A21, A22)" in refused("modes", tmp_path / "deep")


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
    picture = tmp_path / "plots" / "campbell.png"
    assert str(picture) in "".join(out.split())
    assert picture.stat().st_size > 10_000


@pytest.mark.parametrize("option", [("--real",), ("--export", "files"), ("--operating",)])
def test_what_is_for_other_points_is_refused_for_hits_at_the_tool(folder, option):
    said = refused("modes", folder, *option)
    assert f"holds several poses; leave {option[0]} out." in said
    if option[0] != "--operating":
        hits = sorted((folder / "data").glob("A21_p?_1.uff"))
        assert "holds hits of one pose" in refused("modes", *hits, *option)


NAMES = ["stabilisation", "frf", "coherence", "mac"]


@pytest.fixture(scope="module")
def hits(first_pose_once):
    """Simulated hits at one pose."""
    return first_pose_once.files


def test_pictures_are_listed_and_told_to_rerun(hits, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    options = "--plot", "here", "--format", "svg", "--rrd", "sub/modes.rrd"
    answer = told("modes", *hits, *options)
    expected = [tmp_path / "here" / f"{name}.svg" for name in NAMES]
    assert answer["plots"] == [str(path) for path in expected]
    assert answer["rrd"] == str(tmp_path / "sub" / "modes.rrd")
    for path in expected:  # titles stand in an SVG as comments
        assert "SIMULATED recordings" in path.read_text()
        assert hits[0].name in path.read_text()
    drawn = entities_of(answer["rrd"])
    assert {f"/figures/{name}/frame" for name in NAMES} | {"/note"} <= drawn
    assert any(name.startswith("/figures/stabilisation/0/") for name in drawn)  # sharp lines


def test_without_a_wish_nothing_is_drawn(hits):
    answer = told("modes", *hits)
    assert (answer["plots"], answer["rrd"]) == ([], None)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--plot", "taken"), "taken is a file; name a folder"),
        (("--plot", "blocked"), "blocked"),
        (("--plot", ".", "--format", "pdf"), "give png or svg"),
        (("--rrd", "taken/below.rrd"), "taken/below.rrd"),
    ],
)
def test_a_place_that_cannot_be_written_is_said(hits, tmp_path, monkeypatch, options, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("a file")
    (tmp_path / "blocked" / "stabilisation.png").mkdir(parents=True)
    err = refused("modes", *hits, "--json", *options)
    assert words in err
    assert "failed inside" not in err


def test_free_decays_are_drawn_without_frfs(shared_data, tmp_path):
    path = shared_data / "imphammer_mit" / "imp_ham_set1_nomass.CSV"
    answer = told("modes", path, "--force", "CH8", "--plot", tmp_path, "--format", "svg")
    names = [tmp_path / f"{name}.svg" for name in ("stabilisation", "mac")]
    assert answer["plots"] == [str(name) for name in names]
    assert all("SIMULATED" not in name.read_text() for name in names)


def test_matplotlib_and_rerun_are_only_imported_for_pictures(hits):
    program = (
        "import sys; from planner.cli.run import run\n"
        "code = run(sys.argv[1:])\n"
        "loaded = {'matplotlib', 'rerun'} & set(sys.modules)\n"
        "sys.exit(f'{code}, {loaded}' if code or loaded else 0)"
    )
    for arguments in (["--help"], ["modes", *map(str, hits), "--json"]):
        done = subprocess.run(
            [sys.executable, "-c", program, *arguments], capture_output=True, text=True, timeout=60
        )
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("form", ["png", "svg"])
def test_characters_that_a_font_lacks_are_drawn_by_another(form):
    """Without a warning (they are errors here), also where no font has them."""
    figure = Figure()
    lacking = figure.text(0.1, 0.5, "\u0416 \U00012000", fontfamily="cmr10")
    assert rendered(figure, format=form)
    first, *others = lacking.get_fontfamily()
    assert first == "cmr10"
    assert any(0x416 in get_font(findfont(name)).get_charmap() for name in others)
