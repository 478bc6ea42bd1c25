"""What is handed on to other programs is what the campaign holds."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest
import pyuff
from scipy.io import loadmat

from planner.campaign.campaign import Campaign
from planner.errors import InputError
from planner.recording.folder import read_poses
from planner.recording.records import FrfRecord
from planner.recording.uff import read_uff
from planner.report.exports import KINDS, export
from planner.robot.controller_program import PoseToDrive, program
from planner.robot.robot import Robot
from tests.support.named_campaign import SCRIPT
from tests.support.outside import refused, said
from tests.support.robots import make_arm

HOSTILE = 'x"); popup("\nHALT\n'


def frfs_of(files: tuple[str, ...], kind: str) -> dict[str, FrfRecord]:
    """FRFs of the universal files whose names end so, read as recordings are."""
    return {Path(f).name: read_uff(Path(f))[0] for f in files if f.endswith(f"_{kind}.unv")}


def test_universal_files_read_back_as_they_were(named, tmp_path):
    found = export(named, "uff", tmp_path, None)
    measured = frfs_of(found.keys["files"], "measured")
    assert len(measured) == 2
    for record, m in zip(measured.values(), named.state.used, strict=True):
        assert isinstance(record, FrfRecord)
        frf = named.frf_of(m)
        assert (record.quantity, record.unit, record.simulated) == ("accelerance", "m/s^2/N", True)
        for k, ((_, i), (_, j)) in enumerate(record.places):
            np.testing.assert_allclose(record.values[k], frf.accelerance[i - 1, j - 1], rtol=1e-9)
            np.testing.assert_allclose(record.coherence[k], frf.coherence[i - 1, j - 1], rtol=1e-9)
        np.testing.assert_allclose(record.frequency_hz, frf.frequency_hz, rtol=1e-5)


def test_modes_are_dataset_55_that_others_read(named, tmp_path):
    files = [
        f for f in export(named, "uff", tmp_path, None).keys["files"] if f.endswith("_modes.unv")
    ]
    for file, m in zip(files, named.state.used, strict=True):
        sets = pyuff.UFF(file).read_sets()
        modes = [mode for mode in m.modes if mode.likely]
        assert len(modes) == len(sets) > 1
        for one, mode in zip(sets, modes, strict=True):
            assert abs(one["eig"]) == pytest.approx(2 * np.pi * mode.frequency_hz, rel=1e-4)
            assert -one["eig"].real / abs(one["eig"]) == pytest.approx(mode.damping_ratio, rel=1e-3)
            shape = np.array([complex(*v) for v in mode.shape])
            got = np.array([one["r1"][0], one["r2"][0], one["r3"][0]])
            np.testing.assert_allclose(got, shape, atol=1e-5)


def test_tables_and_mat_hold_the_same_numbers(named, tmp_path):
    export(named, "csv", tmp_path, None)
    mat = loadmat(export(named, "mat", tmp_path, None).keys["files"][0], simplify_cells=True)
    with (tmp_path / "modes.csv").open() as file:
        modes = list(csv.DictReader(file))
    used = named.state.used
    predicted = named.predict(joints_deg=[m.joints_deg for m in used])
    np.testing.assert_allclose(mat["mode_frequency_hz"], predicted.frequency_hz)
    rows = [r for r in modes if r["source"] == "predicted"]
    np.testing.assert_allclose([float(r["frequency_hz"]) for r in rows],
                               predicted.frequency_hz.ravel(), rtol=1e-8)  # fmt: skip
    assert {r["simulated"] for r in modes} == {"yes"}
    assert SCRIPT in {r["pose"] for r in modes}
    assert mat["measured"][1]["pose"] == used[1].pose
    with (tmp_path / "frfs.csv").open() as file:
        lines = [r for r in csv.DictReader(file) if r["source"] == "predicted"]
    first = complex(*(float(lines[0][f"{part}_m_s2_per_n"]) for part in ("real", "imag")))
    assert first == pytest.approx(mat["frf_mean"][0, 0, 0, 0], rel=1e-8)


def test_the_models_file_says_what_the_campaign_says(named, tmp_path, monkeypatch):
    found = export(named, "model", tmp_path, None)
    monkeypatch.chdir(tmp_path)
    script = next(f for f in found.keys["files"] if f.endswith(".py"))
    loaded: dict = {}
    exec(Path(script).read_text(), loaded)
    q = named.cell.candidates.q[7:12]
    places = named.cell.robot.forward_batch(q)[1][:, :2]
    hz, sd, damping = loaded["at"](places)
    expected = named.model.predict(q)
    assert np.median(np.abs(hz / expected.frequency_hz - 1)) < 1e-3
    np.testing.assert_allclose(hz, expected.frequency_hz, rtol=0.01)
    np.testing.assert_allclose(sd, expected.frequency_sd_hz, rtol=0.15)
    np.testing.assert_allclose(damping, expected.damping_ratio, rtol=0.05)
    assert max(found.keys["error_percent"]) < 0.2
    assert sum(Path(f).stat().st_size for f in found.keys["files"]) < 200_000


@pytest.fixture
def turned(tmp_path) -> Robot:
    """An arm whose controller counts axes 1 and 2 the other way round, one of them backwards."""
    toml = make_arm(tmp_path / "robot")
    table = (
        '[controller]\njoints = ["joint_a2", "joint_a1", "joint_a3", "joint_a4", "joint_a5", '
        '"joint_a6"]\nsigns = [1, -1, 1, 1, 1, 1]\noffsets_deg = [90, 0, 0, 0, 0, 0]\n'
    )
    toml.write_text(toml.read_text() + table)
    return Robot.load(toml)


def test_tables_in_the_controllers_axes_are_read_back(turned, tmp_path):
    angles, file = (10.0, -20.0, 30.0, -40.0, 50.0, -60.0), tmp_path / "poses.csv"
    file.write_text(program("poses", turned, "cell", [PoseToDrive("P1", angles)]))
    assert "A1_deg" in file.read_text()
    (row,) = read_poses(file, turned.joints)
    assert row.joints_deg == pytest.approx(angles)
    file.write_text(file.read_text().replace("_deg", ""))
    with pytest.raises(InputError, match="has no column joint_a1_deg and has A1, A2, "):
        read_poses(file, turned.joints)


def test_controllers_get_their_own_order_signs_and_offsets(turned):
    pose = PoseToDrive("P1", (10.0, -60.0, 30.0, 0.0, 45.0, -5.0))
    krl = program("krl", turned, "cell", [pose])
    assert "PTP {A1 30.0000, A2 -10.0000, A3 30.0000, A4 0.0000, A5 45.0000, A6 -5.0000}" in krl
    rapid = program("rapid", turned, "cell", [pose])
    assert "[[30.0000,-10.0000,30.0000,0.0000,45.0000,-5.0000],[9E9,9E9,9E9,9E9,9E9,9E9]]" in rapid
    ur = program("urscript", turned, "cell", [pose])
    assert "movej([d2r(30.0000), d2r(-10.0000)" in ur
    assert "P1,30.0000,-10.0000" in program("poses", turned, "cell", [pose])


@pytest.mark.parametrize("kind", ["krl", "rapid", "urscript", "poses"])
def test_names_are_no_commands(kind, turned):
    poses = [PoseToDrive(HOSTILE, (0.0,) * 6, (HOSTILE,)), PoseToDrive(HOSTILE, (1.0,) * 6)]
    clean = program(kind, turned, "cell", [PoseToDrive("P1", (0.0,) * 6, ("x",)),
                                           PoseToDrive("P2", (1.0,) * 6, ("x",))])  # fmt: skip
    text = program(kind, turned, HOSTILE, poses)
    assert len(text.splitlines()) == len(clean.splitlines())
    assert text.count('"') == clean.count('"')
    names = re.findall(r"jointtarget (\w+):=", text)
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("kind", ["krl", "rapid", "urscript", "poses"])
def test_programs_say_what_nobody_checked_and_what_is_simulated(kind, tmp_path):
    toml = make_arm(tmp_path / "robot")
    pose = [PoseToDrive("P1", (0.0,) * 6)]
    checked = program(kind, Robot.load(toml), "cell", pose)
    urdf = toml.parent / "arm.urdf"
    urdf.write_text(re.sub(r"<collision>.*?</collision>", "", urdf.read_text()))
    lines = program(kind, Robot.load(toml), "cell", pose)
    assert "Not all was checked for collision" in lines
    toml.write_text(toml.read_text().partition("[[obstacle]]")[0])
    bare = program(kind, Robot.load(toml), "cell", pose, simulated=True)
    assert "Nothing was checked for collision" in bare
    assert "SIMULATED RECORDINGS" in bare
    assert "Only the poses" not in bare
    assert not re.search("Nothing was checked|Not all was checked", checked)
    assert "SIMULATED" not in checked
    assert ("Only the poses" in checked) == (kind != "poses")


def test_a_pose_named_by_hand_that_touches_something_is_not_driven_to(named, tmp_path):
    here = named.state.used[0].joints_deg
    floor = (-5.0, -20.0, 137.0, -100.0, 18.0, -125.0)
    rows, file = ["pose", *named.cell.robot.joints.columns], tmp_path / "poses.csv"
    free, low = (",".join([name, *map(str, q)]) for name, q in (("free", here), ("low", floor)))
    command = "export", named.directory, "krl", "--poses", file, "--out", tmp_path
    file.write_text("\n".join([",".join(rows), free, ""]))
    said(*command)
    file.write_text("\n".join([",".join(rows), free, low, ""]))
    err = refused(*command)
    assert "poses.csv, row 3: at low" in err
    assert " touches " in err


@pytest.mark.parametrize(
    ("table", "words"),
    [('joints = ["joint_a1"]', "each of"), ("signs = [1]", "one a joint"),
     ("signs = [2, 1, 1, 1, 1, 1]", "signs"), ('external = ["rail"]', "no joint"),
     ("speed_percent = 0", "speed_percent")],
)  # fmt: skip
def test_a_wrong_controller_table_is_refused(table, words, tmp_path):
    toml = make_arm(tmp_path / "robot")
    toml.write_text(toml.read_text() + f"[controller]\n{table}\n")
    with pytest.raises(InputError, match=words):
        program("krl", Robot.load(toml), "cell", [PoseToDrive("P1", (0.0,) * 6)])


def test_open_proposals_are_driven_to(named, tmp_path):
    other = Campaign(named.directory)
    if not other.state.open:
        other.next()
    proposal = other.next()[0]
    said("export", named.directory, "krl", "--out", tmp_path)
    (file,) = tmp_path.glob("*.src")
    assert f"A1 {proposal.joints_deg[0]:.4f}" in file.read_text()
    err = refused("export", named.directory, "docx")
    assert all(kind in err for kind in KINDS)
