"""Sessions at a terminal of 80 × 24: keys, and all that can go wrong; nothing wrong gets in."""

import fcntl
import os
import pty
import re
import select
import shutil
import struct
import subprocess
import termios
import time
from pathlib import Path

import numpy as np

from planner.campaign.campaign import Campaign
from planner.proof.hits import AXES, SimulatedHit, noisy, pulse, sampled, simulate_hit
from planner.proof.model import Truth
from planner.proof.recordings import write_uff
from tests.support.outside import HAMMER, PLANNER

ROWS, COLUMNS = 24, 80


class Terminal:
    """`planner watch` in a pseudo-terminal; `page` is what a person sees."""

    def __init__(self, *arguments: object):
        self.ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))
        self.before = termios.tcgetattr(theirs)
        size = {"COLUMNS": str(COLUMNS), "LINES": str(ROWS), "TERM": "xterm-256color"}
        self.process = subprocess.Popen(
            [*PLANNER, "watch", *map(str, arguments)], stdin=theirs, stdout=theirs, stderr=theirs,
            close_fds=True, env={**os.environ, **size},
        )  # fmt: skip
        self.theirs, self.seen = theirs, ""

    @property
    def page(self) -> str:
        """Text since the screen was cleared last, without colours."""
        last = self.seen.split("\x1b[2J")[-1].replace("\r", "")
        return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", last)

    def until(self, *words: str, seconds: float = 60.0) -> str:
        """Read until all words are on the page."""
        end = time.monotonic() + seconds
        while not all(word in " ".join(self.page.split()) for word in words):
            assert time.monotonic() < end, f"no {words} on:\n{self.page}"
            if select.select([self.ours], [], [], 0.1)[0]:
                self.seen += os.read(self.ours, 65536).decode("utf-8", "replace")
        return self.page

    def press(self, key: str, *words: str) -> str:
        os.write(self.ours, key.encode())
        return self.until(*words)

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self.ours)
        os.close(self.theirs)


class Analyser:
    """Exports hits at a pose into a folder, good ones and others."""

    def __init__(self, truth: Truth, inbox: Path, joints_deg: tuple[float, ...]):
        self.truth, self.inbox, self.q = truth, inbox, np.deg2rad(joints_deg)
        self.rng = np.random.default_rng(5)

    def write(self, name: str, hit: SimulatedHit) -> Path:
        made = self.inbox.parent / f"{name}.uff"
        write_uff(made, hit, HAMMER)
        return Path(shutil.move(made, self.inbox / f"{name}.uff"))

    def good(self, axis: str) -> SimulatedHit:
        return simulate_hit(self.truth, self.q, axis, HAMMER, self.rng)

    def double(self, axis: str) -> SimulatedHit:
        force = pulse(HAMMER, self.rng)
        shift = round(0.03 / HAMMER.step_s)
        force[shift:] += 0.5 * force[:-shift]
        response = self.truth.respond(self.q, force, AXES.index(axis[1]), HAMMER.step_s)
        return noisy(sampled(axis, force, response, HAMMER), HAMMER, self.rng)

    def weak(self, axis: str) -> SimulatedHit:
        good = self.good(axis)
        noise = 0.5 * np.std(good.acceleration_m_s2)
        faint = 0.02 * good.acceleration_m_s2 + noise * self.rng.standard_normal((3, 1))
        faint = faint + noise * self.rng.standard_normal(faint.shape)
        return SimulatedHit(axis, 0.02 * good.force_n, faint)

    def clipped(self, axis: str) -> SimulatedHit:
        good = self.good(axis)
        top = np.sort(good.force_n)[-3]  # three equal samples
        return SimulatedHit(axis, np.minimum(good.force_n, top), good.acceleration_m_s2)


def used_files(directory: Path) -> set[str]:
    """Names of the hits in use, without folders."""
    state = Campaign(directory).state
    return {Path(h.file).name for m in state.used for h in m.accepted}


def test_keys_act_without_enter_and_the_terminal_is_left_as_it_was(cell):
    campaign, _, inbox = cell
    terminal = Terminal(campaign.directory, inbox)
    try:
        shown = "go to pose P001", "joint_a1", "angle (°)", "tool at x", "expected (Hz)", "[?] help"
        terminal.until(*shown)
        terminal.press("a", "Nothing to import yet")
        terminal.press("b", "b does nothing now")
        terminal.press("k", "in the way?")
        terminal.press("\n", "go to pose P002", "P001 will not be offered again ([u]")
        terminal.press("q", "Session ended: quit")
        assert terminal.process.wait(timeout=30) == 0
        assert termios.tcgetattr(terminal.theirs) == terminal.before
    finally:
        terminal.close()
    assert list(Campaign(campaign.directory).state.skipped) == ["P001"]


