"""robot.toml: what URDF cannot say."""

from typing import Literal

import msgspec


class Compliance(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One elastic rotation: axis in the joint's child frame, N·m/rad, N·m·s/rad.

    `joint` may be "base": between floor and robot, about an axis of the world, through the URDF's
    origin. It may be a link: the rotation is half-way to the joint that this carries, and gives
    with what lies beyond (the link's own mass does not). With `slide` it is no rotation but a
    shift along the axis (N/m, N·s/m). `loss_factor` η makes the stiffness K(1+iη) (structural
    damping). Blocks with the same `tie` share their stiffness, damping and loss factor, also when
    those are identified.
    """

    joint: str
    axis: tuple[float, float, float]
    stiffness: float
    damping: float
    loss_factor: float = 0.0
    tie: str = ""
    slide: bool = False
    stiffness_sd_percent: float | None = None


class Payload(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A body carried by a link of the URDF that does not list it.

    Mass in kg, centre of mass in the link's frame, moments (xx, yy, zz, xy, xz, yz) in kg·m² about
    that centre along the link's axes; without moments it is a point.
    """

    link: str
    mass: float
    com_m: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Resonator(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A mass (kg) on a spring of its own, at a place of a link's joint frame, along a direction.

    `frequency_hz` and `damping_ratio` are those that it has on a link that is held.
    """

    joint: str
    position_m: tuple[float, float, float]
    direction: tuple[float, float, float]
    mass: float
    frequency_hz: float
    damping_ratio: float


class Harmonic(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Stiffness about a joint's own axis that goes with its angle q: + c cos nq + s sin nq."""

    joint: str
    order: int
    cosine: float
    sine: float


class ParameterTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A parameter of an effect, as the diagnosis found it."""

    value: float
    sd: float
    unit: str


class EffectTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Physics that the diagnosis found missing, and what it adds to the simulation.

    `payload` may have a negative mass here, where a stated one was too large.
    """

    effect: str
    at: str
    probability: float = 1.0
    parameters: dict[str, ParameterTable] = {}
    compliance: tuple[Compliance, ...] = ()
    payload: tuple[Payload, ...] = ()
    resonator: tuple[Resonator, ...] = ()
    harmonic: tuple[Harmonic, ...] = ()


class Obstacle(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A box fixed to the world: floor, table, fence."""

    name: str
    center_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    rpy_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)


class PointTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A point that may be hit, or carry a sensor of `mass_kg` with the axes named.

    Its frame lies at `position_m` in that of a link (or another frame of the URDF), turned by
    roll, pitch and yaw. `node` is its number in universal files. One called "tcp" or "sensor" is
    where the tool is hit, or its sensor sits, and needs no link.
    """

    name: str
    link: str = ""
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    axes: tuple[str, ...] = ("x", "y", "z")
    mass_kg: float = 0.0
    node: int | None = None


class CollisionTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Pairs of links (or link and obstacle) that may touch, and the distance to keep."""

    ignore: tuple[tuple[str, str], ...] = ()
    margin_m: float = 0.0


class HitsTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How a hand hits: sds of a hit's direction and of its place beside the point."""

    angle_sd_deg: float = 2.0
    offset_sd_mm: float = 5.0


class SensorTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What sensor and hammer are specified to, and how well the sensor's seat is known: sds."""

    gain_sd_percent: float = 2.0
    force_gain_sd_percent: float = 3.0
    cross_axis_sd_percent: float = 3.0
    mounting_sd_deg: float = 2.0
    position_sd_mm: float = 10.0


class ReadbackTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How well the joint angles of a measurement are known: sd of each joint's readback."""

    joint_sd_deg: float = 0.05


class DiagnoseTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a diagnosis need not explain: a mismatch of so many percent of |H| does not matter."""

    matters_percent: float = 3.0


class ControllerTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the robot's controller counts its axes: its angle is sign · the URDF's + offset.

    `joints` are the URDF's in the controller's order (none: the URDF's own), `signs` and
    `offsets_deg` go with it. `external` names those that are no axes of the arm (E1, E2, …).
    Programs drive at `speed_percent` of the controller's full speed.
    """

    joints: tuple[str, ...] = ()
    signs: tuple[Literal[1, -1], ...] = ()
    offsets_deg: tuple[float, ...] = ()
    external: tuple[str, ...] = ()
    speed_percent: float = 10.0


class RobotConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole of robot.toml; what `effects` add stands in the other lists, after their own.

    `urdf` is a file beside robot.toml. `tcp_frame` names the link of it where the hammer hits,
    `sensor_frame` the one where the accelerometer sits; their axes are parallel. `gravity` is in
    m/s² along the axes of the URDF's base. `band_hz` is where the simulation is meant to hold.
    `held` says where joints stay that do not move in the tests, as rails and turntables:
    NAME_m = 1.2 for a sliding one, NAME_deg = 30 for a turning one.

    Unless `geometric_stiffness` is false the robot is linearised where it sags under gravity, and
    gravity's own stiffness, of the size of weight times height, is added.
    `stiffness_sd_percent` is how well each stated stiffness is known,
    `stiffness_bias_sd_percent` by how much all of them may be off together, as gear makers' are.
    """

    name: str
    urdf: str
    tcp_frame: str
    sensor_frame: str
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    band_hz: tuple[float, float] = (4.0, 90.0)
    held: dict[str, float] = {}
    geometric_stiffness: bool | None = None  # a bool once `load_config` has read it
    stiffness_sd_percent: float | None = None
    stiffness_bias_sd_percent: float | None = None
    compliance: tuple[Compliance, ...] = ()
    payload: tuple[Payload, ...] = ()
    obstacle: tuple[Obstacle, ...] = ()
    point: tuple[PointTable, ...] = ()
    collision: CollisionTable = CollisionTable()
    effects: tuple[EffectTable, ...] = ()
    resonator: tuple[Resonator, ...] = ()
    harmonic: tuple[Harmonic, ...] = ()
    hits: HitsTable = HitsTable()
    sensor: SensorTable = SensorTable()
    readback: ReadbackTable = ReadbackTable()
    diagnose: DiagnoseTable = DiagnoseTable()
    controller: ControllerTable = ControllerTable()


LISTS = "compliance", "payload", "resonator", "harmonic"  # that effects add to


def without_effects(config: RobotConfig) -> RobotConfig:
    """The config as its file has it: the lists without what effects add."""
    own = {
        name: getattr(config, name)[:-count]
        for name in LISTS
        if (count := sum(len(getattr(e, name)) for e in config.effects))
    }
    return msgspec.structs.replace(config, **own)
