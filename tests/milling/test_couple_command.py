"""`planner couple`: the shipped example, files, a posture that was not hit; and what is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.campaign.posture_tip import posture_tip
from planner.errors import InputError
from planner.frf.matrix import FrfMatrix
from planner.frf.synthesis import pole
from planner.milling.tip_files import read_tip
from planner.milling.tool import load_tool
from planner.recording.points import Dof
from tests.support.matrix_files import write_matrix
from tests.support.outside import refused, told
from tests.support.rerun_columns import lines_of

LEI = Path(__file__).parents[2] / "campaigns" / "irb6660_lei2023"
PAIR = ["--tool", f"{LEI}/target.toml", "--reference", f"{LEI}/reference.toml"]


def refusal(tmp_path, *arguments):
    """What is said of arguments that make no sense."""
    return refused("couple", *arguments, "--out", tmp_path / "a.npz", "--json")


@pytest.fixture(scope="module")
def coupled(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lei")
    files = ["--out", folder / "new.npz", "--plot", folder, "--rrd", folder / "new.rrd"]
    return told("couple", LEI / "modes.toml", *PAIR, "--noise", 1, *files)


def test_the_shipped_example(coupled):
    """With that tool the paper heard chatter at 916 and 935 Hz; the rod peaks below 900 Hz."""
    high = [p for p in coupled["resonances"] if p["frequency_hz"] > 500]
    assert {p["direction"] for p in high} == {"x", "y"}
    assert all(880 < p["frequency_hz"] < 940 for p in high)
    assert max(p["frequency_hz"] for p in high) > 900
    assert coupled["motions"] == ["x", "y", "rx", "ry"]
    assert any("z" in remark for remark in coupled["remarks"])
    assert 1 < coupled["amplification"]["worst"] < 10
    assert Path(coupled["plots"][0]).stat().st_size > 10_000


def test_the_recording_has_charts_and_no_picture_of_one(coupled):
    found = lines_of(Path(coupled["rrd"]))
    tool = [entity for entity in found if "this_tool" in entity]
    assert len(tool) == 4  # hits along x and y, responses along both
    for entity in (*tool, "/figures/coupling/4/line_0"):
        places = np.concatenate(found[entity])
        assert len(places) > 100
        assert np.all(np.diff(places[:, 0]) >= 0)


def test_the_npz_is_laid_out_as_predicts(coupled):
    with np.load(coupled["npz"]) as stored:
        lines = stored["frequency_hz"]
        assert stored["frf_mean"].shape == stored["frf_sd"].shape == (1, 3, 3, len(lines))
        assert np.iscomplexobj(stored["frf_mean"])
        assert stored["amplification"].shape == lines.shape
        peak = coupled["resonances"][0]
        at = np.argmin(np.abs(lines - peak["frequency_hz"]))
        size = np.abs(stored["frf_mean"][0, 0, 0, at]) / (2 * np.pi * lines[at]) ** 2
        assert size == pytest.approx(peak["receptance_m_n"])


def test_what_was_coupled_can_be_coupled_again(coupled, tmp_path):
    """Back to the rod: its own modes come out."""
    back = ["--tool", LEI / "reference.toml", "--reference", LEI / "target.toml"]
    told("couple", coupled["npz"], *back, "--out", tmp_path / "back.npz")
    tip = read_tip(LEI / "modes.toml", None, None, 0.0)
    with np.load(tmp_path / "back.npz") as stored:
        found = stored["frf_mean"][0, :2, :2] / (2j * np.pi * stored["frequency_hz"]) ** 2
    assert found == pytest.approx(np.moveaxis(tip.receptance[:, :2, :2], 0, -1), rel=1e-6)


def exported(path, tip, nodes):
    """Two points of the rod as an analyser exports them: accelerance between all directions."""
    turn = {"x": np.array([1, 0, 0, 1.0]), "y": np.array([0, 1, -1.0, 0])}
    places = {
        Dof(str(node), d): turn[d] * np.array([1, 1, -distance, -distance])
        for node, distance in nodes for d in turn
    }  # fmt: skip
    ends, f = np.array(list(places.values())), tip.frequency_hz
    h = np.einsum("oa,fab,ib->oif", ends, tip.receptance, ends) * (2j * np.pi * f) ** 2
    dofs = tuple(places)
    return write_matrix(path, FrfMatrix(f, dofs, dofs, h, True))


def rod(path):
    points = "\n[[point]]\nnode = 1\nfrom_tip_m = 0.0\n[[point]]\nnode = 5\nfrom_tip_m = 0.02\n"
    file = path / "rod.toml"
    file.write_text((LEI / "reference.toml").read_text() + points)
    return file


@pytest.fixture(scope="module")
def few():
    from planner.campaign.cut_source import within

    tip = read_tip(LEI / "modes.toml", None, None, 0.0)
    return within(tip, (800.0, 1000.0), LEI)


def test_two_points_of_a_universal_file(few, tmp_path):
    """Points that move rigidly: but for the rod's own bending of 0.02 m, the modes' answer."""
    exported(tmp_path / "frfs.uff", few, ((1, 0.0), (5, 0.02)))
    tools = ["--tool", LEI / "target.toml", "--reference", rod(tmp_path)]
    answer = told("couple", tmp_path / "frfs.uff", *tools, "--out", tmp_path / "a.npz")
    band = "--band-hz", 800, 1000, "--out", tmp_path / "b.npz"
    other = told("couple", LEI / "modes.toml", *PAIR, *band)
    for one, two in zip(answer["resonances"], other["resonances"], strict=True):
        assert one["frequency_hz"] == pytest.approx(two["frequency_hz"], rel=0.005)


def test_a_missing_point_is_named(few, tmp_path):
    exported(tmp_path / "one.uff", few, ((1, 0.0),))
    tools = ["--tool", LEI / "target.toml", "--reference", rod(tmp_path)]
    said = refusal(tmp_path, tmp_path / "one.uff", *tools)
    assert "node 5" in said
    assert "no rotations" in said


def test_another_grid_of_the_same_length_is_refused(few, tmp_path):
    """In one file the reader sees it; in records of several, what unites them."""
    path, shifted = tmp_path / "frfs.uff", replace(few, frequency_hz=few.frequency_hz + 1.0)
    parts = (few, ((1, 0.0),)), (shifted, ((5, 0.02),))
    path.write_bytes(b"".join(exported(path, *part).read_bytes() for part in parts))
    tools = "--tool", LEI / "target.toml", "--reference", rod(tmp_path)
    assert "frfs.uff" in (said := refusal(tmp_path, path, *tools))
    assert "export one grid" in said


def test_motions_alone_are_refused_with_what_to_measure(coupled, tmp_path):
    with np.load(coupled["npz"]) as stored:
        keys = ("frequency_hz", "frf_mean", "frf_sd", "pose")
        alone = {name: stored[name] for name in keys}
    np.savez(tmp_path / "lacking.npz", **alone)
    assert "measure what lacks" in refusal(tmp_path, tmp_path / "lacking.npz", *PAIR)
    for name in ("frf_mean", "frf_sd"):
        alone[name] = np.nan_to_num(alone[name])
    np.savez(tmp_path / "alone.npz", **alone)
    said = refusal(tmp_path, tmp_path / "alone.npz", *PAIR)
    assert "two points" in said
    assert "--robot" in said


@pytest.mark.parametrize(
    ("source", "more", "words"),
    [
        ("modes.toml", ["--band-hz", "800", "5000"], "covers 5 to 1200 Hz"),
        ("modes.toml", ["--band-hz", "900", "800"], "measure"),
        ("nothing.npz", [], "does not exist"),
        ("reference.toml", [], "modes"),
        ("NOTES.md", [], "format"),
    ],
)
def test_input_that_makes_no_sense(tmp_path, source, more, words):
    assert words in refusal(tmp_path, LEI / source, *PAIR, *more)


HZ = np.arange(10.0, 60.0, 0.5)
POINTS = tuple(Dof.of_uff(node, direction) for node in "15" for direction in (1, 2))
FURTHER = np.array([1.0, 1.0, 0.7, 0.7])  # of the second point beside the tip: it turns, too


def receptance(angle):
    """(4, 4, F) between both points, along x and y: two modes that turn with the posture."""
    h, s = np.zeros((4, 4, len(HZ)), complex), 2j * np.pi * HZ
    for k, f in enumerate((22 + 4 * np.sin(angle), 38 - 3 * angle**2)):
        way = angle + 0.4 + k * np.pi / 2
        right = np.tile([np.cos(way), np.sin(way)], 2) * FURTHER
        left = np.tile([np.cos(way - 0.2), np.sin(way - 0.2)], 2) * FURTHER
        p = pole(np.array(f), np.array(0.03))
        r = np.outer(right, left)[..., None] / (2j * p.imag * 50.0)
        h += r / (s - p) + r.conj() / (s - p.conj())
    return h


@pytest.fixture(scope="module")
def postures(tmp_path_factory):
    """Folder and tool: thirteen postures of one joint with 1 % noise, the other joint held."""
    folder = tmp_path_factory.mktemp("postures")
    rng, rows = np.random.default_rng(41), []
    for i, angle in enumerate(np.linspace(-0.7, 0.7, 13)):
        h = receptance(angle) * (2j * np.pi * HZ) ** 2
        h *= 1 + 0.007 * (rng.standard_normal(h.shape) + 1j * rng.standard_normal(h.shape))
        matrix = FrfMatrix(HZ, POINTS, POINTS, h, True)
        write_matrix(folder / f"{i}.uff", matrix)
        rows.append(f"P{i:02d},{np.rad2deg(angle):.6f},5,+x,{i}.uff")
    table = "\n".join(["pose,a_deg,b_deg,hit,file", *rows, ""])
    (folder / "recordings.csv").write_text(table)
    wanted = f"H1,{np.rad2deg(0.31):.6f},5\nH2,{np.rad2deg(0.31):.6f},9\n"
    (folder / "predict.csv").write_text("pose,a_deg,b_deg\n" + wanted)
    return folder, rod(folder)


def test_a_posture_between_others(postures):
    folder, file = postures
    tip = posture_tip(folder, load_tool(file), "H1")
    truth = np.moveaxis(receptance(0.31), -1, 0)
    off = np.linalg.norm(tip.measured - truth) / np.linalg.norm(truth)
    nearest = np.moveaxis(receptance(0.35), -1, 0)
    assert off < 0.5 * np.linalg.norm(nearest - truth) / np.linalg.norm(truth)
    assert tip.simulated
    assert np.all(tip.sd > 0)


def test_the_command_and_what_makes_no_sense(postures, tmp_path):
    folder, file = postures
    pair = ["--tool", LEI / "target.toml"]
    right = ["--reference", file, "--pose", "H1", "--out", tmp_path / "new.npz"]
    answer = told("couple", folder, *pair, *right)
    assert any("13 other postures" in remark for remark in answer["remarks"])
    for more, words in (
        (["--reference", file], "Name a pose of"),
        (["--reference", file, "--pose", "P03"], "Name a pose of"),
        (["--reference", file, "--pose", "H2"], "turns a joint"),
        (["--pose", "H1"], "where its points are is not stated"),
    ):
        assert words in refusal(tmp_path, folder, *pair, *more)


def test_postures_of_one_point_are_refused(postures, tmp_path):
    folder, file = postures
    h = receptance(0.0)[:2, :2]
    one = FrfMatrix(HZ, POINTS[:2], POINTS[:2], h, True)
    for name in ("recordings.csv", "predict.csv"):
        (tmp_path / name).write_text((folder / name).read_text())
    for i in range(13):
        write_matrix(tmp_path / f"{i}.uff", one)
    with pytest.raises(InputError, match="between"):
        posture_tip(tmp_path, load_tool(file), "H1")
