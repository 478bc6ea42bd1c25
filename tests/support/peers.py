"""Public implementations that benchmarks stand beside, in an interpreter that may be another."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

PYTHON = os.environ.get("PEERS_PYTHON", sys.executable)
peers_needed = pytest.mark.skipif(
    "PEERS_PYTHON" not in os.environ and importlib.util.find_spec("emukit") is None,
    reason="the peers are not installed: pip install 'planner[peers]', or set PEERS_PYTHON",
)


def ask(script: str, jobs: Path, answers: Path) -> None:
    """Have a script beside this file answer jobs (npz) into another file."""
    path = Path(__file__).with_name(script)
    environment = {**os.environ, "PYTHONPATH": "", "OMP_NUM_THREADS": "1"}
    subprocess.run([PYTHON, path, jobs, answers], check=True, env=environment)
