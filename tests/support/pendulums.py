"""A robot of one joint, for which there are closed forms."""

from planner.proof import descriptions

Vector = tuple[float, float, float]


def pendulum_urdf(mass: float, moment: float, com_m: Vector, tip_m: Vector, axis: Vector) -> str:
    """URDF of joint `turn`, 1 m above the ground, and its arm; `moment` is about the arm's com."""
    inertial = descriptions.inertial(mass, com_m, (moment,) * 3)
    parts = descriptions.link("base_link"), descriptions.link("arm", inertial)
    turn = descriptions.joint("turn", "base_link", "arm", (0, 0, 1), axis, (-4, 4), 1)
    return descriptions.urdf("one", [*parts, turn, descriptions.frame("tip", "arm", tip_m)])
