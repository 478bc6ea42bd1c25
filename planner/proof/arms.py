"""Robot folders of known industrial arms, each with a small spindle, for tests and concealed cases.

Kinematics, limits and speeds: github kroshu/kuka_robot_descriptions (Apache-2.0) for KR10 R1100-2
and KR210 R2700-2, with masses and inertias stated there; github ros-industrial/abb (Apache-2.0)
for IRB 6640-185/2.80, whose masses are made up. Spindle, boxes, and elasticity are made up too,
but for the KR10's stiffnesses, which have the size of those that Birk et al. 2025 identified.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.proof import descriptions
from planner.proof.descriptions import Numbers

ZERO = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Joint:
    """Placement in the parent (m, quarter turns), axis, limits (°), speed (rad/s)."""

    xyz: Numbers
    quarters: Numbers
    axis: Numbers
    limits_deg: tuple[float, float]
    velocity: float


@dataclass(frozen=True)
class Body:
    """Mass (kg), centre of mass and its principal frame (rad), principal moments (kg·m²).

    `box` (m) around `box_at` is what collides and what is drawn, if there is one.
    """

    mass: float
    com: Numbers
    rpy: Numbers
    moments: Numbers
    box: Sequence[float] = ()
    box_at: Sequence[float] = ()


@dataclass(frozen=True)
class Arm:
    """Everything that a robot folder needs; bodies are base, links, spindle."""

    name: str
    joints: tuple[Joint, ...]
    bodies: tuple[Body, ...]
    tcp: Sequence[float]  # in the last link
    sensor: Sequence[float]
    quarters: Numbers  # of tcp and sensor in the last link
    torsion: tuple[float, ...]  # N·m/rad, about the joints' axes
    bending: tuple[float, ...]  # N·m/rad, across them
    damping_s: float  # C = damping_s · K
    joints_deg: tuple[tuple[float, float], ...]  # a workspace
    band_hz: tuple[float, float]
    gravity_m_s2: float = -9.81  # upwards
    peak_n: float = 0.0  # of a middling hit: a tenth of a millimetre or two at the tool
    payload_kg: float = 0.0  # of robots that are drawn
    reach_m: float = 0.0

    def write(self, directory: Path, per_joint: int = 1) -> Path:
        """Write the folder, with 1, 2 or 3 elastic rotations a joint; returns robot.toml."""
        return descriptions.write_robot(
            directory, "robot.urdf", self.urdf(), self._lines(per_joint)
        )

    def urdf(self) -> str:
        """URDF with visual and collision boxes, frames tcp and sensor."""
        links = [f"link_{i}" for i in range(1, len(self.joints) + 1)]
        names = ["base_link", *links, "spindle"]
        parts = [_link(name, body) for name, body in zip(names, self.bodies, strict=True)]
        for i, joint in enumerate(self.joints, 1):
            low, high = (float(v) for v in np.deg2rad(joint.limits_deg))
            parts.append(descriptions.joint(
                f"joint_{i}", names[i - 1], names[i], _floats(joint.xyz), _floats(joint.axis),
                (low, high), joint.velocity, _turn(joint.quarters),
            ))  # fmt: skip
        parts.append(descriptions.fixed("spindle", links[-1], ZERO, ZERO))
        for name, place in (("tcp", self.tcp), ("sensor", self.sensor)):
            turned = _turn(self.quarters)
            parts.append(descriptions.frame(name, links[-1], _floats(place), turned))
        return descriptions.urdf(self.name.replace(" ", "_").lower(), parts)

    def _lines(self, per_joint: int) -> list[str]:
        """Of robot.toml; the first elastic rotation of a joint is about its own axis."""
        gravity = f"gravity = [0.0, 0.0, {self.gravity_m_s2}]"
        files = self.name, "robot.urdf", "tcp", "sensor"
        lines = descriptions.head(*files, self.band_hz, gravity)
        for i, joint in enumerate(self.joints):
            own = int(np.argmax(np.abs(joint.axis)))
            across = [np.eye(3)[k] for k in range(3) if k != own]
            for axis in [np.array(joint.axis, dtype=float), *across][:per_joint]:
                k, name = self.torsion[i] if axis[own] else self.bending[i], f"joint_{i + 1}"
                lines.append(descriptions.compliance(name, axis.tolist(), k, self.damping_s))
        lines.append('\n[[obstacle]]\nname = "floor"')
        lines.append("center_m = [0.0, 0.0, -0.06]\nsize_m = [8.0, 8.0, 0.1]")
        return lines

    def campaign(self, robot: str = "../robot/robot.toml", count: int = 4) -> str:
        """campaign.toml over the joint box."""
        more = 'name = "integrated_variance"\n'
        text = descriptions.campaign(self.joints_deg, count, self.band_hz, more)
        return f'robot = "{robot}"\n{text}'

    def poses(self, n: int, seed: int = 0) -> np.ndarray:
        """Angles (n, joints) in rad, uniform in the workspace."""
        return self.drawn(n, np.random.default_rng(seed))

    def drawn(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """The same by a generator that others draw from, too."""
        low, high = np.deg2rad(np.array(self.joints_deg)).T
        return rng.uniform(low, high, (n, len(low)))


def _floats(values: Numbers) -> list[float]:
    return [float(v) for v in values]


def _turn(quarters: Numbers) -> list[float]:
    return [float(k) * np.pi / 2 for k in quarters]


def _link(name: str, body: Body) -> str:
    com, rpy = _floats(body.com), _floats(body.rpy)
    inside = [descriptions.inertial(body.mass, com, body.moments, rpy)]
    if body.box:
        inside.append(descriptions.box(_floats(body.box), _floats(body.box_at), ZERO))
    return descriptions.link(name, *inside)


KR10 = Arm(
    name="KR10 R1100-2 with small spindle",
    joints=(
        Joint((0, 0, 0.208), (2, 0, 0), (0, 0, 1), (-170, 170), 5.236),
        Joint((0.025, -0.0907, -0.192), (1, 0, 0), (0, 0, 1), (-190, 45), 3.927),
        Joint((0.56, 0, -0.0042), (0, 0, 0), (0, 0, 1), (-120, 156), 5.76),
        Joint((0.196, -0.025, -0.0865), (1, 0, -1), (0, 0, 1), (-185, 185), 6.283),
        Joint((0, 0.0505, -0.319), (0, 1, 1), (0, 0, 1), (-120, 120), 6.283),
        Joint((0.0615, 0, -0.0505), (1, 0, -1), (0, 0, 1), (-350, 350), 7.557),
    ),
    bodies=(
        Body(16.916, (-0.03713, 3e-05, 0.10864), (1.61656, -1.22129, 3.10031),
             (0.16209, 0.10881, 0.18462), (0.3, 0.25, 0.18), (-0.03, 0, 0.09)),
        Body(8.416, (0.00641, -0.01627, -0.10659), (1.30452, -0.94286, -1.42265),
             (0.07406, 0.08905, 0.1104), (0.2, 0.16, 0.22), (0.0, 0.0, -0.13)),
        Body(17.8369, (0.19116, -0.00465, -0.07521), (1.95249, -1.54224, -0.39028),
             (0.87516, 0.09215, 0.91571), (0.6, 0.14, 0.1), (0.27, 0.0, -0.045)),
        Body(6.075, (0.04386, -0.01251, -0.06825), (-2.67693, -1.3219, 1.18609),
             (0.04469, 0.01897, 0.04984), (0.2, 0.14, 0.12), (0.06, 0, -0.075)),
        Body(5.1624, (0.00132, 0.00861, -0.14098), (-2.22809, -1.53261, 2.17978),
             (0.0123, 0.0847, 0.0874), (0.11, 0.11, 0.2), (0, 0.0, -0.13)),
        Body(1.6128, (0.00932, 0.00078, -0.02646), (1.5679, -0.86117, -3.10028),
             (0.00173, 0.00222, 0.00247), (0.1, 0.08, 0.08), (0.01, 0, -0.045)),
        Body(0.734, (0, 0, -0.01176), (0, 0, 1.22343),
             (0.00018, 0.00018, 0.0003), (0.06, 0.06, 0.02), (0, 0, -0.018)),
        Body(3.2, (0.01, 0, -0.09), (0, 0, 0),
             (0.009, 0.009, 0.004), (0.08, 0.08, 0.12), (0.01, 0, -0.09)),
    ),
    tcp=(0.01, 0, -0.19), sensor=(0.01, 0.045, -0.12), quarters=(2, 0, 2),
    torsion=(5.05e4, 8.62e4, 5.14e4, 3.44e4, 1.2e4, 2.35e4),
    bending=(3.15e5, 1.28e6, 6.24e5, 5.93e5, 3.54e5, 3.17e5),
    damping_s=3.0e-4,
    joints_deg=((-60, 60), (-110, -40), (40, 120), (-60, 60), (20, 80), (-90, 90)),
    band_hz=(5.0, 150.0),
    peak_n=150.0,
)  # fmt: skip

KR210 = Arm(
    name="KR210 R2700-2 with spindle",
    joints=(
        Joint((0, 0, 0), (-2, 0, 0), (0, 0, 1), (-185, 185), 2.038),
        Joint((0.33, 0, -0.645), (1, 0, 0), (0, 0, 1), (-140, -5), 1.945),
        Joint((1.15, 0, 0), (0, 0, -1), (0, 0, 1), (-120, 168), 1.955),
        Joint((0.115, 0, 0), (1, 0, 0), (0, 0, 1), (-350, 350), 3.124),
        Joint((0, 0, -1.22), (-1, 0, 0), (0, 0, 1), (-125, 125), 3.002),
        Joint((0, 0, 0), (1, 0, 0), (0, 0, 1), (-350, 350), 3.84),
    ),
    bodies=(
        Body(225.96, (-0.05949, 0.00216, 0.20325), (-0.05086, -0.00199, 1.52315),
             (12.8309, 9.012, 14.2959), (0.8, 0.7, 0.18), (-0.05, 0, 0.09)),
        Body(363.07, (0.02879, 0.01188, -0.23403), (1.8662, 0.10258, -0.21632),
             (13.2089, 31.495, 33.8839), (0.75, 0.6, 0.4), (0.08, 0, -0.4)),
        Body(232.06, (0.48687, -0.0019, -0.11764), (-2.8204, -1.21811, 1.27763),
             (57.7957, 5.63273, 58.5598), (1.2, 0.3, 0.2), (0.575, 0, -0.13)),
        Body(190.33, (0.17377, -0.07596, 0.13619), (2.18226, -0.06561, -0.0535),
             (3.46995, 21.1713, 22.2068), (0.3, 0.7, 0.3), (0.12, -0.05, 0.1)),
        Body(42.4118, (-1e-05, 0.0192, -0.19789), (1.57115, -1.43683, -1.57121),
             (0.16132, 1.36451, 1.39158), (0.22, 0.22, 0.7), (0, 0, -0.7)),
        Body(16.9917, (0.06224, 0.0003, -0.06575), (1.57048, -0.87626, -0.00228),
             (0.20011, 0.12055, 0.22096), (0.16, 0.16, 0.16), (0, 0, 0)),
        Body(6.6, (0, 0, -0.0065), (0, 0, 0),
             (0.01146, 0.01146, 0.01453), (0.16, 0.16, 0.06), (0, 0, -0.18)),
        Body(55.0, (0.03, 0, -0.38), (0, 0, 0),
             (0.9, 0.9, 0.4), (0.24, 0.2, 0.34), (0.03, 0, -0.385)),
    ),
    tcp=(0.03, 0, -0.66), sensor=(0.03, 0.11, -0.5), quarters=(2, 0, 2),
    torsion=(4.6e6, 4.1e6, 2.6e6, 8.0e5, 7.0e5, 4.0e5),
    bending=(1.5e7, 1.4e7, 1.1e7, 3.5e6, 2.8e6, 2.2e6),
    damping_s=6.0e-4,
    joints_deg=((-60, 60), (-110, -50), (50, 120), (-60, 60), (-100, -30), (-90, 90)),
    band_hz=(4.0, 60.0),
    peak_n=1200.0,
)  # fmt: skip

IRB6640 = Arm(
    name="IRB 6640-185/2.80 with spindle",
    joints=(
        Joint((0, 0, 0.78), (0, 0, 0), (0, 0, 1), (-170, 170), 1.745),
        Joint((0.32, 0, 0), (0, 0, 0), (0, 1, 0), (-65, 85), 1.571),
        Joint((0, 0, 1.075), (0, 0, 0), (0, 1, 0), (-180, 70), 1.571),
        Joint((0, 0, 0.2), (0, 0, 0), (1, 0, 0), (-300, 300), 2.967),
        Joint((1.392, 0, 0), (0, 0, 0), (0, 1, 0), (-120, 120), 2.444),
        Joint((0.2, 0, 0), (0, 0, 0), (1, 0, 0), (-360, 360), 3.316),
    ),
    bodies=(
        Body(430.0, (-0.05, 0, 0.25), (0, 0, 0), (28, 30, 34), (0.9, 0.8, 0.4), (-0.05, 0, 0.2)),
        Body(370.0, (0.08, 0.02, -0.12), (0, 0, 0), (20, 33, 34), (0.8, 0.6, 0.3), (0.1, 0, -0.2)),
        Body(230.0, (0.01, -0.05, 0.5), (0, 0, 0), (40, 39, 6), (0.25, 0.3, 1.1), (0, 0, 0.53)),
        Body(210.0, (0.08, 0.01, 0.15), (0, 0, 0), (6, 20, 21), (0.7, 0.4, 0.34), (0, 0, 0.19)),
        Body(62.0, (0.75, 0, 0), (0, 0, 0), (0.6, 7, 7), (0.9, 0.22, 0.22), (0.82, 0, 0)),
        Body(24.0, (0.03, 0, 0), (0, 0, 0), (0.15, 0.2, 0.2), (0.16, 0.16, 0.16), (0, 0, 0)),
        Body(8.0, (-0.02, 0, 0), (0, 0, 0), (0.03, 0.02, 0.02), (0.06, 0.16, 0.16), (0, 0, 0)),
        Body(48.0, (0.2, 0.02, 0), (0, 0, 0), (0.4, 0.8, 0.8), (0.3, 0.2, 0.22), (0.2, 0.02, 0)),
    ),
    tcp=(0.45, 0.02, 0), sensor=(0.3, 0.02, 0.12), quarters=(0, 1, 0),
    torsion=(4.2e6, 4.8e6, 3.0e6, 9.0e5, 6.5e5, 4.5e5),
    bending=(1.9e7, 1.3e7, 1.2e7, 3.8e6, 3.0e6, 2.4e6),
    damping_s=5.0e-4,
    joints_deg=((-60, 60), (-30, 40), (-30, 40), (-60, 60), (20, 90), (-90, 90)),
    band_hz=(4.0, 60.0),
    peak_n=1200.0,
)  # fmt: skip

ARMS = {"kr10": KR10, "kr210": KR210, "irb6640": IRB6640}
DAMPING_S = 9.5e-4  # C = s K: 3 % at 10 Hz, as robots in milling cells have


def in_a_cell(name: str) -> Arm:
    """One of ARMS, damped as it is where it works."""
    return replace(ARMS[name], damping_s=DAMPING_S)
