"""All of the package agrees with its types."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_types_hold():
    command = (
        sys.executable, "-m", "pyrefly", "check", "--python-interpreter-path", sys.executable,
        "--config", str(ROOT / "pyproject.toml"), "--min-severity", "error",
    )  # fmt: skip
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
