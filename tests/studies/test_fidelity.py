"""What a low fidelity that learns is worth: updated, frozen and no simulation, error by hits.

`pytest -m slow tests/studies/test_fidelity.py -s` prints all curves; STARTS=20 for more of them.
Truths are MuJoCo models; everything goes through hammer hits, FRFs and identified modes.
"""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from known_robots import IRB6640, KR10, KnownRobot
from planner.campaign.cell import Cell
from planner.campaign.config import config_from_builtins
from planner.campaign.logged import from_modal
from planner.campaign.model import build
from planner.campaign.state import CampaignState, Measurement
from planner.frf.estimate import estimate
from planner.frf.types import Frf
from planner.modes.estimate import estimate_modes
from planner.truth.deviation import Deviation, Spring
from planner.truth.hits import Hammer
from planner.truth.model import load_truth
from true_modes import hits_at

pytestmark = [pytest.mark.slow, pytest.mark.timeout(3000)]
STARTS = int(os.environ.get("STARTS", "5"))
COUNTS = (1, 2, 3, 4, 6, 8, 12)
POOL, UNUSED, MODES = 30, 60, 4


@dataclass(frozen=True, eq=False)
class Pool:
    """Measured poses of one true robot, and the true frequencies (u, 4) at unused poses."""

    toml: Path
    joints_deg: tuple[tuple[float, float], ...]
    band_hz: tuple[float, float]
    measurements: tuple[Measurement, ...]
    frfs: dict[str, Frf]
    unused: np.ndarray  # (u, 6) rad
    true_hz: np.ndarray


def pool(robot: KnownRobot, directory: Path, lacking: bool, seed: int) -> Pool:
    """`lacking`: the simulation has torsion springs only, the truth tilts and a soft floor too."""
    full = robot.write(directory / "full", 2)
    toml = robot.write(directory / "robot", 1) if lacking else full
    soft = 25 * max(robot.torsion)
    floor = tuple(Spring("base", axis, soft, 3e-4 * soft) for axis in ((1.0, 0, 0), (0, 1.0, 0)))
    off = Deviation(seed, 0.15, 0.15, 0.05, 0.005, extra=floor if lacking else ())
    truth = load_truth(full, off)
    rng = np.random.default_rng(seed)
    low, high = np.deg2rad(np.transpose(robot.joints_deg))
    poses, unused = rng.uniform(low, high, (POOL, 6)), rng.uniform(low, high, (UNUSED, 6))
    hammer = Hammer(peak_n=300, duration_s=0.004, sampling_rate_hz=640, record_s=2.4)
    band = robot.band_hz[0], 0.4 * robot.band_hz[1]
    measured, frfs = [], {}
    for i, q in enumerate(poses):
        frf = estimate(hits_at(truth, q, hammer, np.random.default_rng([seed, i])), band)
        modal = from_modal(estimate_modes(frf, band))
        frfs[f"P{i}"] = frf
        measured.append(Measurement(f"P{i}", tuple(np.rad2deg(q)), (), modal))
    true_hz = np.array([truth.modes(q, MODES)[0] for q in unused])
    return Pool(toml, robot.joints_deg, band, tuple(measured), frfs, unused, true_hz)


def cell_of(p: Pool, simulation: str) -> Cell:
    table = {
        "robot": str(p.toml),
        "workspace": {"joints_deg": [list(r) for r in p.joints_deg]},
        "modes": {"count": MODES, "band_hz": list(p.band_hz)},
        "fidelity": {"simulation": simulation},
        "acquisition": {"candidates": 50},
    }
    return Cell.load(p.toml, config_from_builtins(table))


def curve(p: Pool, cell: Cell, start: int) -> tuple[list[float], list[float]]:
    """RMSE in % and share inside 95 % intervals after COUNTS measurements in random order."""
    order = np.random.default_rng(start).permutation(len(p.measurements))
    errors, inside = [], []
    for n in COUNTS:
        used = [p.measurements[i] for i in order[:n]]
        state = CampaignState(measurements={m.pose: m for m in used})
        model = build(cell, state, lambda m, _: p.frfs[m.pose])
        found = model.predict(p.unused)
        order_hz = np.sort(found.frequency_hz, axis=1)
        errors.append(100 * float(np.sqrt(np.mean(np.log(order_hz / p.true_hz) ** 2))))
        off = np.abs(found.frequency_hz - p.true_hz) / found.frequency_sd_hz
        inside.append(float(np.mean(off < 1.96)))
    return errors, inside


CASES = {
    "KR10, right structure": (KR10, False, 1),
    "IRB 6640, right structure": (IRB6640, False, 2),
    "KR10, simulation lacks tilts and floor": (KR10, True, 3),
}


@pytest.mark.parametrize("name", CASES)
def test_curves(name, tmp_path):
    robot, lacking, seed = CASES[name]
    p = pool(robot, tmp_path, lacking, seed)
    print(
        f"\n{name}: median RMSE in % (95 % intervals hold, %) over {STARTS} starts, 6-D joint box"
    )
    print("  hits         " + "".join(f"{n:>14}" for n in COUNTS))
    medians = {}
    for simulation in ("updated", "frozen", "none"):
        cell = cell_of(p, simulation)
        runs = [curve(p, cell, start) for start in range(STARTS)]
        error = np.median([r[0] for r in runs], axis=0)
        inside = 100 * np.mean([r[1] for r in runs], axis=0)
        medians[simulation] = error
        cells = "".join(f"{e:>8.2f} ({i:3.0f})" for e, i in zip(error, inside, strict=True))
        print(f"  {simulation:<12}{cells}")
    at = {n: i for i, n in enumerate(COUNTS)}
    if lacking:
        assert np.all(medians["updated"] <= 1.1 * medians["none"])
    else:
        assert medians["updated"][at[4]] <= 1.0
        assert medians["updated"][at[4]] <= medians["frozen"][at[4]]
