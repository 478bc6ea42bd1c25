"""Progress where nobody looks at a terminal: lines on stderr, none with --json."""

import time

import pytest

from planner.cli import answer


@pytest.mark.parametrize("quiet", [False, True])
def test_long_work_is_told_in_lines(quiet, monkeypatch, capsys):
    monkeypatch.setattr(answer, "FIRST_S", 0.02)
    with answer.progress_bar("comparing", quiet) as tell:
        tell("runs", 0.25)
        time.sleep(0.3)
    said = capsys.readouterr()
    assert said.out == ""
    assert ("comparing: runs, 25 % (0 s)" in said.err) == (not quiet)
