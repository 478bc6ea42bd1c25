"""A robot that is not the shipped one: a small arm with the proportions of a KUKA KR10 R1100.

Joint placements are those of public descriptions of that arm (Apache-2.0); masses are made up.
"""

from pathlib import Path

import numpy as np

from planner.proof import descriptions

ORIGINS = [(0, 0, 0.4), (0.025, 0, 0), (0.56, 0, 0), (0, 0, 0.035), (0.515, 0, 0), (0.08, 0, 0)]
AXES = [(0, 0, -1), (0, 1, 0), (0, 1, 0), (-1, 0, 0), (0, 1, 0), (-1, 0, 0)]
LIMITS_DEG = [(-170, 170), (-190, 45), (-120, 156), (-185, 185), (-120, 120), (-350, 350)]
MASSES = [9.0, 12.0, 8.0, 4.0, 2.0, 3.5]
COMS = [(0, 0, -0.08), (0.25, 0, 0), (0.08, 0, 0.03), (0.25, 0, 0), (0.04, 0, 0), (0.06, 0.01, 0)]
STIFFNESS = [6.0e4, 8.0e4, 4.5e4, 1.2e4, 1.0e4, 6.0e3]
JOINTS_DEG = [(-40, 40), (-110, -50), (60, 120), (-30, 30), (10, 70), (-30, 30)]
BAND_HZ = (5.0, 110.0)


BOXES = [
    ((0.16, 0.2, 0.2), (0, 0, -0.1)), ((0.4, 0.12, 0.12), (0.22, 0, 0)),
    ((0.16, 0.14, 0.14), (0.0, 0, 0.02)), ((0.28, 0.09, 0.09), (0.3, 0, 0)),
    ((0.06, 0.06, 0.06), (0.02, 0, 0)), ((0.1, 0.06, 0.06), (0.06, 0, 0)),
]  # fmt: skip


def urdf() -> str:
    """The arm's URDF with boxes as collision shapes."""
    parts = [descriptions.link("base_link", descriptions.box((0.3, 0.3, 0.2), (0, 0, 0.1)))]
    for i, (mass, com, box) in enumerate(zip(MASSES, COMS, BOXES, strict=True)):
        moments = mass * np.array([0.006, 0.02, 0.022])
        inertial = descriptions.inertial(mass, com, moments, (0.1, 0, 0.2))
        parts.append(descriptions.link(f"link_{i + 1}", inertial, descriptions.box(*box)))
        parent, limits = "base_link" if i == 0 else f"link_{i}", np.deg2rad(LIMITS_DEG[i])
        names = f"joint_a{i + 1}", parent, f"link_{i + 1}"
        parts.append(descriptions.joint(*names, ORIGINS[i], AXES[i], limits, 4))
    for name, place in (("tool", (0.16, 0.02, 0)), ("accelerometer", (0.12, -0.03, 0.02))):
        parts.append(descriptions.frame(name, "link_6", place, (0, np.pi / 2, 0)))
    return descriptions.urdf("small_arm", parts)


def make_arm(directory: Path, transverse: bool = False) -> Path:
    """Write the robot folder; returns the path of robot.toml. 6 elastic rotations, or 12."""
    gravity = "gravity = [0.0, 0.0, -9.81]"
    lines = descriptions.head("small arm", "arm.urdf", "tool", "accelerometer", BAND_HZ, gravity)
    for i, (axis, k) in enumerate(zip(AXES, STIFFNESS, strict=True)):
        across = (1.0, 0.0, 0.0) if axis[0] == 0 else (0.0, 1.0, 0.0)
        springs = [(tuple(map(abs, axis)), k), (across, 4 * k)][: 1 + transverse]
        lines += [descriptions.compliance(f"joint_a{i + 1}", a, k, 3.0e-4) for a, k in springs]
    lines += ["[[obstacle]]", 'name = "floor"', "center_m = [0, 0, -0.06]", "size_m = [4, 4, 0.1]"]
    return descriptions.write_robot(directory, "arm.urdf", urdf(), lines)


def campaign_text(count: int = 4) -> str:
    """A campaign over a 6-D joint box."""
    more = 'name = "integrated_variance"\ncandidates = 200\n'
    text = descriptions.campaign(JOINTS_DEG, count, BAND_HZ, more)
    return f'robot = "../robot/robot.toml"\n{text}'
