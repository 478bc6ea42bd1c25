"""The log: nothing whole is lost, nothing half believed, damage is found; kill -9, full disks."""

import hashlib
import json
import os
import subprocess
import sys
import time
from itertools import permutations

import pytest

from planner.campaign.events import Entry, Skipped, Starred, Undone, Withdrawn
from planner.campaign.journal import Journal, encode_line, parse
from planner.errors import InputError, JournalError
from tests.support.outside import with_tests

EVENTS = [
    Starred("P001"),
    Skipped("P002", "the table is in the way, 3 mm — near"),
    Withdrawn("P001", ""),
    Undone((3,)),
]


def log_of(events) -> bytes:
    data, check = b"", ""
    for i, event in enumerate(events):
        line, check = encode_line(check, Entry(i + 1, "2026-01-01T00:00:00.000+00:00", event))
        data += line
    return data


def test_a_log_reads_back_as_written():
    assert [entry.event for entry in parse(log_of(EVENTS)).entries] == EVENTS


def test_every_truncation_keeps_every_whole_line_and_no_half_one():
    data = log_of(EVENTS)
    ends = [i + 1 for i, byte in enumerate(data) if byte == 10]
    for cut in range(len(data) + 1):
        content = parse(data[:cut])
        # A line that lacks nothing but its newline is whole: its check proves it.
        whole = sum(1 for end in ends if end - 1 <= cut)
        assert len(content.entries) == whole
        assert len(content.torn) == cut - content.whole_bytes


def test_a_changed_byte_is_found_wherever_it_is():
    """A newline that became a blank, too: a line that was cut short has none."""
    log = log_of(EVENTS)
    for at, byte in enumerate(log):
        for other in {0, 9, 10, 13, 32, 255, byte ^ 1} - {byte}:
            with pytest.raises(JournalError, match="damaged"):
                parse(log[:at] + bytes([other]) + log[at + 1 :])


def test_what_a_newer_planner_wrote_is_not_called_damaged():
    log = log_of(EVENTS)
    check = json.loads(log.splitlines()[-1])["check"]
    body = b'{"seq":5,"time":"2030-01-01","event":{"kind":"calibrated","pose":"P001"}}'
    newer = hashlib.sha256(check.encode() + body).hexdigest()[:16]
    line = b'{"check":"%s","entry":%s}\n' % (newer.encode(), body)
    with pytest.raises(JournalError, match=r"line 5, .* a newer planner wrote it"):
        parse(log + line)


def test_reordered_lines_are_found():
    right, *others = permutations(log_of(EVENTS).splitlines(keepends=True))
    assert b"".join(right) == log_of(EVENTS)
    for lines in others:
        with pytest.raises(JournalError, match="damaged"):
            parse(b"".join(lines))


def test_torn_tail_is_set_aside_before_appending(tmp_path):
    path = tmp_path / "log.jsonl"
    path.write_bytes(log_of(EVENTS[:2]) + b'{"check":"00","ent')
    journal = Journal(path)
    assert journal.torn_bytes == 18
    with journal.writing():
        journal.append(EVENTS[2])
    assert [e.event for e in Journal(path).entries] == EVENTS[:3]
    (aside,) = tmp_path.glob("log.jsonl.torn-*")
    assert aside.read_bytes() == b'{"check":"00","ent'


def test_reading_never_writes(tmp_path):
    path = tmp_path / "log.jsonl"
    data = log_of(EVENTS) + b"half"
    path.write_bytes(data)
    assert len(Journal(path).entries) == 4
    assert path.read_bytes() == data
    assert os.listdir(tmp_path) == ["log.jsonl"]


def test_missing_log_names_the_remedy(tmp_path):
    with pytest.raises(InputError, match="planner new"):
        Journal(tmp_path / "log.jsonl")


HOLD = """
import sys, time
from pathlib import Path
from planner.campaign.journal import Journal
with Journal(Path(sys.argv[1])).writing():
    print("held", flush=True)
    time.sleep(60)
"""


def test_one_writer_at_a_time_and_no_stale_lock(tmp_path):
    path = tmp_path / "log.jsonl"
    path.write_bytes(log_of(EVENTS))
    holder = subprocess.Popen([sys.executable, "-c", HOLD, str(path)], stdout=subprocess.PIPE)
    try:
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"held\n"
        with pytest.raises(InputError, match="in use"), Journal(path).writing(wait_s=0.1):
            pass
    finally:
        holder.kill()
        holder.communicate()
    with Journal(path).writing(wait_s=5.0) as journal:  # the lock died with its holder
        journal.append(Starred("P003"))
    assert len(Journal(path).entries) == 5


def test_a_session_is_not_waited_for(tmp_path):
    path = tmp_path / "log.jsonl"
    path.write_bytes(log_of(EVENTS))
    with Journal(path).holding(session=True):
        started = time.monotonic()
        with pytest.raises(InputError, match="a session; close"), Journal(path).writing():
            pass
        assert time.monotonic() - started < 2.0


def lab(folder, *counts: object) -> str:
    """What the trials found, in words; they fail where anything was lost."""
    script = [sys.executable, "-m", "tests.support.crash_lab", str(folder), *map(str, counts)]
    done = subprocess.run(script, capture_output=True, text=True, env=with_tests())
    print(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr[-3000:]
    return done.stdout


def test_kills_and_full_disks(tmp_path):
    few = "--kills", 2, "--stopped", 1, "--full", 1, "--seed", 2
    assert "kills: 2, " in lab(tmp_path, *few)


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_500_kills_and_50_full_disks(tmp_path):
    lab(tmp_path, "--kills", 1000, "--stopped", 60, "--full", 50)
    killed = (tmp_path / "kills.jsonl").read_text().count('"killed": true')
    print(f"{killed} kills struck")
    assert killed >= 500
