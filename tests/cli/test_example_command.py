"""`planner new --example`: what it writes runs right away."""

from pathlib import Path

from tests.support.outside import refused, told


def test_the_example_goes_from_check_to_a_proposal(tmp_path):
    written = told("new", "--example", tmp_path / "own")
    assert {Path(f).name for f in written["files"]} == {
        "robot.toml", "robot.urdf", "campaign.toml", "ask_tell.py",
        "cut.toml", "tool.toml",
    }  # fmt: skip
    texts = [Path(f).read_text() for f in written["files"]]
    assert all("#" in text or "<!--" in text for text in texts)
    assert told("check", written["robot"])["ok"]
    new = told("new", tmp_path / "cell", "--robot", written["robot"], "--campaign",
              written["campaign"])  # fmt: skip
    assert new["findings"] == []
    (proposal,) = told("next", tmp_path / "cell")["proposals"]
    assert len(proposal["joints_deg"]) == 6


def test_it_overwrites_nothing(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    assert "not empty" in refused("new", "--example", tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["mine.txt"]
