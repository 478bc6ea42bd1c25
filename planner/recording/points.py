"""Where a structure is hit and felt: points as recordings name them, and directions there.

Two points need no name in any file: where the tool is hit ("tcp") and where its sensor sits
("sensor"). A recording that names no point is of these.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from planner.errors import InputError

TCP, SENSOR = "tcp", "sensor"
AXES = "xyz"
NOT_STATED = " (direction not stated)"  # ends the name of a point that a file gives no direction at
# Directions by their number in universal files: 0 is a scalar, 4 to 6 are rotations.
DIRECTIONS = ("scalar", "x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True, order=True)
class Dof:
    """A node and a signed direction there: "x", "-x", …, "rz", or "scalar" (no direction).

    `node` is the name of a point or the digits of a node number.
    """

    node: str
    direction: str

    def __post_init__(self) -> None:
        if self.direction.removeprefix("-") not in DIRECTIONS or self.direction == "-scalar":
            raise InputError(
                f'Node {self.node}: direction "{self.direction}" is not known; give one of '
                f"{', '.join(DIRECTIONS[1:])}, with - before it where it points the other way."
            )

    @classmethod
    def of_uff(cls, node: int | str, direction: int) -> "Dof":
        """From the node and the direction number (-6…6) of a universal file."""
        if abs(direction) >= len(DIRECTIONS):
            raise InputError(
                f"Node {node}: direction {direction} is not known; universal files count from -6 "
                "to 6."
            )
        return cls(str(node), ("-" if direction < 0 else "") + DIRECTIONS[abs(direction)])

    @property
    def number(self) -> int:
        """The direction's number in universal files, negative where it is turned."""
        return int(self.sign) * DIRECTIONS.index(self.direction.removeprefix("-"))

    @property
    def sign(self) -> float:
        """-1 where the direction points against its axis, else 1."""
        return -1.0 if self.direction.startswith("-") else 1.0

    @property
    def positive(self) -> "Dof":
        """The same place along its axis: what is measured there has to be multiplied by `sign`."""
        return Dof(self.node, self.direction.removeprefix("-"))

    @property
    def is_turn(self) -> bool:
        """Whether it is a rotation about an axis."""
        return self.direction.removeprefix("-").startswith("r")

    @property
    def at(self) -> str:
        """In a sentence: "at node 4, x", "along x" where the node has no name."""
        if self.node in ("", "0"):
            return f"along {self.direction}"
        return f"at node {self.node}, {self.direction}"

    def __str__(self) -> str:
        return self.direction if self.node in ("", "0") else f"{self.node}:{self.direction}"


