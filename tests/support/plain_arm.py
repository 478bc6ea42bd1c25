"""A robot of four joints whose URDF has neither meshes nor collision elements."""

from pathlib import Path

PLACES = [(0, 0, 0.3), (0, 0, 0.1), (0.4, 0, 0), (0.35, 0, 0)]
AXES = [(0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0)]
MASSES = [8.0, 6.0, 4.0, 2.0]
STIFFNESS = [4.0e4, 5.0e4, 3.0e4, 8.0e3]
JOINTS_DEG = [(-60, 60), (-80, -10), (10, 90), (-90, 90)]


def urdf() -> str:
    """The arm's URDF, links with inertias alone."""
    text = ['<robot name="plain"><link name="base_link"/>']
    for i, (place, axis, mass) in enumerate(zip(PLACES, AXES, MASSES, strict=True), 1):
        text.append(
            f'<link name="link_{i}"><inertial><origin xyz="0.15 0.01 0.02"/><mass value="{mass}"/>'
            f'<inertia ixx="{0.01 * mass}" iyy="{0.02 * mass}" izz="{0.02 * mass}" ixy="0" '
            f'ixz="0" iyz="0"/></inertial></link><joint name="joint_{i}" type="revolute">'
            f'<parent link="{f"link_{i - 1}" if i > 1 else "base_link"}"/><child link="link_{i}"/>'
            f'<origin xyz="{" ".join(map(str, place))}"/><axis xyz="{" ".join(map(str, axis))}"/>'
            f'<limit lower="-2.9" upper="2.9" velocity="2" effort="0"/></joint>'
        )
    text.append(
        '<link name="tcp"/><joint name="end" type="fixed"><parent link="link_4"/>'
        '<child link="tcp"/><origin xyz="0.2 0.03 0.05"/></joint></robot>'
    )
    return "\n".join(text)


def make_plain_arm(folder: Path, softer: float = 1.0, damping_s: float = 4e-4) -> Path:
    """Write the robot folder, its springs that much softer; returns robot.toml."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "plain.urdf").write_text(urdf())
    lines = [
        'name = "plain arm"', 'urdf = "plain.urdf"', 'tcp_frame = "tcp"', 'sensor_frame = "tcp"',
        "band_hz = [3.0, 60.0]",
    ]  # fmt: skip
    for i, (axis, stiffness) in enumerate(zip(AXES, STIFFNESS, strict=True), 1):
        k = stiffness / softer
        lines += ["[[compliance]]", f'joint = "joint_{i}"', f"axis = {list(axis)}"]
        lines += [f"stiffness = {k}", f"damping = {damping_s * k}"]
    path = folder / "robot.toml"
    path.write_text("\n".join(lines) + "\n")
    return path


def plain_campaign(path: Path, acquisition: str = "integrated_variance") -> Path:
    """Write a small campaign.toml over the arm's joint box; returns its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        f"[workspace]\njoints_deg = {[list(r) for r in JOINTS_DEG]}\n"
        "[modes]\ncount = 2\nband_hz = [3.0, 60.0]\n"
        f'[acquisition]\nname = "{acquisition}"\ncandidates = 30\n'
        "[goal]\njoints_deg = [[0, -40, 50, 0], [20, -40, 50, 10]]\n"
    )
    return path