def test_a_session_in_which_all_goes_wrong(measured):
    campaign, truth, inbox = measured
    first, second = campaign.next(2)
    terminal = Terminal(campaign.directory, inbox, "--hits-per-pose", 6)
    try:
        page = terminal.until(f"go to pose {first.pose}", "axes of tcp", "x 0/2", "/inbox")
        assert "accept" not in page  # there is nothing to accept
        analyser = Analyser(truth, inbox, first.joints_deg)
        for name, axis, said in (
            ("double", "+x", "REPEAT HIT 1"), ("weak", "+x", "REPEAT HIT 2"),
            ("clipped", "+x", "REPEAT HIT 3"),
        ):  # fmt: skip
            bells = terminal.seen.count("\a")
            analyser.write(name, getattr(analyser, name)(axis))
            terminal.until(said, "x 0/2")
            assert terminal.seen.count("\a") > bells
            assert "…" not in terminal.page[: terminal.page.index("waiting for hits in")]
        (inbox / "foreign.uff").write_bytes(b"this is no recording\n" * 30)
        page = terminal.until("not whole yet", "foreign.uff")
        assert "…" not in page[: page.index("waiting for hits in")]
        whole = analyser.write("x1", analyser.good("+x"))
        data = whole.read_bytes()
        terminal.until("x 1/2")
        (inbox / "half.uff").write_bytes(data[: len(data) // 2])
        terminal.until("half.uff")
        terminal.press("a", "Hits are missing (x 1/2, y 0/2, z 0/2)")
        analyser.write("half", analyser.good("+x"))
        terminal.until("x 2/2")
        for axis in "yz":
            for number in (1, 2):
                analyser.write(f"{axis}{number}", analyser.good(f"+{axis}"))
        page = terminal.until("all hits are in", "[a] accept ")
        assert all(len(line) <= COLUMNS for line in page.splitlines())
        assert len(page.splitlines()) <= ROWS
        good = {f"{name}.uff" for name in ("x1", "half", "y1", "y2", "z1", "z2")}
        page = terminal.press("a", f"{first.pose}: 6 hits in, 3 refused", "go to pose")
        # Why hits were refused stays under the next page; the panel of results stands once, above.
        for name in ("double", "weak", "clipped"):
            assert f"refused {name}.uff: " in page
        assert terminal.seen.count(f"─ Pose {first.pose}: 6 hits in, 3 refused ─") == 1
        assert good <= used_files(campaign.directory)
        # Hits that came late answer as the pose before did; they are asked about, and moved.
        analyser.write("late", analyser.good("+x"))
        terminal.until("late?", f"[b] late hits are from {first.pose}")
        terminal.press("b", f"{first.pose}: 1 hit in")
        # The robot stands elsewhere than said: asked, and not used.
        now = Campaign(campaign.directory).state.open[0]
        elsewhere = Analyser(truth, inbox, second.joints_deg)
        if now == second.pose:
            elsewhere.q = np.deg2rad(Campaign(campaign.directory).state.used[0].joints_deg)
        for axis in "xyz":
            for number in (1, 2):
                elsewhere.write(f"wrong_{axis}{number}", elsewhere.good(f"+{axis}"))
        terminal.until("all hits are in")
        terminal.press("a", f"Pose {now}: a question", "not used until you answer")
        terminal.press("r", "are refused: mend the cause")
        terminal.press("q", "Session ended: quit")
        assert terminal.process.wait(timeout=30) == 0
    finally:
        terminal.close()
    state = Campaign(campaign.directory).state
    used = used_files(campaign.directory)
    assert good | {"late.uff"} <= used
    bad = {"double.uff", "weak.uff", "clipped.uff", "foreign.uff"}
    assert not [name for name in used if name in bad or name.startswith("wrong")]
    assert len(state.refused) == 6  # of the wrong pose, kept
    kept = {path.name[:64] for path in (campaign.directory / "recordings").glob("*.uff")}
    assert {hit.sha256 for m in state.recorded for hit in m.hits} | set(state.refused) <= kept
