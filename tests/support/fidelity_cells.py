"""Measured poses of true robots (MuJoCo) for the study of low fidelities, cell by cell."""

import json
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.campaign.cell import Cell
from planner.campaign.config import config_from_builtins, load_campaign_config
from planner.campaign.log_conversion import from_modal
from planner.campaign.state import Measurement
from planner.dataset.measure import frf_of, measure
from planner.dataset.screened_files import Source
from planner.demo import NAME, Pool, shipped
from planner.frf.estimator import estimate
from planner.frf.frf import Frf
from planner.modal.estimate_modes import estimate_modes
from planner.robot.robot import Robot
from planner.truth.deviation import AttachedMass, AttachedResonator, Deviation, Spring
from planner.truth.hits import Hammer
from planner.truth.load import load_truth
from planner.truth.model import Truth
from tests.support.known_robots import IRB6640, KR10, KR210, KnownRobot
from tests.support.true_modes import hits_at

POOL, UNUSED, MODES = 30, 60, 4
HAMMER = Hammer(peak_n=300, duration_s=0.004, sampling_rate_hz=640, record_s=2.4)


@dataclass(frozen=True, eq=False)
class MeasuredCell:
    """A cell per kind of low fidelity, its measured poses, and the truth (u, MODES) at q (u, 6)."""

    cells: Callable[[str], Cell]
    measurements: tuple[Measurement, ...]
    frfs: dict[str, Frf]
    unused: np.ndarray
    true_hz: np.ndarray
    among: bool = False  # the poses with known truth are the measured ones

    def scored(self, order: np.ndarray, most: int) -> np.ndarray:
        """Which of the poses with known truth are never used in this order."""
        return order[most:] if self.among else np.arange(len(self.unused))


def truth_of(
    robot: KnownRobot, directory: Path, deviation: Deviation, per_joint: int
) -> tuple[Path, Truth]:
    """robot.toml with `per_joint` springs a joint, and a truth that has two."""
    full = robot.write(directory / "full", 2)
    toml = full if per_joint == 2 else robot.write(directory / "robot", per_joint)
    return toml, load_truth(full, deviation)


def hit(
    truth: Truth, q: np.ndarray, name: str, band_hz: tuple[float, float], seed: int
) -> tuple[Measurement, Frf]:
    """Twelve hits at q (6,) in rad, through FRFs to modes; seeded by `seed` and the name."""
    rng = np.random.default_rng([seed, int(name[1:])])
    frf = estimate(hits_at(truth, q, HAMMER, rng), band_hz)
    modal = from_modal(estimate_modes(frf, band_hz))
    return Measurement(name, tuple(np.rad2deg(q)), (), modal), frf


def band_of(robot: KnownRobot) -> tuple[float, float]:
    """The part of the robot's band (Hz) that holds the lowest modes."""
    return robot.band_hz[0], 0.4 * robot.band_hz[1]


def cell_of(robot: KnownRobot, toml: Path, simulation: str) -> Cell:
    """A campaign over the robot's joint box."""
    table = {
        "robot": str(toml),
        "workspace": {"joints_deg": [list(r) for r in robot.joints_deg]},
        "modes": {"count": MODES, "band_hz": list(band_of(robot))},
        "fidelity": {"simulation": simulation},
        "acquisition": {"candidates": 50},
    }
    return Cell.load(toml, config_from_builtins(table))


def box(
    robot: KnownRobot, directory: Path, seed: int, deviation: Deviation, per_joint: int
) -> MeasuredCell:
    """Poses all over a 6-D joint box; the simulation has `per_joint` springs, the truth two."""
    toml, truth = truth_of(robot, directory, deviation, per_joint)
    rng = np.random.default_rng(seed)
    low, high = np.deg2rad(np.transpose(robot.joints_deg))
    poses, unused = rng.uniform(low, high, (POOL, 6)), rng.uniform(low, high, (UNUSED, 6))
    found = [hit(truth, q, f"P{i}", band_of(robot), seed) for i, q in enumerate(poses)]
    return MeasuredCell(
        lambda simulation: cell_of(robot, toml, simulation),
        tuple(measurement for measurement, _ in found),
        {measurement.pose: frf for measurement, frf in found},
        unused,
        np.array([truth.modes(q, MODES)[0] for q in unused]),
    )


