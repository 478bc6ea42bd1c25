"""Metrics and FRF map of a path of the shipped campaign, from files to figures."""

import os
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from planner.dataset.measure import measure
from planner.dataset.screened_files import Source
from planner.demo import Pool, shipped
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.frf.metrics import Agreement, agreement, direct_mean, mean_known, stack
from planner.report.frf_plots import frf_map
from planner.report.pictures import save
from planner.robot.robot import Robot

BAND_HZ = (4.0, 60.0)
PATHS = {"along y": [f"A3{j}" for j in range(1, 8)], "along x": [f"A{i}3" for i in range(1, 6)]}


def recorded(pool: Pool, pose: str) -> Frf:
    """FRF matrix of one recorded pose; each pose has frequency lines of its own."""
    sources = tuple(Source(r.file, str(r.file), r.hit) for r in pool.rows[pose] if r.file)
    frf = measure(sources, BAND_HZ).frf
    assert frf is not None
    return frf


def compared(frfs: list[Frf], others: list[np.ndarray]) -> Agreement:
    return stack(
        [
            agreement(frf.accelerance[None], other[None], frf.frequency_hz, BAND_HZ)
            for frf, other in zip(frfs, others, strict=True)
        ]
    )


@pytest.mark.slow
def test_measured_against_truth_and_simulation(tmp_path, truth_of_the_campaign):
    """SIMULATED recordings: the truth that made them must agree better than the simulation."""
    robot = Robot.load(shipped("kr240_plane") / "robot" / "robot.toml")
    pool = Pool.load(shipped("kr240_plane") / "recordings", robot.joint_names)
    simulation = Simulation(robot)
    for name, poses in PATHS.items():
        q, frfs = pool.q(poses), [recorded(pool, pose) for pose in poses]
        rows = list(zip(q, frfs, strict=True))
        simulated = [simulation.accelerance(row, frf.frequency_hz)[0] for row, frf in rows]
        true = [truth_of_the_campaign.accelerance(row, frf.frequency_hz) for row, frf in rows]
        exact, nominal = compared(frfs, true), compared(frfs, simulated)
        print(f"\n{name}: Global FRAC, Frobenius similarity, complex FRAC (mean of xx, yy, zz)")
        for label, found in (("truth", exact), ("simulation", nominal)):
            print(f"  {label:10}", *(f"{value:.3f}" for value in figures(found)))
        assert min(figures(exact)) > 0.97
        assert np.all(np.array(figures(exact)) - figures(nominal) > 0.05)
        folder = Path(os.environ.get("PLANNER_PLOTS", tmp_path))
        folder.mkdir(parents=True, exist_ok=True)
        figure = drawn(name, frfs, simulated)
        save(figure, folder / f"map_{name.replace(' ', '_')}.png")


def drawn(name: str, frfs: list[Frf], simulated: list[np.ndarray]) -> Figure:
    lines = np.linspace(*BAND_HZ, 250)
    pair = [
        np.array([np.interp(lines, frf.frequency_hz, np.abs(h[1, 1])) for frf, h in rows])
        for rows in (
            [(frf, frf.accelerance) for frf in frfs],
            list(zip(frfs, simulated, strict=True)),
        )
    ]
    number = np.arange(1, len(frfs) + 1)
    return frf_map(number, pair[0], pair[1], lines, "pose", f"SIMULATED, {name}, yy")


def figures(found: Agreement) -> list[float]:
    with_phase = mean_known(found.complex_frac, axis=0)
    return [direct_mean(v) for v in (found.global_frac, found.frobenius, with_phase)]


@pytest.fixture
def truth_of_the_campaign():
    import importlib.util

    from planner.truth.load import load_truth

    folder = shipped("kr240_plane")
    spec = importlib.util.spec_from_file_location("regenerate", folder / "regenerate.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return load_truth(folder / "robot" / "robot.toml", module.DEVIATION)
