"""The true robot: a MuJoCo model that deviates from the simulation in known ways.

This engine is there to make recordings whose causes are known. It shares no code with the
planner's own models: it reads URDF and robot.toml itself, and MuJoCo gives the mass matrix.
"""

import tomllib
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import scipy.linalg

from planner.errors import InputError


@dataclass(frozen=True)
class Spring:
    """An elastic rotation: after `joint` ("base": between floor and robot) about `axis`.

    Stiffness in N·m/rad, damping in N·m·s/rad; the axis is in the joint's child frame (for the
    base: the world's).
    """

    joint: str
    axis: tuple[float, float, float]
    stiffness: float
    damping: float


@dataclass(frozen=True)
class Deviation:
    """How truth differs from the robot folder: seeded scatter, and what the simulation lacks.

    `stiffness` and `inertia` are relative standard deviations, `com_m` one in m.
    """

    seed: int = 0
    stiffness: float = 0.0
    damping: float = 0.0
    inertia: float = 0.0
    com_m: float = 0.0
    extra: tuple[Spring, ...] = ()


@dataclass(frozen=True, eq=False)
class Truth:
    """A linear vibrating robot at any pose; angles in rad."""

    name: str
    joint_names: tuple[str, ...]
    springs: tuple[Spring, ...]
    description: str
    _model: object = field(repr=False)
    _data: object = field(repr=False)
    _held: np.ndarray = field(repr=False)  # places of the robot's own joints in q
    _elastic: np.ndarray = field(repr=False)

    def matrices(
        self, q: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """M, C, K (e, e) and the Jacobians (3, e) of hit point and sensor, in their own frames."""
        import mujoco

        model, data = self._model, self._data
        data.qpos[:] = 0.0
        data.qpos[self._held] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_crb(model, data)
        full = _full_mass(model, data)
        grid = np.ix_(self._elastic, self._elastic)
        jacobians = []
        for site in ("tcp", "sensor"):
            jacobian = np.zeros((3, model.nv))
            mujoco.mj_jacSite(model, data, jacobian, None, model.site(site).id)
            rotation = data.site(site).xmat.reshape(3, 3)
            jacobians.append((rotation.T @ jacobian)[:, self._elastic])
        damping = np.diag([s.damping for s in self.springs])
        stiffness = np.diag([s.stiffness for s in self.springs])
        return full[grid], damping, stiffness, jacobians[0], jacobians[1]

    def position(self, q: np.ndarray) -> np.ndarray:
        """Position (3,) of the hit point in the world in m."""
        self.matrices(q)
        return np.array(self._data.site("tcp").xpos)

    def poles(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Poles (2e,) in rad/s, receptance residues (2e, 3, 3), and Js M⁻¹ Jhᵀ (3, 3)."""
        mass, damping, stiffness, hit, sensor = self.matrices(q)
        e = len(mass)
        zero, one = np.zeros((e, e)), np.eye(e)
        left = np.block([[one, zero], [zero, mass]])
        right = np.block([[zero, one], [-stiffness, -damping]])
        poles, vectors = scipy.linalg.eig(right, left)
        inverse = np.linalg.inv(vectors)
        entry = inverse @ np.vstack([np.zeros((e, 3)), np.linalg.solve(mass, hit.T)])
        output = sensor @ vectors[:e]
        residues = np.einsum("ik,kj->kij", output, entry)
        return poles, residues, sensor @ np.linalg.solve(mass, hit.T)

    def modes(self, q: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Natural frequencies (m,) in Hz, damping ratios (m,), residues (m, 3, 3), lowest first."""
        poles, residues, _ = self.poles(q)
        order = [k for k in np.argsort(np.abs(poles)) if poles[k].imag > 1e-6][:count]
        size = np.abs(poles[order])
        return size / (2 * np.pi), -poles[order].real / size, residues[order]

    def accelerance(self, q: np.ndarray, frequency_hz: np.ndarray) -> np.ndarray:
        """Accelerance (3, 3, F) in m/s²/N."""
        poles, residues, _ = self.poles(q)
        iw = 2j * np.pi * np.asarray(frequency_hz)
        return iw**2 * np.einsum("kij,kf->ijf", residues, 1 / (iw - poles[:, None]))


def load_truth(robot_toml: Path, deviation: Deviation | None = None) -> Truth:
    """The true robot behind a robot folder. Raises InputError without MuJoCo."""
    try:
        import mujoco
    except ImportError:
        raise InputError(
            "Simulated recordings need MuJoCo; install it with: pip install 'planner[truth]'"
        ) from None
    deviation = deviation or Deviation()
    table = tomllib.loads(robot_toml.read_text(encoding="utf-8"))
    root = ElementTree.parse(robot_toml.parent / table["urdf"]).getroot()
    rng = np.random.default_rng(deviation.seed)
    nominal = [
        Spring(c["joint"], tuple(c["axis"]), c["stiffness"], c["damping"])
        for c in table["compliance"]
    ]
    springs = (*(_deviating(s, deviation, rng) for s in nominal), *deviation.extra)
    builder = _Builder(root, table, springs, deviation, rng)
    # MuJoCo checks the springs' dynamics without their stiffness and warns into a file.
    mujoco.set_mju_user_warning(lambda text: None)
    model = mujoco.MjModel.from_xml_string(builder.xml())
    held = [model.joint(name).qposadr[0] for name in builder.joint_names]
    elastic = [model.joint(f"spring_{i}").qposadr[0] for i in range(len(springs))]
    return Truth(
        table["name"],
        tuple(builder.joint_names),
        springs,
        f"MuJoCo {mujoco.__version__}, seed {deviation.seed}",
        model,
        mujoco.MjData(model),
        np.array(held),
        np.array(elastic),
    )


def _full_mass(model: object, data: object) -> np.ndarray:
    import mujoco

    full = np.zeros((model.nv, model.nv))
    try:
        mujoco.mj_fullM(model, data, full)
    except TypeError:  # before MuJoCo 3.5 the arguments were (model, full, qM)
        mujoco.mj_fullM(model, full, data.qM)
    return full


def _deviating(spring: Spring, deviation: Deviation, rng: np.random.Generator) -> Spring:
    k = spring.stiffness * np.exp(deviation.stiffness * rng.standard_normal())
    c = spring.damping * np.exp(deviation.damping * rng.standard_normal())
    return Spring(spring.joint, spring.axis, float(k), float(c * k / spring.stiffness))


class _Builder:
    """URDF to MJCF with one hinge per joint and one per spring."""

    def __init__(self, root, table, springs, deviation, rng):
        self._links = {link.get("name"): link for link in root.findall("link")}
        self._children: dict[str, list] = {}
        for joint in root.findall("joint"):
            self._children.setdefault(joint.find("parent").get("link"), []).append(joint)
        childs = {j.find("child").get("link") for js in self._children.values() for j in js}
        self._root = next(name for name in self._links if name not in childs)
        self._table, self._springs = table, springs
        self._deviation, self._rng = deviation, rng
        self.joint_names: list[str] = []

    def xml(self) -> str:
        top = ElementTree.Element("mujoco")
        ElementTree.SubElement(top, "compiler", angle="radian", autolimits="false")
        world = ElementTree.SubElement(top, "worldbody")
        base = ElementTree.SubElement(world, "body", name=self._root)
        soft = self._hinges(base, "base")
        self._inertial(base, self._root, moving=soft)
        self._grow(base, self._root)
        return ElementTree.tostring(top, encoding="unicode")

    def _hinges(self, body: ElementTree.Element, joint: str) -> bool:
        found = [i for i, s in enumerate(self._springs) if s.joint == joint]
        for i in found:
            axis = " ".join(repr(float(a)) for a in self._springs[i].axis)
            ElementTree.SubElement(body, "joint", name=f"spring_{i}", type="hinge", axis=axis)
        return bool(found)

    def _grow(self, parent: ElementTree.Element, link: str) -> None:
        for joint in self._children.get(link, []):
            name, child = joint.get("name"), joint.find("child").get("link")
            position, quaternion = _placement(joint.find("origin"))
            body = ElementTree.SubElement(parent, "body", name=child, pos=position, quat=quaternion)
            for site in ("tcp", "sensor"):
                if child == self._table[f"{site}_frame"]:
                    ElementTree.SubElement(body, "site", name=site)
            turning = joint.get("type") != "fixed"
            if turning:
                axis = joint.find("axis")
                xyz = "1 0 0" if axis is None else axis.get("xyz")
                ElementTree.SubElement(body, "joint", name=name, type="hinge", axis=xyz)
                self.joint_names.append(name)
                self._hinges(body, name)
            self._inertial(body, child, moving=turning)
            self._grow(body, child)

    def _inertial(self, body: ElementTree.Element, link: str, moving: bool) -> None:
        inertial = self._links[link].find("inertial")
        if inertial is None:
            return
        scale = float(np.exp(self._deviation.inertia * self._rng.standard_normal()))
        turn = float(np.exp(self._deviation.inertia * self._rng.standard_normal()))
        shift = self._deviation.com_m * self._rng.standard_normal(3)
        origin = inertial.find("origin")
        position, quaternion = _placement(origin)
        place = np.array([float(v) for v in position.split()]) + shift
        tensor = inertial.find("inertia")
        entries = [
            float(tensor.get(k, 0)) * scale * turn
            for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        ]
        frame = ElementTree.SubElement(
            body,
            "inertial",
            pos=" ".join(repr(float(v)) for v in place),
            mass=repr(float(inertial.find("mass").get("value")) * scale),
        )
        rotation = _matrix(quaternion)
        xx, yy, zz, xy, xz, yz = entries
        turned = rotation @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ rotation.T
        order = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
        frame.set("fullinertia", " ".join(repr(float(turned[ij])) for ij in order))


def _placement(origin: ElementTree.Element | None) -> tuple[str, str]:
    """Position and quaternion (w x y z) of a URDF origin."""
    if origin is None:
        return "0 0 0", "1 0 0 0"
    roll, pitch, yaw = (float(v) for v in origin.get("rpy", "0 0 0").split())
    cr, sr, cp, sp = np.cos(roll / 2), np.sin(roll / 2), np.cos(pitch / 2), np.sin(pitch / 2)
    cy, sy = np.cos(yaw / 2), np.sin(yaw / 2)
    quaternion = (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
    return origin.get("xyz", "0 0 0"), " ".join(repr(float(v)) for v in quaternion)


def _matrix(quaternion: str) -> np.ndarray:
    w, x, y, z = (float(v) for v in quaternion.split())
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