def scatter(seed: int, **more: object) -> Deviation:
    """Springs and dampers ± 15 %, inertias ± 5 %, centres of mass ± 5 mm, and what is added."""
    return Deviation(seed, 0.15, 0.15, 0.05, 0.005, **more)  # pyright: ignore[reportArgumentType]


def right(robot: KnownRobot, directory: Path, seed: int) -> MeasuredCell:
    """The simulation has all the physics; only its numbers are off."""
    return box(robot, directory, seed, scatter(seed), 2)


def soft(robot: KnownRobot, seed: int) -> Deviation:
    """Scatter, and a floor that tilts."""
    stiffness = 25 * max(robot.torsion)
    axes = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    floor = tuple(Spring("base", axis, stiffness, 3e-4 * stiffness) for axis in axes)
    return scatter(seed, extra=floor)


def lacking(robot: KnownRobot, directory: Path, seed: int) -> MeasuredCell:
    """Torsion springs only; the truth tilts in every joint and stands on a soft floor."""
    return box(robot, directory, seed, soft(robot, seed), 1)


def foreign(robot: KnownRobot, directory: Path, seed: int) -> MeasuredCell:
    """The truth also bends in a link, slides on its floor, carries a lump and a hose pack."""
    spring = 2.0 * robot.torsion[1]
    bend = tuple(Spring("link_2", a, spring, 3e-4 * spring) for a in ((0, 1.0, 0), (0, 0, 1.0)))
    mass = sum(body.mass for body in robot.bodies)
    stiff = mass * (2 * np.pi * 1.5 * robot.band_hz[0]) ** 2
    slides = tuple(
        Spring("base", a, stiff, 3e-4 * stiff, slide=True) for a in ((1.0, 0, 0), (0, 1.0, 0))
    )
    lump = AttachedMass("link_3", (0.1, 0.1, -0.1), 0.06 * mass)
    hose = AttachedResonator("link_4", (0.05, 0.05, -0.1), (0.6, 0.8, 0.0), 0.03 * mass, 20.0, 0.02)
    left_out = scatter(seed, extra=(*bend, *slides), added=(lump,), resonators=(hose,))
    return box(robot, directory, seed, left_out, 1)


def plane() -> MeasuredCell:
    """The shipped campaign: 35 recorded poses of a plane, whose truth is in a file of its own."""
    source = shipped(NAME)
    toml = source / "robot" / "robot.toml"
    config = load_campaign_config(source / "campaign.toml")
    table = config.modes
    pool = Pool.load(source / "recordings", Robot.load(toml).joint_names)
    known = json.loads((source / "truth.json").read_text())["poses"]
    measured, frfs = [], {}
    for pose, rows in pool.rows.items():
        sources = tuple(Source(r.file, str(r.file), r.hit) for r in rows if r.file)
        modal = from_modal(measure(sources, table.band_hz).modal)
        measured.append(Measurement(pose, rows[0].joints_deg, (), modal))
        frfs[pose] = frf_of(sources, table.band_hz)
    q = pool.q(list(pool.rows))
    true_hz = np.array([known[pose]["frequency_hz"] for pose in pool.rows])

    def cells(simulation: str) -> Cell:
        changed = {"simulation": simulation}
        return Cell.load(toml, config_from_builtins({**_builtins(source), "fidelity": changed}))

    return MeasuredCell(cells, tuple(measured), frfs, q, true_hz, among=True)


def _builtins(source: Path) -> dict[str, object]:
    return tomllib.loads((source / "campaign.toml").read_text())


CELLS: dict[str, Callable[[Path], MeasuredCell]] = {
    "KR10, right structure": lambda folder: right(KR10, folder, 1),
    "IRB 6640, right structure": lambda folder: right(IRB6640, folder, 2),
    "KR10, lacks tilts and floor": lambda folder: lacking(KR10, folder, 3),
    "KR210, lacks tilts and floor": lambda folder: lacking(KR210, folder, 4),
    "IRB 6640, lacks links, slides, hose": lambda folder: foreign(IRB6640, folder, 5),
    "shipped plane": lambda _: plane(),
}
