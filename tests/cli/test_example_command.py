"""`planner new --example`: what it writes runs right away."""

import json
from pathlib import Path

from planner.cli.run import run


def ask(capsys, *arguments: object) -> dict:
    code = run([*map(str, arguments), "--json"])
    said = capsys.readouterr()
    assert code == 0, said.err
    return json.loads(said.out)


def test_the_example_goes_from_check_to_a_proposal(tmp_path, capsys):
    written = ask(capsys, "new", "--example", tmp_path / "own")
    assert {Path(f).name for f in written["files"]} == {
        "robot.toml", "robot.urdf", "campaign.toml", "ask_tell.py",
        "cut.toml", "tool.toml",
    }  # fmt: skip
    assert all(
        "#" in Path(f).read_text() or "<!--" in Path(f).read_text() for f in written["files"]
    )
    assert ask(capsys, "check", written["robot"])["ok"]
    new = ask(capsys, "new", tmp_path / "cell", "--robot", written["robot"], "--campaign",
              written["campaign"])  # fmt: skip
    assert new["findings"] == []
    (proposal,) = ask(capsys, "next", tmp_path / "cell")["proposals"]
    assert len(proposal["joints_deg"]) == 6


def test_it_overwrites_nothing(tmp_path, capsys):
    (tmp_path / "mine.txt").write_text("mine")
    assert run(["new", "--example", str(tmp_path)]) == 2
    assert "not empty" in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ["mine.txt"]


def test_new_asks_for_a_robot_or_the_example(tmp_path, capsys):
    assert run(["new", str(tmp_path / "cell")]) == 2
    assert "--example" in capsys.readouterr().err
