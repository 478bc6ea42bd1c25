"""Labels of modes identified from simulated hits on true robots (MuJoCo), and who they are.

`pytest -m slow tests/studies/test_tracking.py -s` prints the share of right labels.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from known_robots import KR10
from planner.campaign.cell import Cell
from planner.campaign.config import load_campaign_config
from planner.modes.track import Guide, Tracks, track
from planner.physics.simulation import Simulation
from planner.robot.robot import Robot
from planner.truth.deviation import Deviation, Spring
from planner.truth.model import load_truth
from true_modes import Measured, measure_all

pytestmark = pytest.mark.slow
COUNT, ABOVE, POSES = 4, 2, 60
CAMPAIGN = Path(__file__).parents[2] / "campaigns" / "kr240_plane"
SOFT_FLOOR = (
    Spring("base", (1.0, 0.0, 0.0), 2.2e7, 1.8e4),
    Spring("base", (0.0, 1.0, 0.0), 1.9e7, 1.6e4),
)
SMALL_SOFT_FLOOR = (
    Spring("base", (1.0, 0.0, 0.0), 4e5, 1.5e2),
    Spring("base", (0.0, 1.0, 0.0), 5e5, 1.5e2),
)
# Waypoints on which modes of the true robot exchange places several times (chosen by its own
# frequencies, before anything was identified).
WAY_DEG = [
    (43, -105, 44, 0, 34, 0),
    (-13, -39, 86, 0, -49, 0),
    (-2, -41, 123, 0, 11, 0),
    (11, -96, 69, 0, -44, 0),
]


def kr240() -> tuple[Measured, Simulation, np.ndarray, np.ndarray]:
    """60 poses of the shipped workspace; the true robot is that of the shipped recordings."""
    toml = CAMPAIGN / "robot" / "robot.toml"
    seed = int(json.loads((CAMPAIGN / "truth.json").read_text())["engine"].split()[-1])
    off = Deviation(seed, stiffness=0.12, damping=0.15, inertia=0.04, com_m=0.005, extra=SOFT_FLOOR)
    cell = Cell.load(toml, load_campaign_config(CAMPAIGN / "campaign.toml"))
    candidates = cell.candidates
    chosen = np.random.default_rng(5).choice(len(candidates.q), POSES, replace=False)
    q = candidates.q[chosen]
    measured = measure_all(load_truth(toml, off), q, cell.config.modes.band_hz, COUNT, q[0])
    return measured, Simulation(Robot.load(toml)), q, candidates.features[chosen]


def kr10(directory: Path) -> tuple[Measured, Simulation, np.ndarray, np.ndarray]:
    """60 poses on a path of a KR10 with crossings."""
    toml = KR10.write(directory, 2)
    off = Deviation(11, 0.12, 0.15, 0.04, 0.005, extra=SMALL_SOFT_FLOOR)
    t, at = np.linspace(0, 1, POSES), np.linspace(0, 1, len(WAY_DEG))
    q = np.stack([np.interp(t, at, way) for way in np.deg2rad(np.transpose(WAY_DEG))], axis=1)
    measured = measure_all(load_truth(toml, off), q, KR10.band_hz, COUNT, q[0])
    span = np.ptp(q, axis=0)
    x = ((q - q.min(axis=0)) / np.where(span > 0, span, 1.0))[:, span > 0]
    return measured, Simulation(Robot.load(toml)), q, x


def wrong(measured: Measured, tracks: Tracks) -> list[str]:
    """What is not labelled as it truly is."""
    out = []
    for i, k in np.ndindex(*measured.partner.shape):
        j = measured.partner[i, k]
        true = measured.modes[i][j] if j >= 0 else None
        given = tracks.modes[i][k]
        if given is not true:
            said = "missing" if given is None else f"{given.frequency_hz:.2f} Hz"
            sure = 100 * tracks.probability[i, k]
            out.append(
                f"pose {i}: mode {k + 1} is at {measured.true_hz[i, k]:.2f} Hz, said: {said} "
                f"({sure:.0f} % sure)"
            )
    return out


def hide(measured: Measured, rng: np.random.Generator) -> Measured:
    """The same with one of the tracked modes not found at every third pose."""
    modes, partner = list(measured.modes), measured.partner.copy()
    for i in range(0, len(modes), 3):
        k = int(rng.integers(partner.shape[1]))
        j = partner[i, k]
        modes[i] = tuple(m for n, m in enumerate(modes[i]) if n != j)
        partner[i] = np.where(partner[i] > j, partner[i] - 1, partner[i])
        partner[i, k] = -1
    return Measured(tuple(modes), measured.place, measured.true_hz, partner)


@pytest.mark.parametrize("robot", ["KR240", "KR10"])
def test_share_of_right_labels(robot, tmp_path):
    measured, simulation, q, x = kr240() if robot == "KR240" else kr10(tmp_path)
    crossed = int(np.sum(np.any(np.diff(measured.place, axis=0) != 0, axis=1)))
    families = simulation.families(q[0], q)
    expected = simulation.followed(q, COUNT + ABOVE, families)
    guide = Guide(expected.frequency_hz, expected.shape)
    total = POSES * COUNT
    for name, case in (
        ("as measured", measured),
        ("every third pose with a hidden mode", hide(measured, np.random.default_rng(0))),
    ):
        bad = wrong(case, track(case.modes, guide, x))
        share = 100 * (1 - len(bad) / total)
        found = int(np.sum(case.partner >= 0))
        print(
            f"{robot}, {POSES} poses, {name}: {share:.1f} % of {total} labels right "
            f"({found} modes found, {crossed} exchanges of order between poses)"
        )
        print("\n".join(f"  {line}" for line in bad))
        assert share >= 98.0
    if robot == "KR10":
        assert crossed >= 2
