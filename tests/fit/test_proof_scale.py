"""FRFs of the right size and the right structure after six poses, on robots of another engine.

pytest -m slow -s tests/fit/test_proof_scale.py
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.support.fitted_cases import ARMS, Case, Judged, everyday, forgotten, harder

pytestmark = [pytest.mark.slow, pytest.mark.timeout(14400)]
FIRST, EVERYDAY, HARDER, FORGOTTEN = 5100, 50, 15, 30
NAMES = {
    "soft base": ("soft_base", "shifting_base", "foundation"),
    "bending link": ("link_flexibility",),
    "hose": ("local_resonator",),
}


def judged(
    make: Callable[[str, int, Path], Case], count: int, folder: Path
) -> list[tuple[Case, Judged]]:
    """Cases on all arms in turn; each is printed."""
    found = []
    for number in range(count):
        case = make(list(ARMS)[number % len(ARMS)], FIRST + number, folder / str(number))
        found.append((case, Judged.of(case, case.posterior())))
        print(FIRST + number, found[-1][1], flush=True)
    return found


def test_everyday_robots_are_known_after_six_poses(tmp_path):
    found = judged(everyday, EVERYDAY, tmp_path)
    rmse = np.array([j.rmse_percent for _, j in found])
    frac = np.array([j.frac for _, j in found])
    named = [
        all(any(n.startswith(kinds) for n in j.named) for kinds in map(NAMES.get, case.concealed))
        for case, j in found
    ]
    assert np.median(rmse) <= 0.1
    assert np.mean(rmse <= 1) >= 0.98
    assert np.mean(frac >= 0.998) >= 0.96
    assert np.mean(named) >= 0.9


def test_the_common_scale_of_harder_robots(tmp_path):
    found = [j for _, j in judged(harder, HARDER, tmp_path)]
    off = np.abs([j.scale - 1 for j in found])
    within = off <= 1.96 * np.array([j.scale_sd for j in found])
    inside, error = (np.array([getattr(j, k) for j in found]) for k in ("inside", "error"))
    assert np.mean(off <= 0.03) >= 0.8
    assert np.mean(within) >= 0.93
    assert np.mean(inside >= 0.88) >= 0.93
    assert np.mean(error <= 0.05) >= 0.93


def test_a_forgotten_tool_is_named(tmp_path):
    found = [j for _, j in judged(forgotten, FORGOTTEN, tmp_path)]
    named = [any(n.startswith("added_mass") for n in j.named) for j in found]
    error = np.array([j.error for j in found])
    sds = np.array([j.tool_sds for j in found])
    sds = np.abs(sds[np.isfinite(sds)])
    assert np.mean(sds <= 2) >= 0.85
    assert np.mean(named) >= 0.9
    assert np.mean(error <= 0.05) >= 0.9
