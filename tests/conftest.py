"""What every test shares: one BLAS thread, real recordings where they are present."""

import os
import shutil

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from pathlib import Path  # noqa: E402

import pytest  # noqa: E402

from planner.inference import parallel  # noqa: E402

SHARED_DATA = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(autouse=True)
def no_lines_of_progress(monkeypatch):
    """What a command says hangs on no clock: lines of progress come after seconds."""
    monkeypatch.setattr("planner.cli.answer.FIRST_S", 3600.0)


@pytest.fixture(autouse=True, scope="session")
def no_more_processes_than_cores():
    """Where workers of pytest-xdist fill the cores, a helper process takes another's."""
    with pytest.MonkeyPatch.context() as patch:
        if int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")) >= parallel.cores():
            patch.setattr(parallel, "_has_cores", lambda: False)
        yield


@pytest.fixture(scope="session")
def first_pose_once(tmp_path_factory):
    """A campaign with a proposal and its recordings: not to be changed."""
    from tests.support.outside import FirstPose  # most tests need no simulated robot

    return FirstPose.begun(tmp_path_factory.mktemp("first"))


@pytest.fixture
def first_pose(first_pose_once, tmp_path):
    """A copy of it."""
    return first_pose_once.copied(tmp_path)


@pytest.fixture(scope="session")
def two_poses_once(tmp_path_factory):
    """A campaign of two poses whose simulation learns, and its true arm: not to be changed."""
    from tests.support.plain_arm import measured_poses

    return measured_poses(tmp_path_factory.mktemp("two"), 2)


@pytest.fixture
def two_poses(two_poses_once, tmp_path):
    """A copy of it, and the arm."""
    campaign, truth = two_poses_once
    return type(campaign)(shutil.copytree(campaign.directory, tmp_path / "cell")), truth


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real recordings; the test is skipped where it is missing."""
    if not SHARED_DATA.is_dir():
        pytest.skip("real recordings (shared/data beside the project) are not on this machine")
    return SHARED_DATA
