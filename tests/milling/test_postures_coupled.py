"""`planner couple` at a posture that was not hit, from FRFs between two points of others."""

import numpy as np
import pytest

from planner.campaign.posture_tip import posture_tip
from planner.errors import InputError
from planner.frf.matrix import FrfMatrix
from planner.frf.synthesis import pole
from planner.milling.tool import load_tool
from planner.recording.dof import Dof
from tests.milling.test_couple_command import LEI, answered, rod
from tests.support.matrix_files import write_matrix

HZ = np.arange(10.0, 60.0, 0.25)
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


def recorded(folder, seed, wanted=("H1,0.31,5",)):
    """Thirteen postures of one joint with 1 % noise, the other joint held."""
    rng, rows = np.random.default_rng(seed), []
    for i, angle in enumerate(np.linspace(-0.7, 0.7, 13)):
        h = receptance(angle) * (2j * np.pi * HZ) ** 2
        h *= 1 + 0.007 * (rng.standard_normal(h.shape) + 1j * rng.standard_normal(h.shape))
        matrix = FrfMatrix(HZ, POINTS, POINTS, h, np.full(h.shape, np.nan), True)
        write_matrix(folder / f"{i}.uff", matrix)
        rows.append(f"P{i:02d},{np.rad2deg(angle):.6f},5,+x,{i}.uff")
    table = "\n".join(["pose,a_deg,b_deg,hit,file", *rows, ""])
    (folder / "recordings.csv").write_text(table)
    named = [f"{n},{np.rad2deg(float(a)):.6f},{b}" for n, a, b in (w.split(",") for w in wanted)]
    (folder / "predict.csv").write_text("\n".join(["pose,a_deg,b_deg", *named, ""]))
    return rod(folder)


@pytest.mark.parametrize("seed", [41, 42, 43])
def test_a_posture_between_others(tmp_path, seed):
    tool = load_tool(recorded(tmp_path, seed))
    tip = posture_tip(tmp_path, tool, "H1")
    back = next(p for p in tool.points if p.from_tip_m > 0).from_tip_m
    assert back == pytest.approx(0.02)
    truth = np.moveaxis(receptance(0.31), -1, 0)
    off = np.linalg.norm(tip.measured - truth) / np.linalg.norm(truth)
    nearest = np.moveaxis(receptance(0.35), -1, 0)
    assert off < 0.5 * np.linalg.norm(nearest - truth) / np.linalg.norm(truth)
    assert tip.simulated
    assert np.all(tip.sd > 0)


def test_the_command_and_what_makes_no_sense(tmp_path):
    file = recorded(tmp_path, 1, ("H1,0.31,5", "H2,0.31,9"))
    pair = ["--tool", LEI / "target.toml", "--out", tmp_path / "new.npz"]
    code, answer = answered(tmp_path, *pair, "--reference", file, "--pose", "H1")
    assert code == 0
    assert any("13 other postures" in remark for remark in answer["remarks"])
    for more, told in (
        (["--reference", file], "Name a pose of"),
        (["--reference", file, "--pose", "P03"], "Name a pose of"),
        (["--reference", file, "--pose", "H2"], "turns a joint"),
        (["--pose", "H1"], "where its points are is not stated"),
    ):
        code, said = answered(tmp_path, *pair, *more)
        assert code == 2
        assert told in said
        assert len(said.splitlines()) == 1


def test_postures_of_one_point_are_refused(tmp_path):
    tool = load_tool(recorded(tmp_path, 1))
    h = receptance(0.0)[:2, :2]
    matrix = FrfMatrix(HZ, POINTS[:2], POINTS[:2], h, np.full(h.shape, np.nan), True)
    for i in range(13):
        write_matrix(tmp_path / f"{i}.uff", matrix)
    with pytest.raises(InputError, match="between"):
        posture_tip(tmp_path, tool, "H1")