@dataclass(frozen=True)
class Layout:
    """What rows and columns of FRF matrices are, by threes: x, y, z of each point in its frame.

    A hit point stands twice where it was hit while other sensors listened: those were other hits.
    """

    hits: tuple[str, ...] = (TCP,)
    sensors: tuple[str, ...] = (SENSOR,)

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of rows (responses) and columns (hits)."""
        return 3 * len(self.sensors), 3 * len(self.hits)

    def rows(self, inner: "Layout") -> list[int]:
        """Rows of this layout that are those of an `inner` one."""
        places = [self.sensors.index(name) for name in inner.sensors]
        return [3 * place + axis for place in places for axis in range(3)]

    def columns(self, inner: "Layout") -> list[int]:
        """Columns of this layout that are those of an `inner` one."""
        places = [_numbered(self.hits).index(hit) for hit in _numbered(inner.hits)]
        return [3 * place + axis for place in places for axis in range(3)]


TOOL = Layout()


def together(layouts: Sequence[Layout]) -> Layout:
    """The smallest layout that holds all, points in the order in which they first occur."""
    hits = dict.fromkeys(hit for layout in layouts for hit in _numbered(layout.hits))
    sensors = dict.fromkeys(name for layout in layouts for name in layout.sensors)
    return Layout(tuple(name for name, _ in hits), tuple(sensors))


def _numbered(names: Sequence[str]) -> list[tuple[str, int]]:
    """Each name, and how often it stood before."""
    return [(name, names[:place].count(name)) for place, name in enumerate(names)]


@dataclass(frozen=True)
class PointNames:
    """What a robot calls its points.

    `axes` are those that a point's sensor has ("xyz", "x"), by name; `nodes` names points by the
    digits of node numbers. `hits` and `sensors` name points that are where the tool is hit and
    where its sensor sits: they are these. With `anywhere` recordings are of no robot: every node
    that a file states is a point, and its sensor has whichever axes.
    """

    axes: dict[str, str] = field(default_factory=dict)
    nodes: dict[str, str] = field(default_factory=dict)
    hits: tuple[str, ...] = (TCP,)
    sensors: tuple[str, ...] = (SENSOR,)
    anywhere: bool = False

    @property
    def known(self) -> tuple[str, ...]:
        """All names that a recording may say."""
        return tuple(dict.fromkeys((*self.axes, TCP, SENSOR)))

    def axes_of(self, name: str) -> str:
        """Axes of the sensor at a point, by its own name or by that of the layout."""
        same = (name, *self.sensors) if name == SENSOR else (name,)
        return next((self.axes[one] for one in same if one in self.axes), AXES)

    def hit(self, name: str) -> str:
        """What layouts call a point that is hit."""
        return TCP if name in self.hits else name

    def sensor(self, name: str) -> str:
        """What layouts call a point that has a sensor."""
        return SENSOR if name in self.sensors else name

    def named(self, node: str) -> str | None:
        """The point that a file calls by its name or by its node; None where it says nothing.

        Files of a robot without points, or whose points have no nodes, may state any name or node:
        they say nothing. Raises KeyError where it is no point's.
        """
        if node in self.known or (self.anywhere and node not in ("", "0")):
            return node
        if node in ("", "0") or not (self.nodes if node.isdigit() else self.axes):
            return None
        return self.nodes[node]


ANYWHERE = PointNames(anywhere=True)


@dataclass(frozen=True)
class StatedPoints:
    """What the table of recordings says of a file's points (nothing where empty), and its row."""

    hit_point: str = ""
    response_points: tuple[str, ...] = ()
    row: int | None = None
    names: PointNames = field(default_factory=PointNames)

    @property
    def where(self) -> str:
        """The row in words, for messages."""
        return "" if self.row is None else f" (row {self.row} of recordings.csv)"

    def hit_at(self, source: object, node: str) -> str:
        """The layout's name of the point that was hit, in a file that calls it `node`.

        Raises InputError where the file names no point of the robot, or another than the table.
        """
        return self._at(source, node, "hit", (self.hit_point,) if self.hit_point else ())

    def knows_response(self, node: str) -> bool:
        """Whether a response at a node is at a point of the robot, or of the table's row."""
        try:
            self.response_at("", node)
        except InputError:
            return False
        return True

    def response_at(self, source: object, node: str) -> str:
        """The same of the point where a response was measured."""
        return self._at(source, node, "response", self.response_points)

    def _at(self, source: object, node: str, what: str, stated: tuple[str, ...]) -> str:
        """The point that the file names, else the stated one, else the tool's."""
        own = self._named(source, node, what, stated)
        if own is None and len(stated) > 1:
            raise InputError(
                f"{source}{self.where} does not say which of {', '.join(stated)} a response is "
                f"of; name its node, or its column acceleration_{stated[0]}_x_m_s2."
            )
        known, tool = (self.names.hit, TCP) if what == "hit" else (self.names.sensor, SENSOR)
        if own and stated and known(own) not in map(known, stated):
            where = "was hit" if what == "hit" else "has a response"
            told = own if node == own else f"node {node}, which is {own}"
            raise InputError(
                f"{source}{self.where} {where} at {told}, the table says {', '.join(stated)}; "
                f"correct the one that is wrong."
            )
        return known(own or next(iter(stated), tool))

    def _named(self, source: object, node: str, what: str, stated: tuple[str, ...]) -> str | None:
        """The point at a node; one that robot.toml does not list is that of a stated point.

        If there is just one without a node of its own.
        """
        try:
            return self.names.named(node)
        except KeyError:
            free = [name for name in stated if name not in self.names.nodes.values()]
            if len(free) == 1:
                return free[0]
            nodes = ", ".join(f"{n} ({name})" for n, name in self.names.nodes.items())
            known = f"node {node}" if node.isdigit() else f'point "{node}"'
            raise InputError(
                f"{source}{self.where} has a {what} at {known}, which is none of robot.toml's "
                f"points ({nodes or ', '.join(self.names.known)}); correct it, or add a [[point]]"
                f"{self._tools_node(node, what)}."
            ) from None

    def _tools_node(self, node: str, what: str) -> str:
        """That an unknown node may be the tool's, where robot.toml does not say which that is."""
        tool, of_tool = (TCP, self.names.hits) if what == "hit" else (SENSOR, self.names.sensors)
        if not node.isdigit() or set(of_tool) & set(self.names.nodes.values()):
            return ""
        return f' (name = "{tool}", node = {node}, if it is the tool\'s)'
