"""A robot of one joint, for which there are closed forms."""


def pendulum_urdf(
    mass: float,
    moment: float,
    com_m: tuple[float, float, float],
    tip_m: tuple[float, float, float],
    axis: tuple[int, int, int],
) -> str:
    """URDF of joint `turn`, 1 m above the ground, and its arm; `moment` is about the arm's com."""
    com, tip, about = (" ".join(map(str, values)) for values in (com_m, tip_m, axis))
    return f"""<robot name="one"><link name="base_link"/><link name="arm"><inertial>
<origin xyz="{com}" rpy="0 0 0"/><mass value="{mass}"/>
<inertia ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="tip"/><joint name="turn" type="revolute"><parent link="base_link"/><child link="arm"/>
<origin xyz="0 0 1" rpy="0 0 0"/><axis xyz="{about}"/>
<limit lower="-4" upper="4" velocity="1" effort="0"/></joint><joint name="end" type="fixed">
<parent link="arm"/><child link="tip"/><origin xyz="{tip}" rpy="0 0 0"/></joint></robot>"""
