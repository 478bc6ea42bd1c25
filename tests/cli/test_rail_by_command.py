"""An arm on a rail, by command: millimetres in and out, modes known where nothing was measured."""

import json
import re
import shutil

import numpy as np
import pytest

from planner.proof.deviation import Deviation
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.proof.recordings import record_poses, write_predict
from tests.support.outside import refused, said, told
from tests.support.rails import RAIL_BOX, make_sliding, sliding_campaign

HAMMER = Hammer(80.0, 0.006, 400.0, 2.56, noise=0.01)
COUNT = 3


def internal(stated):
    return np.array([1e-3 * stated[0], *np.deg2rad(stated[1:])])


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """A campaign with two measured poses; the true robot is not quite as stated."""
    root = tmp_path_factory.mktemp("rail")
    toml = make_sliding(root / "robot")
    truth = load_truth(toml, Deviation(3, stiffness=0.15, damping=0.2))
    plan, cell = sliding_campaign(root / "campaign.toml"), root / "cell"
    told("new", cell, "--robot", toml, "--campaign", plan)
    poses = [("A", internal((300.0, 20.0, -20.0))), ("B", internal((1250.5, -35.0, 30.0)))]
    hits = record_poses(truth, poses, root / "hits", repeats=2, hammer=HAMMER, seed=1)
    told("import", cell, hits)
    return cell, truth, root


def test_the_log_and_answers_say_the_units(cell):
    folder, _, _ = cell
    first = json.loads((folder / "log.jsonl").read_text().splitlines()[0])
    assert first["entry"]["event"]["joint_units"] == ["mm", "deg", "deg"]
    answer = told("status", folder)
    assert answer["joint_units"] == ["mm", "deg", "deg"]
    assert answer["measurements"][1]["joints_deg"] == pytest.approx([1250.5, -35, 30], abs=0.2)
    answer = told("next", folder)
    assert answer["joint_units"] == ["mm", "deg", "deg"]
    (proposal,) = answer["proposals"]
    for value, (low, high) in zip(proposal["joints_deg"], RAIL_BOX, strict=True):
        assert low <= value <= high
    assert "rail (mm)" in said("next", folder)
    answer = told("check", folder / "robot" / "robot.toml")
    assert answer["joint_units"] == ["mm", "deg", "deg"]
    assert answer["poses"][1]["joints_deg"][0] > 100.0


def test_what_another_acquisition_would_propose_is_said_with_units(cell):
    folder, _, _ = cell
    told("next", folder)  # a pose that was proposed is needed
    answer = told("replay", folder, "--acquisition", "variance")
    rail, *angles = next(p for s in answer["steps"] for p in s["instead"])["joints_deg"]
    screen = re.sub(r"[\s│]+", "", said("replay", folder, "--acquisition", "variance"))
    assert f"{rail:.0f}mm,{angles[0]:.0f}°," in screen  # the rest is on the next line


def test_a_pose_that_was_imported_elsewhere_on_the_rail_is_told_in_millimetres(cell):
    folder, truth, root = cell
    moved = record_poses(truth, [("A", internal((500.0, 20.0, -20.0)))], root / "moved", repeats=1,
                         hammer=HAMMER, seed=4)  # fmt: skip
    away = r"imported before with a joint (199|200|201)\.\d+ mm away; if that was typed wrong"
    assert re.search(away, refused("import", folder, moved))


def test_frequencies_at_unseen_poses(cell):
    folder, truth, root = cell
    rng = np.random.default_rng(8)
    unseen = [(f"H{k}", internal([rng.uniform(*ends) for ends in RAIL_BOX])) for k in range(6)]
    table = write_predict(root, truth.joint_names, unseen, slides=truth.slides)
    assert table.read_text().startswith("pose,rail_mm,turn_deg,lift_deg")
    answer = told("predict", folder, table)
    for pose, (_, q) in zip(answer["poses"], unseen, strict=True):
        hertz = [mode["frequency_hz"] for mode in pose["modes"]]
        assert hertz == pytest.approx(truth.modes(q, COUNT)[0], rel=0.01)
    with np.load(answer["npz"]) as file:
        assert list(file["joint_units"]) == ["mm", "deg", "deg"]
        assert file["joints_deg"][0, 0] == pytest.approx(1e3 * unseen[0][1][0], abs=1e-3)


def test_replay_finds_the_same(cell):
    folder, _, _ = cell
    assert told("replay", folder)["reproduced"]


def test_a_pose_beyond_the_rail_is_refused_in_millimetres(cell):
    folder, _, root = cell
    table = root / "far.csv"
    table.write_text("pose,rail_mm,turn_deg,lift_deg\nA,2600,0,0\n")
    outside = "rail at 2600.00 mm is outside its limits of -200.0 mm to 2000.0 mm"
    assert outside in refused("predict", folder, table)


def test_other_joints_than_at_the_beginning_must_not_slide(cell, tmp_path):
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
    assert "other joints slide than when the campaign began" in refused("next", other)
