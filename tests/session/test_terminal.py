"""`planner watch` in a real (pseudo) terminal: what it shows, and keys without Enter."""

import os
import pty
import select
import subprocess
import termios
import time

from tests.support.outside import PLANNER, make_cell, told


def read_until(handle: int, text: str, seconds: float = 60.0) -> str:
    seen, until = "", time.monotonic() + seconds
    while text not in seen:
        assert time.monotonic() < until, f"no {text!r} in:\n{seen}"
        if select.select([handle], [], [], 0.2)[0]:
            seen += os.read(handle, 65536).decode("utf-8", "replace")
    return seen


def test_keys_and_screen_of_a_terminal(tmp_path):
    robot, campaign_toml, _ = make_cell(tmp_path)
    cell, inbox = tmp_path / "cell", tmp_path / "inbox"
    told("new", cell, "--robot", robot, "--campaign", campaign_toml)
    inbox.mkdir()
    ours, theirs = pty.openpty()
    before = termios.tcgetattr(theirs)
    process = subprocess.Popen(
        [*PLANNER, "watch", str(cell), str(inbox)],
        stdin=theirs, stdout=theirs, stderr=theirs, close_fds=True,
        env={**os.environ, "COLUMNS": "100", "TERM": "xterm-256color"},
    )  # fmt: skip
    try:
        first = read_until(ours, "[?] help")
        for words in ("go to pose P001", "joint_a1", "angle (°)", "tool at x", "expected (Hz)"):
            assert words in first, words
        os.write(ours, b"a")
        read_until(ours, "Nothing to import yet")
        os.write(ours, b"b")
        read_until(ours, "b is not possible now")
        os.write(ours, b"k")
        read_until(ours, "stands in the way?")
        os.write(ours, b"\n")
        second = read_until(ours, "go to pose P002")
        assert "P001 will not be offered again ([u]" in second
        os.write(ours, b"q")
        read_until(ours, "Session ended: quit")
        assert process.wait(timeout=30) == 0
        assert termios.tcgetattr(theirs) == before
    finally:
        process.kill()
        process.wait()
        os.close(ours)
        os.close(theirs)
    status = told("status", cell)
    assert [s["pose"] for s in status["skipped"]] == ["P001"]
