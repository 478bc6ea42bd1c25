"""robot.toml: what URDF cannot say."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from planner.robot.joint_laws import LargeNumber, LawTable
from planner.toml_file import limited

BASE = "base"  # as the joint of a [[compliance]]: between floor and robot
LONGEST_LEVER_M = 100.0
LOSS_FACTOR_BELOW = 2.0  # of a spring: more is a damper
SLIDE_SD_MM = 0.5  # as far as 0.05° take a tool at half a metre
STATED_OF_SLIDE = {"stiffness": "stiffness_n_m", "damping": "damping_n_s_m"}

Positive = Annotated[float, limited(gt=0)]
Mass = Annotated[float, limited("kg", gt=0, le=1e5)]
# Beyond a factor of 11 either way nothing is stated.
StatedSd = Annotated[float, limited("%", gt=0, le=1000)]
Sd = Annotated[float, limited(ge=0, le=100)]
Length = Annotated[float, limited("m", gt=-100, lt=100)]  # in a link's frame
Far = Annotated[float, limited(gt=-1e4, lt=1e4)]  # any place in m, any angle in degrees
Size = Annotated[float, limited("m", gt=0, le=1e4)]
Acceleration = Annotated[float, limited("m/s²", gt=-100, lt=100)]


def _unstated() -> Any:
    """Of a stiffness or damping that stands under another name, or is missing."""
    return msgspec.UNSET


def entry_of(kind: str, block: Mapping[str, Any]) -> str:
    """Under which name a [[compliance]] of robot.toml states its "stiffness" or "damping"."""
    stated = STATED_OF_SLIDE.get(kind, kind)
    return stated if stated in block else kind


class Compliance(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One elastic rotation: axis in the joint's child frame, N·m/rad, N·m·s/rad.

    `joint` may be "base": between floor and robot, about an axis of the world, through the URDF's
    origin. It may be a link: the rotation is half-way to the joint that this carries, and gives
    with what lies beyond (the link's own mass does not). With `slide` it is no rotation but a
    shift along the axis (N/m, N·s/m): so it is where `stiffness_n_m` and `damping_n_s_m` are given
    instead of `stiffness` and `damping`, as for the own spring of a joint that slides.
    `loss_factor` η makes the stiffness K(1+iη) (structural
    damping). Blocks with the same `tie` share their stiffness, damping and loss factor, also when
    those are identified. `height_m` is how high over the URDF's origin the axis of a base's
    rotation lies (below it: negative, as on a pedestal that rocks about its foot); the base then
    needs the shifts that go with that. `lever_m` makes a link's block a shift of so many metres a
    rad: a beam's middle gives across, too, and a uniform one of length L by L / √12 as much as it
    turns (Euler and Bernoulli's 12EI/L³ beside EI/L).
    """

    joint: str
    axis: tuple[float, float, float]
    stiffness: LargeNumber = msgspec.field(default_factory=_unstated)
    damping: Annotated[float, limited(ge=0, le=1e14)] = msgspec.field(default_factory=_unstated)
    loss_factor: Annotated[float, limited(ge=0, lt=LOSS_FACTOR_BELOW)] = 0.0
    tie: str = ""
    slide: bool = False
    stiffness_sd_percent: StatedSd | None = None
    stiffness_n_m: Annotated[float, limited("N/m", gt=0, le=1e14)] | None = None
    damping_n_s_m: Annotated[float, limited("N·s/m", ge=0, le=1e14)] | None = None
    height_m: float = 0.0
    lever_m: float = 0.0

    def __post_init__(self) -> None:
        """Once read, a shift is a block with `slide`, whose stiffness is in N/m."""
        if self.stiffness_n_m is not None or self.damping_n_s_m is not None:
            if any(getattr(self, kind) is not msgspec.UNSET for kind in STATED_OF_SLIDE):
                raise ValueError(
                    "give stiffness and damping, or stiffness_n_m and damping_n_s_m, not both"
                )
            msgspec.structs.force_setattr(self, "slide", True)
            for kind, stated in STATED_OF_SLIDE.items():
                value = getattr(self, stated)
                msgspec.structs.force_setattr(self, kind, msgspec.UNSET if value is None else value)
                msgspec.structs.force_setattr(self, stated, None)
        for kind, stated in STATED_OF_SLIDE.items():
            if getattr(self, kind) is msgspec.UNSET:
                missing = stated if self.slide else kind
                raise ValueError(f"Object missing required field `{missing}`")
        if self.height_m and (self.joint != BASE or self.slide):
            raise ValueError(f'height_m is of a rotation of joint = "{BASE}" only')
        if not 0 <= self.lever_m < LONGEST_LEVER_M or (self.lever_m and self.slide):
            raise ValueError(
                f"lever_m is {self.lever_m:g}; it is in m, from 0 to {LONGEST_LEVER_M:g}, of "
                "blocks without slide and with stiffness in N·m/rad"
            )


