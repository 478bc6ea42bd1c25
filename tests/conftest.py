"""What every test shares: one BLAS thread, real recordings where they are present, --table.

Of several processes of tests (-n) each has a core of its own: none starts a helper process, which
would only take the core of another.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from collections.abc import Iterator  # noqa: E402
from pathlib import Path  # noqa: E402

import pytest  # noqa: E402

ALL_CORES = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set[int]()
pytest_plugins = ["tests.support.proof_table"]
SHARED_DATA = Path(__file__).parents[2] / "shared" / "data"


def pytest_configure(config: pytest.Config) -> None:
    if hasattr(config, "workerinput") and ALL_CORES:
        number = int(os.environ["PYTEST_XDIST_WORKER"].removeprefix("gw"))
        os.sched_setaffinity(0, {sorted(ALL_CORES)[number % len(ALL_CORES)]})


@pytest.fixture
def all_cores() -> Iterator[None]:
    """For tests of work that is shared among cores."""
    if not ALL_CORES:
        yield
        return
    own = os.sched_getaffinity(0)
    os.sched_setaffinity(0, ALL_CORES)
    yield
    os.sched_setaffinity(0, own)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real recordings; the test is skipped where it is missing."""
    if not SHARED_DATA.is_dir():
        pytest.skip("real recordings (shared/data beside the project) are not on this machine")
    return SHARED_DATA
