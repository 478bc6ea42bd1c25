"""All of the package agrees with its types; checked beside other tests, as it takes a minute."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_types_hold():
    settings = str(ROOT / "pyproject.toml")  # not a file of some folder above
    command = (
        sys.executable, "-m", "basedpyright", "-p", settings, "--pythonpath", sys.executable,
    )  # fmt: skip
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
