"""The same study on a Dask cluster of two workers, one of which is killed half-way."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import planner
from tests.support.outside import make_pool
from tests.support.outside import planner as command

pytest.importorskip("distributed")
RUNS = 8
STUDY = ("--repeats", "4", "--initial", "2", "--budget", "5", "--simulation", "updated")


@contextmanager
def process(*arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """A process of Dask's own command line."""
    root = str(Path(planner.__file__).parents[1])
    env = {**os.environ, "PYTHONPATH": root}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    started = subprocess.Popen([sys.executable, "-m", *arguments], env=env, **quiet)
    try:
        yield started
    finally:
        started.kill()
        started.wait()


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def worker(address: str, root: Path, name: str):
    return process(
        "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny",
        "--no-dashboard", "--local-directory", str(root / name),
    )  # fmt: skip


def compare(pool, out: Path) -> list[str]:
    recordings, robot, campaign = pool
    named = ["--robot", str(robot), "--campaign", str(campaign), "--out", str(out)]
    return ["compare", str(recordings), *named, "--strategies", "maximin_lhs,default", *STUDY]


def numbers(out: Path) -> dict[str, list]:
    """All that the runs kept in a folder say, but for the time they took."""
    found = {}
    for path in (out / "runs").glob("*.json"):
        run = json.loads(path.read_bytes())["kept"]
        found[path.name] = [v for k, v in run.items() if not k.endswith("_seconds")]
    return found


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_cluster_gives_the_same_numbers_though_a_worker_is_killed(tmp_path):
    pool = make_pool(tmp_path / "pool", 10, seed=6)
    here, there = tmp_path / "here", tmp_path / "there"
    command(*compare(pool, here))
    assert len(numbers(here)) == RUNS
    port = str(free_port())
    address = f"tcp://127.0.0.1:{port}"
    scheduler = ("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", port)
    with (
        process(*scheduler, "--no-dashboard"),
        worker(address, tmp_path, "a") as doomed,
        worker(address, tmp_path, "b"),
    ):
        call = "from planner.cli import main; main()"
        arguments = [*compare(pool, there), "--scheduler", address, "--json"]
        study = subprocess.Popen(
            [sys.executable, "-c", call, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        until = time.monotonic() + 400
        while len(numbers(there)) < RUNS // 4 and time.monotonic() < until:
            assert study.poll() is None, study.communicate()[1]
            time.sleep(0.05)
        done = len(numbers(there))
        assert done < RUNS - 1
        os.kill(doomed.pid, signal.SIGKILL)
        answer, said = study.communicate(timeout=400)
    print(f"killed after {done} of {RUNS} runs")
    assert study.returncode == 0, said
    assert json.loads(answer)["failed"] == []
    assert numbers(there) == numbers(here)
