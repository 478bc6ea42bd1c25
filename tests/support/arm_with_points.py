"""An arm of four joints without meshes, with points from its base to its wrist."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from planner.proof.fault_injection import HitVisit, InjectedFaults, hit_poses
from planner.proof.hits import Hammer, write_recordings
from planner.proof.load import load_truth
from planner.proof.measurement_errors import LABORATORY, MeasurementErrors
from planner.proof.model import Truth

NODES = {"foot": 11, "shoulder": 12, "elbow": 13, "sensor": 16}
POINTS = (
    ("foot", "floor", (0.2, 0.0, 0.1), (0.0, 0.0, 30.0)),
    ("shoulder", "l1", (0.15, 0.1, 0.15), (0.0, 90.0, 0.0)),
    ("elbow", "l2", (0.0, 0.12, 0.65), (20.0, 0.0, 10.0)),
)
AXES, STEPS = ("z", "y", "y", "x"), ("0 0 .3", "0.12 0 .2", "0 0 .7", "0.1 0 .1")
MASSES = ((60, "0 0 .1", (2, 2, 1.5)), (45, "0 .05 .35", (2.2, 2.2, 0.3)),
          (30, "0.08 0 .05", (0.5, 0.6, 0.5)), (12, "0.25 0 0", (0.1, 0.5, 0.5)))  # fmt: skip
STIFFNESS = (9e5, 7e5, 4e5, 9e4)
BAND_HZ = 4.0, 90.0


def _link(name: str, mass: float, centre: str, moments: tuple[float, ...]) -> str:
    values = " ".join(f'i{a}{a}="{v}"' for a, v in zip("xyz", moments, strict=True))
    return (
        f'<link name="{name}"><inertial><origin xyz="{centre}"/><mass value="{mass}"/>'
        f'<inertia {values} ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def write_arm(folder: Path, more: str = "") -> Path:
    """robot.toml of the arm, beside its URDF; `more` is added to its points."""
    urdf, parent = _link("floor", 120, "0 0 .1", (4, 4, 4)), "floor"
    for i, ((mass, centre, moments), axis) in enumerate(zip(MASSES, AXES, strict=True), 1):
        xyz = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}[axis]
        urdf += _link(f"l{i}", mass, centre, moments)
        urdf += (
            f'<joint name="a{i}" type="revolute"><parent link="{parent}"/><child link="l{i}"/>'
            f'<origin xyz="{STEPS[i - 1]}"/><axis xyz="{xyz}"/>'
            f'<limit lower="-2.5" upper="2.5" effort="1" velocity="2"/></joint>'
        )
        parent = f"l{i}"
    for name, xyz in (("tcp", ".5 0 0"), ("sensor", ".5 .03 .02")):
        urdf += (
            f'<link name="{name}"/><joint name="{name}_f" type="fixed"><parent link="l4"/>'
            f'<child link="{name}"/><origin xyz="{xyz}"/></joint>'
        )
    folder.mkdir(parents=True, exist_ok=True)
    folder.joinpath("arm.urdf").write_text(f'<robot name="arm">{urdf}</robot>')
    text = 'name = "arm"\nurdf = "arm.urdf"\ntcp_frame = "tcp"\nsensor_frame = "sensor"\n'
    text += f"band_hz = {list(BAND_HZ)}\n"
    for i, (axis, k) in enumerate(zip(AXES, STIFFNESS, strict=True), 1):
        unit = [float(axis == a) for a in "xyz"]
        text += f'[[compliance]]\njoint = "a{i}"\naxis = {unit}\nstiffness = {k}\n'
        text += f"damping = {3e-4 * k}\n"
    for name, link, place, turned in POINTS:
        text += f'[[point]]\nname = "{name}"\nlink = "{link}"\nposition_m = {list(place)}\n'
        text += f"rpy_deg = {list(turned)}\nnode = {NODES[name]}\n"
    text += f'[[point]]\nname = "sensor"\nnode = {NODES["sensor"]}\n'
    path = folder / "robot.toml"
    path.write_text(text + more)
    return path


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
    rows = [
        (name, np.rad2deg(q), 1, hit)
        for (name, q, *_), hits in zip(stays, found, strict=True)
        for hit in hits
    ]
    write_recordings(folder, truth.joint_names, rows, hammer, truth.description, NODES)
    return truth
