"""Ask and tell: poses proposed and learned from without any file."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from planner import AskTell, Robot, Simulation
from planner.campaign.campaign import Campaign
from planner.campaign.store import EXAMPLE, write_example
from planner.demo import NAME, shipped
from planner.dynamics.simulation import Elasticity
from planner.errors import InputError, RefusedError
from planner.frf.frf import Frf

TOML = EXAMPLE / "robot" / "robot.toml"
BOX = [[-40, 40], [-20, 40], [-60, 10], [-30, 30], [20, 80], [0, 0]]
UNSEEN = [[5, 10, -20, 5, 50, 0], [-30, 0, -40, 20, 70, 0]]


def tables(simulation: str) -> dict:
    return {
        "workspace": {"joints_deg": BOX},
        "modes": {"count": 3, "band_hz": [5.0, 80.0]},
        "acquisition": {"candidates": 40},
        "fidelity": {"simulation": simulation},
    }


@pytest.fixture(scope="module")
def stiffer() -> Simulation:
    """The example arm, 12 % stiffer than its robot.toml says."""
    nominal = Simulation(Robot.load(TOML))
    own = nominal.elasticity
    return nominal.changed(Elasticity(1.12 * own.stiffness, own.damping, own.loss_factor))


def modes_of(truth: Simulation, joints_deg) -> list[tuple[float, ...]]:
    m = truth.modes(np.deg2rad([joints_deg]), 3)
    return [(f, 1e-3 * f, z, 0.1 * z) for f, z in zip(m.frequency_hz[0], m.damping_ratio[0],
                                                      strict=True)]  # fmt: skip


def test_modes_teach_a_frozen_simulation(stiffer):
    loop = AskTell(TOML, tables("frozen"))
    proposed = []
    for _ in range(5):
        proposal = loop.ask()[0]
        proposed.append(proposal.joints_deg)
        loop.tell(proposal.joints_deg, modes=modes_of(stiffer, proposal.joints_deg))
    assert len(set(proposed)) == 5
    found = loop.predict(UNSEEN)
    true = stiffer.modes(np.deg2rad(UNSEEN), 3).frequency_hz
    np.testing.assert_allclose(found.frequency_hz, true, rtol=5e-3)
    assert np.all(np.abs(found.frequency_hz - true) < 5 * found.frequency_sd_hz)
    rows = loop.records()
    assert len(rows) == 15
    assert rows[0]["joint_2_deg"] == proposed[0][1]
    assert rows[3]["pose"] == "T002"
    predicted = loop.predict_records(UNSEEN)
    assert [r["frequency_hz"] for r in predicted] == found.frequency_hz.ravel().tolist()
    assert {type(v) for r in rows + predicted for v in r.values()} <= {str, int, float, bool}


def test_a_pose_told_again_replaces_what_was_told(stiffer):
    loop = AskTell(TOML, tables("none"))
    first = modes_of(stiffer, UNSEEN[0])
    loop.tell(UNSEEN[0], modes=[(2 * f, *rest) for f, *rest in first], pose="A")
    loop.tell(UNSEEN[0], modes=[{"frequency_hz": f} for f, *_ in first], pose="A")
    assert [r["frequency_hz"] for r in loop.records()] == [f for f, *_ in first]
    np.testing.assert_allclose(loop.predict(UNSEEN[0]).frequency_hz[0], [f for f, *_ in first],
                               rtol=0.02)  # fmt: skip


@pytest.mark.slow
def test_frfs_teach_the_simulation_itself(stiffer):
    lines, loop = np.arange(2.0, 90.0, 0.5), AskTell(TOML, tables("updated"))
    rng = np.random.default_rng(3)
    proposal = loop.ask()[0]
    h = stiffer.accelerance(np.deg2rad([proposal.joints_deg]), lines)[0]
    sd = 0.003 * np.abs(h).max()
    h = h + sd * (rng.standard_normal(h.shape) + 1j * rng.standard_normal(h.shape)) / 2**0.5
    variance, coherence = np.full(h.shape, sd**2), np.full(h.shape, 0.99)
    frf = Frf(lines, h, variance, coherence, (4, 4, 4), (4.0, 85.0))
    loop.tell(proposal.joints_deg, frf=frf, pose=proposal.pose)
    true = stiffer.modes(np.deg2rad(UNSEEN), 3).frequency_hz
    np.testing.assert_allclose(loop.predict(UNSEEN).frequency_hz, true, rtol=3e-3)
    at = np.array([12.0, 40.0])
    mean, sd = loop.frf(UNSEEN, at)
    assert mean.shape == sd.shape == (2, 3, 3, 2)
    exact = stiffer.accelerance(np.deg2rad(UNSEEN), at)
    assert np.linalg.norm(mean - exact) < 0.1 * np.linalg.norm(exact)
    with pytest.raises(InputError, match="frozen"):
        loop.tell(UNSEEN[0], modes=[(10.0, 0.1, 0.01, 0.001)])


@pytest.mark.parametrize(
    ("told", "words"),
    [({"modes": []}, "no mode"), ({}, "either modes or frf"), ({"modes": [(-1.0,)]}, "is none"),
     ({"modes": [{"hz": 3.0}]}, "hz"), ({"modes": [(10.0, 0.0)]}, "is none"),
     ({"modes": [(10.0, float("nan"))]}, "is none")],
)  # fmt: skip
def test_what_makes_no_sense_is_said_in_words(told, words):
    loop = AskTell(TOML, tables("none"))
    with pytest.raises((InputError, RefusedError), match=words):
        loop.tell(UNSEEN[0], **told)
    assert loop.records() == []


@pytest.mark.parametrize(
    ("change", "words"),
    [({"workspace": {"joints_deg": BOX[:5]}}, "5 ranges"), ({"nothing": 1}, "nothing"),
     ({"modes": {"count": 0}}, "count"), ({"workspace": {"joints_deg": [[5, 6]] * 5}}, "ranges")],
)  # fmt: skip
def test_tables_are_checked_as_the_file_is(change, words):
    with pytest.raises(InputError, match=words):
        AskTell(TOML, tables("frozen") | change)


def test_angles_outside_the_limits_are_refused():
    loop = AskTell(TOML, tables("none"))
    for call in (loop.predict, lambda q: loop.tell(q, modes=[(10.0,)])):
        with pytest.raises(InputError, match="joint_2"):
            call([0, 200, 0, 0, 0, 0])


def test_a_campaign_has_rows_too(tmp_path):
    campaign = Campaign.new(str(tmp_path / "cell"), str(TOML), str(EXAMPLE / "campaign.toml"))
    assert "0 poses measured, 0 proposed" in repr(campaign)
    with pytest.raises(InputError, match="joint_2"):
        campaign.predict(joints_deg=[0, 200, 0, 0, 0, 0])
    assert campaign.records() == []
    rows = campaign.predict_records(joints_deg=UNSEEN)
    assert [(r["pose"], r["mode"]) for r in rows] == [(p, k) for p in (1, 2) for k in range(1, 5)]
    assert rows[4]["joint_1_deg"] == pytest.approx(-30)


def ran(script: Path, folder: Path) -> str:
    """What a script prints."""
    done = subprocess.run(
        [sys.executable, str(script)], cwd=folder, env={**os.environ, "MPLBACKEND": "Agg"},
        capture_output=True, text=True, check=False, timeout=280,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_script_of_the_example_runs_where_it_is_written(tmp_path):
    write_example(tmp_path / "own")
    *rows, real = ran(tmp_path / "own" / "ask_tell.py", tmp_path).splitlines()
    said = [float(row.split()[2]) for row in rows[1:]]
    true = [float(v) for v in real.removeprefix("real:").strip(" []").split()]
    np.testing.assert_allclose(said, true, rtol=0.01)


def test_the_script_of_the_shipped_campaign_proposes_predicts_and_draws(tmp_path):
    text = (shipped(NAME) / "example.py").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 20
    for old, new in (("Path(__file__).parent", f"Path({str(shipped(NAME))!r})"),
                     ('"A11", "A24", "A57"', '"A11",')):  # fmt: skip
        assert old in text  # one pose shows the same as three
        text = text.replace(old, new)
    script = tmp_path / "example.py"
    script.write_text(text, encoding="utf-8")
    assert ran(script, tmp_path).startswith("P001")
    assert (tmp_path / "frf_xx.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "cell" / "campaign.toml").is_file()
