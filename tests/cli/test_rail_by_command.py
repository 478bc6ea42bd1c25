"""An arm on a rail, by command: millimetres in and out, modes known where nothing was measured."""

import json
import re
import shutil

import numpy as np
import pytest

from planner.cli.run import run
from planner.truth.deviation import Deviation
from planner.truth.hits import Hammer, record_poses, write_predict
from planner.truth.load import load_truth
from tests.support.rails import RAIL_BOX, make_sliding, sliding_campaign

HAMMER = Hammer(80.0, 0.006, 400.0, 2.56, noise=0.01)
COUNT = 3


def answer(capsys, *args):
    code = run([*map(str, args), "--json"])
    said = capsys.readouterr()
    assert code == 0, said.err
    return json.loads(said.out)


def internal(stated):
    return np.array([1e-3 * stated[0], *np.deg2rad(stated[1:])])


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """A campaign with two measured poses; the true robot is not quite as stated."""
    root = tmp_path_factory.mktemp("rail")
    toml = make_sliding(root / "robot")
    truth = load_truth(toml, Deviation(3, stiffness=0.15, damping=0.2))
    plan, cell = sliding_campaign(root / "campaign.toml"), root / "cell"
    assert run(["new", str(cell), "--robot", str(toml), "--campaign", str(plan), "--json"]) == 0
    poses = [("A", internal((300.0, 20.0, -20.0))), ("B", internal((1250.5, -35.0, 30.0)))]
    hits = record_poses(truth, poses, root / "hits", repeats=2, hammer=HAMMER, seed=1)
    assert run(["import", str(cell), str(hits), "--json"]) == 0
    return cell, truth, root


def test_the_log_and_answers_say_the_units(cell, capsys):
    folder, _, _ = cell
    first = json.loads((folder / "log.jsonl").read_text().splitlines()[0])
    assert first["entry"]["event"]["joint_units"] == ["mm", "deg", "deg"]
    told = answer(capsys, "status", folder)
    assert told["joint_units"] == ["mm", "deg", "deg"]
    assert told["measurements"][1]["joints_deg"] == pytest.approx([1250.5, -35, 30], abs=0.2)
    told = answer(capsys, "next", folder)
    assert told["joint_units"] == ["mm", "deg", "deg"]
    (proposal,) = told["proposals"]
    for value, (low, high) in zip(proposal["joints_deg"], RAIL_BOX, strict=True):
        assert low <= value <= high
    assert run(["next", str(folder)]) == 0
    assert "rail (mm)" in capsys.readouterr().out
    told = answer(capsys, "check", folder / "robot" / "robot.toml")
    assert told["joint_units"] == ["mm", "deg", "deg"]
    assert told["poses"][1]["joints_deg"][0] > 100.0


def test_what_another_acquisition_would_propose_is_said_with_units(cell, capsys):
    folder, _, _ = cell
    told = answer(capsys, "replay", folder, "--acquisition", "variance")
    rail, *angles = next(p for s in told["steps"] for p in s["instead"])["joints_deg"]
    assert run(["replay", str(folder), "--acquisition", "variance"]) == 0
    said = re.sub(r"[\s│]+", "", capsys.readouterr().out)
    assert f"{rail:.0f}mm,{angles[0]:.0f}°," in said  # the rest is on the next line


def test_a_pose_that_was_imported_elsewhere_on_the_rail_is_told_in_millimetres(cell, capsys):
    folder, truth, root = cell
    moved = record_poses(truth, [("A", internal((500.0, 20.0, -20.0)))], root / "moved", repeats=1,
                         hammer=HAMMER, seed=4)  # fmt: skip
    assert run(["import", str(folder), str(moved)]) == 2
    said = capsys.readouterr().err
    assert re.search(
        r"imported before with a joint (199|200|201)\.\d+ mm away; if that was typed wrong", said
    )


def test_frequencies_at_unseen_poses(cell, capsys):
    folder, truth, root = cell
    rng = np.random.default_rng(8)
    unseen = [(f"H{k}", internal([rng.uniform(*ends) for ends in RAIL_BOX])) for k in range(6)]
    table = write_predict(root, truth.joint_names, unseen, slides=truth.slides)
    assert table.read_text().startswith("pose,rail_mm,turn_deg,lift_deg")
    told = answer(capsys, "predict", folder, table)
    for pose, (_, q) in zip(told["poses"], unseen, strict=True):
        hertz = [mode["frequency_hz"] for mode in pose["modes"]]
        assert hertz == pytest.approx(truth.modes(q, COUNT)[0], rel=0.01)
    with np.load(told["npz"]) as file:
        assert list(file["joint_units"]) == ["mm", "deg", "deg"]
        assert file["joints_deg"][0, 0] == pytest.approx(1e3 * unseen[0][1][0], abs=1e-3)


def test_replay_finds_the_same(cell, capsys):
    folder, _, _ = cell
    assert answer(capsys, "replay", folder)["reproduced"]


def test_a_pose_beyond_the_rail_is_refused_in_millimetres(cell, capsys):
    folder, _, root = cell
    table = root / "far.csv"
    table.write_text("pose,rail_mm,turn_deg,lift_deg\nA,2600,0,0\n")
    assert run(["predict", str(folder), str(table)]) == 2
    said = capsys.readouterr().err
    assert "rail at 2600.00 mm is outside its limits of -200.0 mm to 2000.0 mm" in said


def test_other_joints_than_at_the_beginning_must_not_slide(cell, capsys, tmp_path):
    """Places in the log would be read as angles."""
    folder, _, _ = cell
    other = tmp_path / "cell"
    shutil.copytree(folder, other)
    urdf = other / "robot" / "robot.urdf"
    text = urdf.read_text().replace("prismatic", "revolute")
    urdf.write_text(text.replace('upper="2.0"', 'upper="30"'))
    toml = other / "robot" / "robot.toml"
    text = toml.read_text().replace("stiffness_n_m", "stiffness")
    toml.write_text(text.replace("damping_n_s_m", "damping"))
    assert run(["next", str(other)]) == 2
    assert "other joints slide than when the campaign began" in capsys.readouterr().err
