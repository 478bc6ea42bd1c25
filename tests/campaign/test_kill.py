"""kill -9, full disks, damage: nothing acknowledged is lost, and what is wrong is said."""

import shutil
import subprocess
import sys

import pytest

from tests.support.outside import with_tests

# In namespaces of its own a process may fill a disk that only it sees.
ALONE = ("unshare", "--user", "--map-root-user", "--mount")


def lab(folder, *counts: object) -> str:
    """What the trials found, in words; they fail where anything was lost."""
    script = [sys.executable, "-m", "tests.support.crash_lab", str(folder), *map(str, counts)]
    alone = ALONE if "--full" in script else ()
    done = subprocess.run([*alone, *script], capture_output=True, text=True, env=with_tests())
    print(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr[-3000:]
    return done.stdout


def disks_can_be_filled() -> bool:
    """Whether a disk of one's own can be mounted."""
    mount = [*ALONE, "mount", "-t", "tmpfs", "tmpfs", "/dev"]
    return (
        bool(shutil.which(ALONE[0])) and not subprocess.run(mount, capture_output=True).returncode
    )


def test_kills_full_disks_and_damage(tmp_path):
    full = ("--full", 1) if disks_can_be_filled() else ()
    few = "--kills", 2, "--stopped", 1, "--damaged", 1, *full, "--seed", 2
    assert "kills: 2, " in lab(tmp_path, *few)


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_500_kills_50_full_disks_50_damaged_files(tmp_path):
    if not disks_can_be_filled():
        pytest.skip("no disk of its own can be mounted here, so that none can be filled")
    lab(tmp_path, "--kills", 1000, "--stopped", 60, "--full", 50, "--damaged", 50)
    killed = (tmp_path / "kills.jsonl").read_text().count('"killed": true')
    print(f"{killed} kills struck")
    assert killed >= 500
