"""Robot folders as text: links and joints of a URDF, blocks of robot.toml, a campaign.toml."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

Numbers = Sequence[float] | np.ndarray
ORIGIN = (0, 0, 0)


def urdf(name: str, parts: Iterable[str]) -> str:
    """A description of links and joints."""
    return "\n".join([f'<robot name="{name}">', *parts, "</robot>", ""])


def origin(xyz: Numbers, rpy: Numbers | None = None) -> str:
    """A place in m, and how it is turned, where it says so."""
    turned = "" if rpy is None else f' rpy="{_text(rpy)}"'
    return f'<origin xyz="{_text(xyz)}"{turned}/>'


def box(size: Numbers, at: Numbers = ORIGIN, rpy: Numbers | None = None) -> str:
    """What is drawn and what collides of a link."""
    shape = f'{origin(at, rpy)}<geometry><box size="{_text(size)}"/></geometry>'
    return f"<visual>{shape}</visual><collision>{shape}</collision>"


def inertial(mass: float, com: Numbers, moments: Numbers, rpy: Numbers | None = None) -> str:
    """Mass in kg, its centre, principal moments in kg·m² about axes that are turned by `rpy`."""
    xx, yy, zz = moments
    return (
        f'<inertial>{origin(com, rpy)}<mass value="{mass}"/>'
        f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def link(name: str, *inside: str) -> str:
    """A link with its inertia and shapes."""
    return f'<link name="{name}">{"".join(inside)}</link>'


def joint(
    name: str, parent: str, child: str, xyz: Numbers, axis: Numbers, limits: Numbers,
    velocity: float = 2, rpy: Numbers | None = None, kind: str = "revolute",
) -> str:  # fmt: skip
    """A joint with limits in rad (m)."""
    low, high = limits
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'{origin(xyz, rpy)}<axis xyz="{_text(axis)}"/>'
        f'<limit lower="{low}" upper="{high}" velocity="{velocity}" effort="0"/></joint>'
    )


def fixed(child: str, parent: str, xyz: Numbers, rpy: Numbers | None = None) -> str:
    """A joint that does not move."""
    return (
        f'<joint name="{child}_fixed" type="fixed"><parent link="{parent}"/>'
        f'<child link="{child}"/>{origin(xyz, rpy)}</joint>'
    )


def frame(name: str, parent: str, xyz: Numbers, rpy: Numbers | None = None) -> str:
    """A link without a mass, at a place of another."""
    return f'<link name="{name}"/>\n{fixed(name, parent, xyz, rpy)}'


def head(
    name: str, file: str, tcp: str, sensor: str, band_hz: Sequence[float], *more: str
) -> list[str]:
    """Lines at the top of a robot.toml."""
    return [
        f'name = "{name}"', f'urdf = "{file}"', f'tcp_frame = "{tcp}"',
        f'sensor_frame = "{sensor}"', f"band_hz = {list(band_hz)}", *more,
    ]  # fmt: skip


def write_robot(folder: Path, file: str, urdf: str, lines: Iterable[str]) -> Path:
    """A folder of robot.toml, whose path it returns, and the URDF `file` that it names."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / file).write_text(urdf)
    path = folder / "robot.toml"
    path.write_text("\n".join([*lines, ""]))
    return path


def compliance(
    joint: str, axis: Sequence[float], stiffness: float, damping_s: float, slide: bool = False
) -> str:
    """A spring after a joint; along the axis where it slides. Its damper is proportional."""
    k, c = ("stiffness_n_m", "damping_n_s_m") if slide else ("stiffness", "damping")
    return (
        f'\n[[compliance]]\njoint = "{joint}"\naxis = {list(axis)}\n'
        f"{k} = {stiffness}\n{c} = {damping_s * stiffness}"
    )


def campaign(
    joints_deg: Iterable[Sequence[float]], count: int, band_hz: Sequence[float], more: str = ""
) -> str:
    """campaign.toml over a box of joint angles; `more` goes on in its [acquisition]."""
    return (
        f"[workspace]\njoints_deg = {[list(limits) for limits in joints_deg]}\n"
        f"[modes]\ncount = {count}\nband_hz = {list(band_hz)}\n[acquisition]\n{more}"
    )


def _text(values: Numbers) -> str:
    return " ".join(map(str, values))
