"""An arm of four joints without meshes, with points from its base to its wrist."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from planner.proof import descriptions
from planner.proof.fault_injection import HitVisit, InjectedFaults, hit_poses
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.proof.measurement_errors import LABORATORY, MeasurementErrors
from planner.proof.model import Truth
from planner.proof.recordings import write_recordings

NODES = {"foot": 11, "shoulder": 12, "elbow": 13, "sensor": 16}
POINTS = (
    ("foot", "floor", (0.2, 0.0, 0.1), (0.0, 0.0, 30.0)),
    ("shoulder", "l1", (0.15, 0.1, 0.15), (0.0, 90.0, 0.0)),
    ("elbow", "l2", (0.0, 0.12, 0.65), (20.0, 0.0, 10.0)),
)
AXES = ("z", "y", "y", "x")
STEPS = ((0, 0, 0.3), (0.12, 0, 0.2), (0, 0, 0.7), (0.1, 0, 0.1))
MASSES = ((60, (0, 0, 0.1), (2, 2, 1.5)), (45, (0, 0.05, 0.35), (2.2, 2.2, 0.3)),
          (30, (0.08, 0, 0.05), (0.5, 0.6, 0.5)), (12, (0.25, 0, 0), (0.1, 0.5, 0.5)))  # fmt: skip
STIFFNESS = (9e5, 7e5, 4e5, 9e4)
BAND_HZ = 4.0, 90.0


def _urdf() -> str:
    parts = [descriptions.link("floor", descriptions.inertial(120, (0, 0, 0.1), (4, 4, 4)))]
    parent = "floor"
    for i, (body, axis, step) in enumerate(zip(MASSES, AXES, STEPS, strict=True), 1):
        parts.append(descriptions.link(f"l{i}", descriptions.inertial(*body)))
        along = [int(axis == a) for a in "xyz"]
        parts.append(descriptions.joint(f"a{i}", parent, f"l{i}", step, along, (-2.5, 2.5)))
        parent = f"l{i}"
    parts += [descriptions.frame("tcp", parent, (0.5, 0, 0))]
    parts += [descriptions.frame("sensor", parent, (0.5, 0.03, 0.02))]
    return descriptions.urdf("arm", parts)


def write_arm(folder: Path, more: str = "") -> Path:
    """robot.toml of the arm, beside its URDF; `more` is added to its points."""
    lines = descriptions.head("arm", "arm.urdf", "tcp", "sensor", BAND_HZ)
    for i, (axis, k) in enumerate(zip(AXES, STIFFNESS, strict=True), 1):
        along = [float(axis == a) for a in "xyz"]
        lines.append(descriptions.compliance(f"a{i}", along, k, 3e-4))
    for name, link, place, turned in POINTS:
        lines.append(f'[[point]]\nname = "{name}"\nlink = "{link}"\nposition_m = {list(place)}')
        lines.append(f"rpy_deg = {list(turned)}\nnode = {NODES[name]}")
    lines.append(f'[[point]]\nname = "sensor"\nnode = {NODES["sensor"]}')
    return descriptions.write_robot(folder, "arm.urdf", _urdf(), [*lines, more])


def poses(count: int, seed: int = 1) -> np.ndarray:
    """(count, 4) in rad."""
    rng = np.random.default_rng(seed)
    low, high = np.array([-60.0, -40, 20, -50]), np.array([60.0, 30, 100, 50])
    return np.deg2rad(np.round(rng.uniform(low, high, (count, 4)), 3))


def record(
    folder: Path,
    robot_toml: Path,
    stays: Sequence[tuple[str, np.ndarray, str, tuple[str, ...]]],
    injected: InjectedFaults,
    errors: MeasurementErrors = LABORATORY,
    seed: int = 0,
    dead: dict[str, int] | None = None,
) -> Truth:
    """Hits along x, y, z at stays: pose, q in rad, hit point, sensors; the truth behind them.

    `dead` names channels that recorded nothing, by pose.
    """
    rng, truth = np.random.default_rng(seed), load_truth(robot_toml, injected.deviation)
    hammer = Hammer(peak_n=250.0, noise=0.004)
    shots = [(f"+{axis}", 250.0) for axis in "xyz"]
    visits = [
        HitVisit(q, shots, 0.0, errors.aims([0, 1, 2], rng), point, sensors)
        for _, q, point, sensors in stays
    ]
    found = hit_poses(truth, injected, visits, hammer, rng)
    for (name, *_), hits in zip(stays, found, strict=True):
        for hit in hits if dead and name in dead else ():
            hit.acceleration_m_s2[dead[name]] = 0.0
    rows = [(name, np.rad2deg(q), hits) for (name, q, *_), hits in zip(stays, found, strict=True)]
    write_recordings(folder, truth.joint_names, rows, hammer, truth.description, NODES)
    return truth
