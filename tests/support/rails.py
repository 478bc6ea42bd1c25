"""Robots with joints that slide: a small arm of two joints on a rail, and a gantry with a wrist."""

from dataclasses import dataclass
from pathlib import Path

STEEL_BOX = "0.08 0.08 0.08"  # what collides, small enough never to


@dataclass(frozen=True)
class Axis:
    """A joint: name, type, place in its parent (m), axis, limits, speed; its link and its spring.

    The link has mass in kg, centre in m; stiffness is about or along the axis, in N·m/rad or N/m.
    """

    name: str
    kind: str
    place: str
    axis: str
    limits: tuple[float, float]
    speed: float
    mass: float
    centre: str
    stiffness: float


RAIL_ARM = (
    Axis("rail", "prismatic", "0 0 0.2", "0 1 0", (-0.2, 2.0), 1.0, 14.0, "0 0 0.1", 2.2e5),
    Axis("turn", "revolute", "0.05 0 0.3", "0 0 1", (-2.8, 2.8), 2.0, 8.0, "0.2 0.02 0.05", 1.1e4),
    Axis("lift", "revolute", "0.45 0 0.1", "0 1 0", (-1.6, 1.6), 2.0, 5.0, "0.2 0.01 0.02", 5.0e3),
)
RAIL_BOX = ((0.0, 1500.0), (-70.0, 70.0), (-60.0, 60.0))

GANTRY = (
    Axis("x", "prismatic", "0 0 2", "1 0 0", (0.0, 3.0), 1.0, 90.0, "0 0.1 0", 3.0e6),
    Axis("y", "prismatic", "0 0 0", "0 1 0", (-1.0, 1.0), 1.0, 40.0, "0.05 0 0", 2.0e6),
    Axis("z", "prismatic", "0.1 0 0", "0 0 -1", (0.0, 0.9), 0.5, 25.0, "0 0.02 -0.3", 4.0e6),
    Axis("a", "revolute", "0 0.05 -0.6", "0 0 1", (-3.0, 3.0), 2.0, 9.0, "0.05 0.06 -0.1", 1.2e4),
    Axis("b", "revolute", "0 0 -0.2", "0 1 0", (-1.8, 1.8), 2.0, 6.0, "0.03 0 -0.12", 9.0e3),
)
GANTRY_BOX = ((200.0, 2800.0), (-800.0, 800.0), (100.0, 800.0), (-120.0, 120.0), (-80.0, 80.0))


def urdf(axes: tuple[Axis, ...], tip: str) -> str:
    """The URDF; `tip` is where the tcp is in the last link."""
    text = ['<robot name="sliding"><link name="base_link"/>']
    parent = "base_link"
    for one in axes:
        moment = 0.02 * one.mass
        text.append(
            f'<link name="{one.name}_link"><inertial><origin xyz="{one.centre}"/>'
            f'<mass value="{one.mass}"/><inertia ixx="{moment}" iyy="{1.2 * moment}" '
            f'izz="{0.7 * moment}" ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry>'
            f'<box size="{STEEL_BOX}"/></geometry></collision></link>'
            f'<joint name="{one.name}" type="{one.kind}"><parent link="{parent}"/>'
            f'<child link="{one.name}_link"/><origin xyz="{one.place}"/><axis xyz="{one.axis}"/>'
            f'<limit lower="{one.limits[0]}" upper="{one.limits[1]}" velocity="{one.speed}" '
            f'effort="0"/></joint>'
        )
        parent = f"{one.name}_link"
    text.append(
        f'<link name="tcp"/><joint name="end" type="fixed"><parent link="{parent}"/>'
        f'<child link="tcp"/><origin xyz="{tip}" rpy="0 0.4 0.3"/></joint></robot>'
    )
    return "\n".join(text)


def make_sliding(
    folder: Path,
    axes: tuple[Axis, ...] = RAIL_ARM,
    tip: str = "0.4 0.04 0.05",
    said: str = "",
) -> Path:
    """Write the robot folder; returns robot.toml."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.urdf").write_text(urdf(axes, tip))
    lines = ['name = "sliding"', 'urdf = "robot.urdf"', 'tcp_frame = "tcp"', 'sensor_frame = "tcp"',
             "band_hz = [3.0, 60.0]", said]  # fmt: skip
    for one in axes:
        k = one.stiffness
        n_m = ("_n_m", "_n_s_m") if one.kind == "prismatic" else ("", "")
        axis = [float(v) for v in one.axis.split()]
        lines += ["[[compliance]]", f'joint = "{one.name}"', f"axis = {axis}"]
        lines += [f"stiffness{n_m[0]} = {k}", f"damping{n_m[1]} = {5e-4 * k}"]
    path = folder / "robot.toml"
    path.write_text("\n".join(lines) + "\n")
    return path


def sliding_campaign(path: Path, box: tuple[tuple[float, float], ...] = RAIL_BOX) -> Path:
    """Write a campaign.toml over the joint box; returns its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        f"[workspace]\njoints_deg = {[list(r) for r in box]}\n"
        "[modes]\ncount = 3\nband_hz = [3.0, 60.0]\n"
        '[acquisition]\nname = "integrated_variance"\ncandidates = 40\n'
    )
    return path
