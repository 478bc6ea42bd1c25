"""Why inertias may err by default, on the KR240 with 18 springs: pytest -m slow -s tests/fit

The truth is the other engine's (MuJoCo): stiffness and damping off by 15 %, masses and moments of
inertia by 4 %, centres of mass by 5 mm. Hammer hits with noise at 6 or 9 poses go through files,
screening and FRF estimation; judged are 20 other poses, without noise.
"""

from pathlib import Path

import numpy as np
import pytest

from planner.dataset.dataset import Dataset
from planner.demo import shipped
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Priors
from planner.fit.identify import identify
from planner.measurement.agreement import fit_similarity
from planner.robot.robot import Robot
from planner.truth.deviation import Deviation
from planner.truth.hits import record_poses
from planner.truth.load import load_truth
from tests.support.measured_frfs import measured_frfs

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

TOML = shipped("kr240_busch2020") / "robot" / "robot.toml"
BOX_DEG = np.array([(-60, 60), (-110, -50), (50, 120), (-60, 60), (-100, -30), (-90, 90)], float)
LINES = np.arange(4.0, 60.0, 0.25)
SEEDS = range(5)
PRIORS = {"known": Priors(), "uncertain": Priors(mass=0.05, inertia=0.05, com_m=0.01)}


def poses(n: int, seed: int) -> np.ndarray:
    low, high = np.deg2rad(BOX_DEG).T
    return np.random.default_rng(seed).uniform(low, high, (n, 6))


OTHERS = poses(20, 900)


def one(folder: Path, n: int, seed: int, simulation: Simulation) -> dict[str, tuple]:
    """Result and similarity at the other poses, by priors, and the nominal simulation's."""
    scatter = Deviation(seed=seed, stiffness=0.15, damping=0.15, inertia=0.04, com_m=0.005)
    truth, robot = load_truth(TOML, scatter), simulation.robot
    named = [(f"P{i}", row) for i, row in enumerate(poses(n, seed))]
    record_poses(truth, named, folder, repeats=3, seed=seed)
    recorded = Dataset.read(folder, robot)
    silent = measured_frfs(truth, OTHERS, LINES, 1e-9)
    found = {"nominal": (None, fit_similarity(simulation, silent, OTHERS), None)}
    for name, priors in PRIORS.items():
        told = identify(recorded.frfs, recorded.q, simulation, priors, extend=False)
        result = told.identified
        true = [getattr(truth.springs[e.blocks[0]], e.kind) for e in result.estimates]
        error = np.log([e.value for e in result.estimates]) - np.log(true)
        found[name] = result, fit_similarity(result.simulation, silent, OTHERS), error
    return found


@pytest.mark.parametrize("n", [6, 9])
def test_uncertain_inertias_are_better_at_other_poses(tmp_path, n):
    simulation = Simulation(Robot.load(TOML))
    print(
        f"\n{n} poses hit, {len(OTHERS)} others judged\nseed inertias   misfit  FRAC %  "
        "Frobenius %  stiffness: median error %  95 % intervals hold"
    )
    runs = [one(tmp_path / str(seed), n, seed, simulation) for seed in SEEDS]
    for seed, found in zip(SEEDS, runs, strict=True):
        for name, (result, other, error) in found.items():
            text = f"{seed:4d} {name:9s}"
            agreement = f"{100 * other.frac:8.4f} {100 * other.frobenius:9.2f}"
            if result is None:
                print(f"{text} {'':8s} {agreement}")
                continue
            stiffness = 100 * np.median(np.abs(error[: len(error) // 2]))
            held = np.mean(np.abs(error) < 1.96 * np.array([e.log_sd for e in result.estimates]))
            print(f"{text} {result.misfit:8.2f} {agreement} {stiffness:20.2f} {100 * held:24.0f} %")
    errors = np.concatenate([found["uncertain"][2] for found in runs])
    sds = np.array([e.log_sd for found in runs for e in found["uncertain"][0].estimates])
    held = np.mean(np.abs(errors) < 1.96 * sds)
    print(f"95 % intervals hold, inertias uncertain: {100 * held:.1f} %")
    assert held > 0.85
    for found in runs:
        known, uncertain = found["known"], found["uncertain"]
        assert uncertain[1].frac > 0.99
        assert 1 - uncertain[1].frac < 0.1 * (1 - known[1].frac)
        assert uncertain[1].frobenius > known[1].frobenius > found["nominal"][1].frobenius
        assert uncertain[0].misfit < 1.2 < known[0].misfit
        assert np.median(np.abs(uncertain[2])) < np.median(np.abs(known[2]))
