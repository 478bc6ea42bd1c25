"""Rerun recordings, to a file and/or a live viewer on this machine only."""

import hashlib
import socket
import subprocess
import sys
import time
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from planner.errors import writing

PORT = 9876
VIEWER = f"rerun+http://127.0.0.1:{PORT}/proxy"
VIEWER_START_S = 15.0


def open_stream(
    identity: str, name: str, blueprint: rrb.Blueprint, rrd: Path | None, viewer: bool = False
) -> rr.RecordingStream:
    """A recording without a clock: the same `identity` and content give the same recording.

    Raises InputError if the file cannot be written.
    """
    key = hashlib.sha256(identity.encode()).hexdigest()[:32]
    stream = rr.RecordingStream("planner", recording_id=key, send_properties=False)
    # The clock would make two recordings of one campaign differ.
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    stream.set_sinks(*_sinks(rrd, viewer), default_blueprint=blueprint)
    stream.send_recording_name(name)
    return stream


def _sinks(rrd: Path | None, viewer: bool) -> list:
    sinks: list = []
    if rrd is not None:
        with writing(rrd):
            rrd.parent.mkdir(parents=True, exist_ok=True)
            rrd.write_bytes(b"")
        sinks.append(rr.FileSink(str(rrd)))
    if viewer and _start_viewer():
        sinks.append(rr.GrpcSink(VIEWER))
    return sinks


def _start_viewer() -> bool:
    """Open the viewer unless one listens already; False, with a word, if there can be none."""
    if _listens():
        return True
    # The viewer listens on every network interface unless told otherwise.
    process = subprocess.Popen(
        [sys.executable, "-m", "rerun", "--bind", "127.0.0.1", "--port", str(PORT)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    until = time.monotonic() + VIEWER_START_S
    while time.monotonic() < until and process.poll() is None:
        if _listens():
            # Without a display it listens first and ends then.
            time.sleep(0.5)
            if process.poll() is None:
                return True
        time.sleep(0.1)
    if process.poll() is None:
        process.kill()
    print("The Rerun viewer did not open here; going on without it.", file=sys.stderr)
    return False


def _listens() -> bool:
    with socket.socket() as probe:
        probe.settimeout(0.2)
        return probe.connect_ex(("127.0.0.1", PORT)) == 0
