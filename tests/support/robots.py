"""A robot that is not the shipped one: a small arm with the proportions of a KUKA KR10 R1100.

Joint placements are those of public descriptions of that arm (Apache-2.0); masses are made up.
"""

from pathlib import Path

import numpy as np

ORIGINS = [(0, 0, 0.4), (0.025, 0, 0), (0.56, 0, 0), (0, 0, 0.035), (0.515, 0, 0), (0.08, 0, 0)]
AXES = [(0, 0, -1), (0, 1, 0), (0, 1, 0), (-1, 0, 0), (0, 1, 0), (-1, 0, 0)]
LIMITS_DEG = [(-170, 170), (-190, 45), (-120, 156), (-185, 185), (-120, 120), (-350, 350)]
MASSES = [9.0, 12.0, 8.0, 4.0, 2.0, 3.5]
COMS = [(0, 0, -0.08), (0.25, 0, 0), (0.08, 0, 0.03), (0.25, 0, 0), (0.04, 0, 0), (0.06, 0.01, 0)]
STIFFNESS = [6.0e4, 8.0e4, 4.5e4, 1.2e4, 1.0e4, 6.0e3]
JOINTS_DEG = [(-40, 40), (-110, -50), (60, 120), (-30, 30), (10, 70), (-30, 30)]
BAND_HZ = (5.0, 110.0)


def _box(size: tuple[float, float, float], at: tuple[float, float, float]) -> str:
    shape = " ".join(map(str, size))
    place = " ".join(map(str, at))
    geometry = f'<origin xyz="{place}"/><geometry><box size="{shape}"/></geometry>'
    return f"<visual>{geometry}</visual><collision>{geometry}</collision>"


def urdf() -> str:
    """The arm's URDF with boxes as collision shapes."""
    boxes = [
        _box((0.16, 0.2, 0.2), (0, 0, -0.1)),
        _box((0.4, 0.12, 0.12), (0.22, 0, 0)),
        _box((0.16, 0.14, 0.14), (0.0, 0, 0.02)),
        _box((0.28, 0.09, 0.09), (0.3, 0, 0)),
        _box((0.06, 0.06, 0.06), (0.02, 0, 0)),
        _box((0.1, 0.06, 0.06), (0.06, 0, 0)),
    ]
    text = ['<robot name="small_arm">', '<link name="base_link">']
    text += [_box((0.3, 0.3, 0.2), (0, 0, 0.1)), "</link>"]
    for i in range(6):
        m, (x, y, z) = MASSES[i], COMS[i]
        inertia = m * np.array([0.006, 0.02, 0.022])
        text.append(
            f'<link name="link_{i + 1}"><inertial><origin xyz="{x} {y} {z}" rpy="0.1 0 0.2"/>'
            f'<mass value="{m}"/><inertia ixx="{inertia[0]}" iyy="{inertia[1]}" '
            f'izz="{inertia[2]}" ixy="0" ixz="0" iyz="0"/></inertial>{boxes[i]}</link>'
        )
        low, high = np.deg2rad(LIMITS_DEG[i])
        text.append(
            f'<joint name="joint_a{i + 1}" type="revolute">'
            f'<parent link="{"base_link" if i == 0 else f"link_{i}"}"/>'
            f'<child link="link_{i + 1}"/><origin xyz="{" ".join(map(str, ORIGINS[i]))}"/>'
            f'<axis xyz="{" ".join(map(str, AXES[i]))}"/>'
            f'<limit lower="{low}" upper="{high}" velocity="4" effort="0"/></joint>'
        )
    for name, place in (("tool", "0.16 0.02 0"), ("accelerometer", "0.12 -0.03 0.02")):
        text.append(
            f'<link name="{name}"/><joint name="{name}_fixed" type="fixed"><parent link="link_6"/>'
            f'<child link="{name}"/><origin xyz="{place}" rpy="0 1.5707963267948966 0"/></joint>'
        )
    return "\n".join([*text, "</robot>"])


def make_arm(directory: Path, transverse: bool = False) -> Path:
    """Write the robot folder; returns the path of robot.toml. 6 elastic rotations, or 12."""
    directory.mkdir(parents=True, exist_ok=True)
    (directory / "arm.urdf").write_text(urdf())
    lines = [
        'name = "small arm"', 'urdf = "arm.urdf"', 'tcp_frame = "tool"',
        'sensor_frame = "accelerometer"', "gravity = [0.0, 0.0, -9.81]",
        f"band_hz = {list(BAND_HZ)}",
    ]  # fmt: skip
    for i in range(6):
        across = (1.0, 0.0, 0.0) if AXES[i][0] == 0 else (0.0, 1.0, 0.0)
        springs = [(tuple(abs(a) for a in AXES[i]), STIFFNESS[i])]
        springs += [(across, 4 * STIFFNESS[i])] if transverse else []
        for axis, k in springs:
            lines += ["[[compliance]]", f'joint = "joint_a{i + 1}"', f"axis = {list(axis)}"]
            lines += [f"stiffness = {k}", f"damping = {3.0e-4 * k}"]
    lines += ["[[obstacle]]", 'name = "floor"', "center_m = [0, 0, -0.06]", "size_m = [4, 4, 0.1]"]
    path = directory / "robot.toml"
    path.write_text("\n".join(lines) + "\n")
    return path


def campaign_text(count: int = 4) -> str:
    """A campaign over a 6-D joint box."""
    return (
        'robot = "../robot/robot.toml"\n'
        f"[workspace]\njoints_deg = {[list(r) for r in JOINTS_DEG]}\n"
        f"[modes]\ncount = {count}\nband_hz = {list(BAND_HZ)}\n"
        '[acquisition]\nname = "integrated_variance"\ncandidates = 200\n'
    )
