"""FRFs of the right size and the right structure after six poses, on robots of another engine.

    pytest -m slow -s tests/fit/test_proof_scale.py

FITS_SEED is the first seed, FITS how many everyday cases (50), HARDER how many harder ones (15),
FORGOTTEN how many that have a tool which robot.toml lacks (30).
"""

import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from tests.support.fitted_cases import ARMS, Case, Judged, everyday, forgotten, harder

FIRST = int(os.environ.get("FITS_SEED", "5100"))
EVERYDAY, HARDER = int(os.environ.get("FITS", "50")), int(os.environ.get("HARDER", "15"))
FORGOTTEN = int(os.environ.get("FORGOTTEN", "30"))
NAMES = {"soft base": ("soft_base", "shifting_base"), "bending link": ("link_flexibility",),
         "hose": ("local_resonator",)}  # fmt: skip


def judged(
    make: Callable[[str, int, Path], Case], count: int, folder: Path
) -> list[tuple[Case, Judged]]:
    """Cases on all arms in turn; each is printed."""
    found = []
    for number in range(count):
        name = list(ARMS)[number % len(ARMS)]
        case = make(name, FIRST + number, folder / str(number))
        started = time.process_time()
        with threadpool_limits(1):
            j = Judged.of(case, case.posterior())
        spent = time.process_time() - started
        effects = [f"{n} {100 * s:.1f} %" for n, s in zip(j.named, j.shares, strict=True)]
        print(
            f"{FIRST + number} {name}: RMSE {j.rmse_percent:.3f} %, FRAC {j.frac:.4f}, scale "
            f"{j.scale:.3f} ± {j.scale_sd:.3f}, error {100 * j.error:.1f} %, inside "
            f"{j.inside:.2f}, {spent:.0f} s CPU; {', '.join(effects)}", flush=True,
        )  # fmt: skip
        found.append((case, j))
    return found


@pytest.mark.slow
@pytest.mark.timeout(14400)
def test_everyday_robots_are_known_after_six_poses(tmp_path):
    found = judged(everyday, EVERYDAY, tmp_path)
    rmse = np.array([j.rmse_percent for _, j in found])
    frac = np.array([j.frac for _, j in found])
    named = [
        all(any(n.startswith(kinds) for n in j.named) for kinds in map(NAMES.get, case.concealed))
        for case, j in found
    ]
    print(
        f"RMSE median {np.median(rmse):.3f} %, <= 1 % in {np.sum(rmse <= 1)} of {len(rmse)}; "
        f"FRAC >= 0.998 in {np.sum(frac >= 0.998)}; concealed set named in {sum(named)}"
    )
    assert np.median(rmse) <= 0.1
    assert np.mean(rmse <= 1) >= 0.98
    assert np.mean(frac >= 0.998) >= 0.96
    assert np.mean(named) >= 0.9


@pytest.mark.slow
@pytest.mark.timeout(14400)
def test_the_common_scale_of_harder_robots(tmp_path):
    found = [j for _, j in judged(harder, HARDER, tmp_path)]
    off = np.abs([j.scale - 1 for j in found])
    within = off <= 1.96 * np.array([j.scale_sd for j in found])
    inside, error = (np.array([getattr(j, k) for j in found]) for k in ("inside", "error"))
    print(f"scale within 3 %: {np.sum(off <= 0.03)} of {len(off)}, within its interval "
          f"{within.sum()}; >= 88 % of lines inside in {np.sum(inside >= 0.88)}; error <= 5 % in "
          f"{np.sum(error <= 0.05)}")  # fmt: skip
    assert np.mean(off <= 0.03) >= 0.8
    assert np.mean(within) >= 0.93
    assert np.mean(inside >= 0.88) >= 0.93
    assert np.mean(error <= 0.05) >= 0.93


@pytest.mark.slow
@pytest.mark.timeout(14400)
def test_a_forgotten_tool_is_named(tmp_path):
    found = [j for _, j in judged(forgotten, FORGOTTEN, tmp_path)]
    named = [any(n.startswith("added_mass") for n in j.named) for j in found]
    error = np.array([j.error for j in found])
    print(f"named in {sum(named)} of {len(named)}; error median {100 * np.median(error):.1f} %")
    sds = np.array([j.tool_sds for j in found])
    sds = np.abs(sds[np.isfinite(sds)])
    print(f"error <= 5 % in {np.sum(error <= 0.05)}, masses within 2 sd in {np.sum(sds <= 2)} of "
          f"{len(sds)}")  # fmt: skip
    assert np.mean(sds <= 2) >= 0.85
    assert np.mean(named) >= 0.9
    assert np.mean(error <= 0.05) >= 0.9
