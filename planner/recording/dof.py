"""Degrees of freedom of a test: where it was hit or felt, and along which signed direction."""

from dataclasses import dataclass

from planner.errors import InputError

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
