"""How long `planner modes` takes over a roving hammer set of the size that is usual.

    pytest -m slow -s tests/benchmarks/test_matrix_speed.py

prints processor time of the whole command, start and reading included, over how much the structure
changed from set to set.
"""

import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from planner.modal.mac import mac
from tests.support.hit_structures import hit_frfs
from tests.support.matrix_files import write_matrix
from tests.support.structures import aeroplane

LINES = np.arange(1, 1602) * 0.1  # 74 points x 3 references x 1,601 lines
SETS = ((0.0, 0.01), (0.001, 0.01), (0.002, 0.01), (0.005, 0.01), (0.002, 0.03), (0.005, 0.03))
REPEATS = 3
CLOSE = 1.02  # of frequencies whose shapes noise may mix


def cpu_of(path: Path) -> tuple[float, dict]:
    """Least processor time in s of the command over some repeats, and its answer."""
    spent, answer = [], {}
    for _ in range(REPEATS):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        code = "import sys; from planner.cli.run import run; sys.exit(run(sys.argv[1:]))"
        done = subprocess.run(
            [sys.executable, "-c", code, "modes", str(path), "--json"],
            capture_output=True, text=True, check=True, env=os.environ | {"OMP_NUM_THREADS": "1"},
        )  # fmt: skip
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        answer = json.loads(done.stdout)
    return min(spent), answer


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_222_frfs(tmp_path: Path, capsys) -> None:
    structure, references = aeroplane()
    poles, shapes = structure.poles()
    hz = np.abs(poles) / (2 * np.pi)
    alone = [
        k for k in range(hz.size)
        if 5 < hz[k] < 155 and np.sum(np.abs(np.log(hz / hz[k])) < np.log(CLOSE)) == 1
    ]  # fmt: skip
    for drift, noise in SETS:
        rng, gain = np.random.default_rng(5), 0.02 if drift else 0.0
        matrix = hit_frfs(structure, references, LINES, rng, noise, drift, gain)
        spent, answer = cpu_of(write_matrix(tmp_path / "set.uff", matrix))
        found = np.array([mode["frequency_hz"] for mode in answer["modes"]])
        with capsys.disabled():
            print(
                f"\n{matrix.count} FRFs, sets that drift by {100 * drift:g} %, noise of "
                f"{100 * noise:g} %: {spent:.2f} s CPU, {found.size} modes"
            )
        rows = [structure.nodes.index(node) for node, _ in answer["dofs"]]
        for k in alone:
            mode = answer["modes"][int(np.argmin(np.abs(found - hz[k])))]
            assert mode["frequency_hz"] == pytest.approx(hz[k], rel=2e-3)
            assert mac(np.array([complex(*v) for v in mode["shape"]]), shapes[rows, k]) > 0.995
