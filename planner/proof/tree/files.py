"""robot.toml, robot.urdf, recordings.csv, predict.csv and UFF 58 files."""

import warnings
from pathlib import Path

import numpy as np
import pyuff

from planner.proof.tree.hits import Clock, Hit
from planner.proof.tree.layouts import Robot
from planner.proof.tree.spatial import inertia_of, to_rpy
from planner.proof.tree.tree import Body


def _numbers(values) -> str:
    return " ".join(f"{v:.12g}" for v in values)


def _inertial(body: Body) -> str:
    tensor = inertia_of(body.second)
    names = (
        ("ixx", 0, 0),
        ("iyy", 1, 1),
        ("izz", 2, 2),
        ("ixy", 0, 1),
        ("ixz", 0, 2),
        ("iyz", 1, 2),
    )
    cells = " ".join(f'{n}="{tensor[i, j]:.12g}"' for n, i, j in names)
    return (
        f'<inertial><origin xyz="{_numbers(body.centre)}" rpy="0 0 0"/>'
        f'<mass value="{body.mass:.12g}"/><inertia {cells}/></inertial>'
    )


def _origin(place, rotation) -> str:
    return f'<origin xyz="{_numbers(place)}" rpy="{_numbers(to_rpy(rotation))}"/>'


def write_urdf(path: Path, robot: Robot) -> None:
    """Kinematics, limits, inertias, and the fixed frames tcp and sensor."""
    lines = ['<?xml version="1.0"?>', f'<robot name="{robot.name}">']
    lines.append(f'  <link name="base_link">{_inertial(robot.base)}</link>')
    parent = "base_link"
    for i, (joint, body) in enumerate(zip(robot.joints, robot.links, strict=True), 1):
        lines.append(f'  <link name="link_{i}">{_inertial(body)}</link>')
        lines.append(
            f'  <joint name="{joint.name}" type="revolute"><parent link="{parent}"/>'
            f'<child link="link_{i}"/>{_origin(joint.place, joint.rotation)}'
            f'<axis xyz="{_numbers(joint.axis)}"/><limit lower="{joint.lower:.9g}" '
            f'upper="{joint.upper:.9g}" velocity="{2.0 + 0.2 * i:.3g}" effort="0"/></joint>'
        )
        parent = f"link_{i}"
    rotation, place = robot.tool
    for name, where in (("tcp", place), ("sensor", robot.sensor)):
        lines.append(
            f'  <link name="{name}"/>\n  <joint name="{name}_fixed" type="fixed">'
            f'<parent link="{parent}"/><child link="{name}"/>{_origin(where, rotation)}</joint>'
        )
    path.write_text("\n".join([*lines, "</robot>", ""]), encoding="utf-8")


def write_toml(path: Path, robot: Robot, chances: dict[str, dict[str, float]]) -> None:
    """The elastic part as stated; `chances`: tables of standard deviations, if they are stated."""
    lines = [
        "# Simulated robot, drawn at random.", f'name = "{robot.name}"', 'urdf = "robot.urdf"',
        'tcp_frame = "tcp"', 'sensor_frame = "sensor"',
        f"gravity = [0.0, 0.0, {robot.gravity[2]}]",
        f"band_hz = [{robot.band[0]}, {robot.band[1]}]",
    ]  # fmt: skip
    for j, joint in enumerate(robot.joints):
        springs = [(joint.axis, robot.gears[j]), *(robot.cross or {}).get(j, ())]
        for axis, spring in springs:
            cells = ", ".join(f"{v + 0.0:.12g}" for v in axis)
            lines += [
                "", "[[compliance]]", f'joint = "{joint.name}"', f"axis = [{cells}]",
                f"stiffness = {spring.stiffness:.6e}", f"damping = {spring.damping:.6e}",
            ]  # fmt: skip
    for table, cells in chances.items():
        lines += ["", f"[{table}]", *(f"{key} = {value:.3f}" for key, value in cells.items())]
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")


def _header(robot: Robot) -> str:
    return "pose," + ",".join(f"{j.name}_deg" for j in robot.joints)


def _angles(q: np.ndarray) -> str:
    return ",".join(f"{v:.4f}" for v in np.degrees(q))


def hit_file(hit: Hit) -> str:
    """Name of a hit's file inside the recordings folder."""
    return f"data/P{hit.pose + 1:02d}_{'xyz'[hit.axis]}_L{hit.level}_{hit.repeat}.uff"


def write_tables(
    folder: Path, robot: Robot, readback: np.ndarray, hits: list[Hit], wanted: np.ndarray
) -> None:
    """recordings.csv and predict.csv; angles (rad) as read back."""
    rows = [_header(robot) + ",hit,repeat,file"]
    for hit in hits:
        where = _angles(readback[hit.pose])
        rows.append(f"P{hit.pose + 1:02d},{where},{hit.name},{hit.repeat},{hit_file(hit)}")
    (folder / "recordings.csv").write_text("\n".join([*rows, ""]), encoding="utf-8")
    rows = [_header(robot), *(f"H{i:02d},{_angles(q)}" for i, q in enumerate(wanted, 1))]
    (folder / "predict.csv").write_text("\n".join([*rows, ""]), encoding="utf-8")


def write_hit(path: Path, hit: Hit, clock: Clock, force: np.ndarray, answer: np.ndarray) -> None:
    """Force (N) and accelerations (3, n) (m/s2) as four time histories of one UFF 58b file."""
    direction = (hit.axis + 1) * hit.sign
    time = np.arange(clock.samples) / clock.rate
    sets = []
    for number, samples in enumerate((force, *answer)):
        sets.append(pyuff.prepare_58(
            binary=1, func_type=1, rsp_node=1, rsp_dir=number or direction, ref_node=1,
            ref_dir=direction, data=samples, x=time, id1="SIMULATED, not measured",
            id2="rigid links on springs", id3=f"pose P{hit.pose + 1:02d}, hit {hit.name}",
            rsp_ent_name="sensor" if number else "hammer", ref_ent_name="hammer",
            abscissa_spacing=1, abscissa_min=0.0, abscissa_inc=1 / clock.rate,
            abscissa_spec_data_type=17, abscissa_axis_units_lab="s",
            ordinate_spec_data_type=12 if number else 13,
            ordinate_axis_units_lab="m/s^2" if number else "N", orddenom_spec_data_type=0,
        ))  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path.unlink(missing_ok=True)
        pyuff.UFF(str(path)).write_sets(sets, "add")
