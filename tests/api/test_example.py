"""The shipped script of a campaign, as a user runs it."""

import os
import subprocess
import sys

from planner.demo import NAME, shipped


def test_the_shipped_script_proposes_predicts_and_draws(tmp_path):
    script = shipped(NAME) / "example.py"
    assert len(script.read_text(encoding="utf-8").splitlines()) <= 20
    done = subprocess.run(
        [sys.executable, str(script)],
        cwd=tmp_path, env={**os.environ, "MPLBACKEND": "Agg"}, capture_output=True, text=True,
        check=False, timeout=280,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("P001")
    assert (tmp_path / "frf_xx.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "cell" / "campaign.toml").is_file()