class Payload(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A body carried by a link of the URDF that does not list it.

    Mass in kg, centre of mass in the link's frame, moments (xx, xy, xz, yy, yz, zz) in kg·m² about
    that centre along the link's axes; without moments it is a point.
    """

    link: str
    mass: float
    com_m: tuple[Length, Length, Length]
    inertia_kg_m2: tuple[float, float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class OuterHalf(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the outer half of a link that bends weighs, payloads on it included; the rest is inner.

    Mass in kg, centre of mass in the link's frame, moments (xx, xy, xz, yy, yz, zz) in kg·m² about
    that centre along the link's axes.
    """

    mass_kg: Mass
    centre_m: tuple[Length, Length, Length]
    inertia_kg_m2: tuple[float, float, float, float, float, float]


class LinkTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a link weighs, in the stead of the URDF's <inertial>, and how sure that is.

    Mass in kg, centre of mass in the link's frame, moments (xx, xy, xz, yy, yz, zz) in kg·m² about
    that centre along the link's axes: all three or, where only the sd is to be stated, none.
    `sd_percent` is that of mass and moments, the centre's in percent of the radius of gyration;
    `guessed` numbers are marked wherever masses are shown. A link that bends is cut into the halves
    of a uniform beam unless `outer_half` states the outer one.
    """

    link: str
    mass_kg: Mass | None = None
    centre_m: tuple[Length, Length, Length] | None = None
    inertia_kg_m2: tuple[float, float, float, float, float, float] | None = None
    sd_percent: StatedSd | None = None
    guessed: bool = False
    outer_half: OuterHalf | None = None


class Resonator(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A mass (kg) on a spring of its own, at a place of a link's joint frame, along a direction.

    `frequency_hz` and `damping_ratio` are those that it has on a link that is held.
    """

    joint: str
    position_m: tuple[float, float, float]
    direction: tuple[float, float, float]
    mass: Positive
    frequency_hz: Positive
    damping_ratio: Positive


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
    center_m: tuple[Far, Far, Far]
    size_m: tuple[Size, Size, Size]
    rpy_deg: tuple[Far, Far, Far] = (0.0, 0.0, 0.0)


class PointTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A point that may be hit, or carry a sensor of `mass_kg` with the axes named.

    Simulations beside recordings carry that mass where the sensor was, and `modes` takes it out.
    Its frame lies at `position_m` in that of a link (or another frame of the URDF), turned by
    roll, pitch and yaw. `node` is its number in universal files. One called "tcp" or "sensor"
    without a link is where `tcp_frame` or `sensor_frame` is; with link and place it may be named
    by these.
    """

    name: str
    link: str = ""
    position_m: tuple[Far, Far, Far] = (0.0, 0.0, 0.0)
    rpy_deg: tuple[Far, Far, Far] = (0.0, 0.0, 0.0)
    axes: tuple[str, ...] = ("x", "y", "z")
    mass_kg: Annotated[float, limited("kg", ge=0, lt=1e3)] = 0.0
    node: Annotated[int, limited(ge=1)] | None = None


class CollisionTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Pairs of links (or link and obstacle) that may touch, and the distance to keep."""

    ignore: tuple[tuple[str, str], ...] = ()
    margin_m: Annotated[float, limited("m", ge=0, le=1)] = 0.0


class HitsTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How a hand hits: sds of a hit's direction and of its place beside the point."""

    angle_sd_deg: Sd = 2.0
    offset_sd_mm: Sd = 5.0


class SensorTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What sensor and hammer are specified to, and how well the sensor's seat is known: sds."""

    gain_sd_percent: Sd = 1.5
    force_gain_sd_percent: Sd = 1.5
    cross_axis_sd_percent: Sd = 3.0
    mounting_sd_deg: Sd = 2.0
    position_sd_mm: Sd = 10.0


class ReadbackTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How well the joint angles of a measurement are known: sd of each joint's readback.

    `joint_sd_mm` is that of joints that slide, 0.5 if left out.
    """

    joint_sd_deg: Sd = 0.05
    joint_sd_mm: Sd | msgspec.UnsetType = msgspec.UNSET

    @property
    def slide_sd_m(self) -> float:
        """Of joints that slide, in m."""
        stated = self.joint_sd_mm
        return 1e-3 * (SLIDE_SD_MM if isinstance(stated, msgspec.UnsetType) else stated)


class HammerTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The hammer whose peak forces are stated: how long its pulse lasts, impulse over peak.

    That is about its width at half its height. Only [[law]] asks for it.
    """

    pulse_ms: Annotated[float, limited("ms", gt=0, le=100)] = 5.0


class DiagnoseTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a diagnosis need not explain: a mismatch of so many percent of |H| does not matter."""

    matters_percent: Sd = 1.0

    @property
    def matters(self) -> float:
        """The same as a fraction of |H|."""
        return self.matters_percent / 100


class ControllerTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the robot's controller counts its axes: its angle is sign · the URDF's + offset.

    `joints` are the URDF's in the controller's order (none: the URDF's own), `signs` and
    `offsets_deg` go with it; of a joint that slides places and offset are in mm. `external` names
    those that are no axes of the arm (E1, E2, …), as rails and turntables.
    Programs drive at `speed_percent` of the controller's full speed.
    """

    joints: tuple[str, ...] = ()
    signs: tuple[Literal[1, -1], ...] = ()
    offsets_deg: tuple[float, ...] = ()
    external: tuple[str, ...] = ()
    speed_percent: Annotated[float, limited("%", gt=0, le=100)] = 10.0


class WorkspaceTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where the model has to be good: a joint box, or positions with a tool axis.

    In `joints_deg`, here and elsewhere, the numbers of joints that slide are millimetres.
    """

    joints_deg: list[tuple[float, float]] | None = None
    position_m: list[tuple[float, float]] | None = None
    tool_axis: tuple[float, float, float] | None = None
    rotation_deg: tuple[float, float] | None = None


class RobotConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole of robot.toml; what `effects` add stands in the other lists, after their own.

    `urdf` is a file, named from the folder of robot.toml. `tcp_frame` names the link of it where
    the hammer hits, `sensor_frame` the one where the accelerometer sits, or a [[point]] beside a
    link; their axes are parallel.
    `gravity` is in m/s² along the axes of the URDF's base. `band_hz` is where the simulation is
    meant to hold.
    `held` says where joints stay that do not move in the tests: NAME_m = 1.2 or NAME_mm = 1200 for
    a rail, NAME_deg = 30 for a turntable. Others may slide or turn from pose to pose; wherever
    joints are listed (`joints_deg`), the number of one that slides (prismatic) is in millimetres.
    Joints that follow others (<mimic> in the URDF) go with them and are listed nowhere.

    Unless `geometric_stiffness` is false the robot is linearised where it sags under gravity, and
    gravity's own stiffness, of the size of weight times height, is added.
    `stiffness_sd_percent` is how well each stated stiffness is known,
    `stiffness_bias_sd_percent` by how much all of them may be off together, as gear makers' are.
    """

    name: str
    urdf: str
    tcp_frame: str
    sensor_frame: str
    gravity: tuple[Acceleration, Acceleration, Acceleration] = (0.0, 0.0, -9.81)
    band_hz: tuple[float, float] = (4.0, 90.0)
    held: dict[str, float] = {}
    geometric_stiffness: bool = True
    stiffness_sd_percent: StatedSd | None = None
    stiffness_bias_sd_percent: StatedSd | None = None
    compliance: tuple[Compliance, ...] = ()
    link: tuple[LinkTable, ...] = ()
    payload: tuple[Payload, ...] = ()
    law: tuple[LawTable, ...] = ()
    obstacle: tuple[Obstacle, ...] = ()
    point: tuple[PointTable, ...] = ()
    collision: CollisionTable = CollisionTable()
    effects: tuple[EffectTable, ...] = ()
    resonator: tuple[Resonator, ...] = ()
    harmonic: tuple[Harmonic, ...] = ()
    hits: HitsTable = HitsTable()
    hammer: HammerTable = HammerTable()
    sensor: SensorTable = SensorTable()
    readback: ReadbackTable = ReadbackTable()
    diagnose: DiagnoseTable = DiagnoseTable()
    controller: ControllerTable = ControllerTable()


LISTS = "compliance", "payload", "resonator", "harmonic"  # that effects add to

STATED = (0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)  # order of moments, as in a URDF


def symmetric(values: Sequence[float]) -> np.ndarray:
    """(3, 3) of its six numbers in the order of STATED."""
    xx, xy, xz, yy, yz, zz = values
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
