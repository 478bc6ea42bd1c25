"""From URDF and robot.toml to a MuJoCo model: a joint for each of the robot's and each spring.

Neither URDF reader nor rotations are shared with the planner: an error there would hide itself.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from typing import Any

import numpy as np

from planner.truth.deviation import BentLink, Deviation, Spring

MOST_SLENDER, LEAST_SLENDER = 0.6, 0.01  # of a bending link's mass, that is spread along it
THICK = 0.05  # radius of a beam over its length, for the inertia of its pieces


class Builder:
    """URDF to MJCF; `joint_names`, `slides` and `limits` are known once `xml` has been called."""

    def __init__(
        self,
        root: Any,  # ElementTree elements: Any spares a None check per attribute
        table: dict,
        springs: tuple[Spring, ...],
        deviation: Deviation,
        rng: np.random.Generator,
    ):
        self._links = {link.get("name"): link for link in root.findall("link")}
        self._children: dict[str, list[Any]] = {}
        for joint in root.findall("joint"):
            self._children.setdefault(joint.find("parent").get("link"), []).append(joint)
        childs = {j.find("child").get("link") for js in self._children.values() for j in js}
        self._root = next(name for name in self._links if name not in childs)
        self._table, self._springs = table, springs
        self._deviation, self._rng = deviation, rng
        self.joint_names: list[str] = []
        self.slides: list[bool] = []
        self.limits: list[tuple[float, float]] = []

    def xml(self) -> str:
        """The model as MJCF; draws the scatter of the inertias, so call it once."""
        top = ElementTree.Element("mujoco")
        ElementTree.SubElement(top, "compiler", angle="radian", autolimits="false")
        world = ElementTree.SubElement(top, "worldbody")
        base = ElementTree.SubElement(world, "body", name=self._root)
        self._hinges(base, "base")
        self._sites(base, self._root)
        self._lumps(base, self._root)
        self._inertial(base, self._root)
        self._grow(base, self._root)
        return ElementTree.tostring(top, encoding="unicode")

    def _hinges(self, body: ElementTree.Element, joint: str) -> None:
        for i, spring in enumerate(self._springs):
            if spring.joint == joint:
                axis, kind = _text(spring.axis), "slide" if spring.slide else "hinge"
                ElementTree.SubElement(body, "joint", name=f"spring_{i}", type=kind, axis=axis)

    def _grow(
        self, parent: ElementTree.Element, link: str, shift: np.ndarray | None = None
    ) -> None:
        """The bodies that hang on `link`; `shift` (3,) is where `parent` sits in its frame."""
        for joint in self._children.get(link, []):
            name, child = joint.get("name"), joint.find("child").get("link")
            position, quaternion = _placement(joint.find("origin"))
            if shift is not None:
                position = _text(np.array([float(v) for v in position.split()]) - shift)
            body = ElementTree.SubElement(parent, "body", name=child, pos=position, quat=quaternion)
            for site in ("tcp", "sensor"):
                if child == self._table[f"{site}_frame"]:
                    ElementTree.SubElement(body, "site", name=site)
            if joint.get("type") != "fixed":
                axis = joint.find("axis")
                xyz = "1 0 0" if axis is None else axis.get("xyz")
                slides = joint.get("type") == "prismatic"
                kind = "slide" if slides else "hinge"
                ElementTree.SubElement(body, "joint", name=name, type=kind, axis=xyz)
                self.joint_names.append(name)
                self.slides.append(slides)
                self.limits.append(_limits(joint))
                self._hinges(body, name)
            self._lumps(body, child)
            beams = [beam for beam in self._deviation.beams if beam.link == child]
            if beams:
                self._bent(body, beams[0])
            elif any(s.joint == child for s in self._springs):
                self._split(body, child)
            else:
                self._sites(body, child)
                self._inertial(body, child)
                self._grow(body, child)

    def _split(self, body: ElementTree.Element, link: str) -> None:
        """A link in two halves with springs between, half-way to the farthest frame it carries."""
        places = [_placement(joint.find("origin"))[0] for joint in self._children[link]]
        ends = [np.array([float(v) for v in place.split()]) for place in places]
        end = max(ends, key=lambda place: float(np.linalg.norm(place)))
        mass, centre, tensor = self._scattered(link)
        along = end / np.linalg.norm(end)
        # Two halves apart by ±d keep the link's mass, centre and inertia; a uniform rod has this d.
        second = np.trace(tensor) / 2 * np.eye(3) - tensor
        apart = np.sqrt(0.75 / (mass * (along @ np.linalg.solve(second, along))))
        half = (tensor - mass * apart**2 * (np.eye(3) - np.outer(along, along))) / 2
        _inertial(body, mass / 2, centre - apart * along, half)
        self._sites(body, link, end, (-np.inf, 0.5))
        outer = ElementTree.SubElement(body, "body", name=f"{link} outer", pos=_text(end / 2))
        self._hinges(outer, link)
        self._sites(outer, link, end, (0.5, np.inf), end / 2)
        _inertial(outer, mass / 2, centre + apart * along - end / 2, half)
        self._grow(outer, link, end / 2)

    def _bent(self, body: ElementTree.Element, beam: BentLink) -> None:
        """A link as a chain of rigid pieces; what no slender beam can have stays on the first."""
        places = [_placement(joint.find("origin"))[0] for joint in self._children[beam.link]]
        ends = [np.array([float(v) for v in place.split()]) for place in places]
        end = max(ends, key=lambda place: float(np.linalg.norm(place)))
        mass, centre, tensor = self._scattered(beam.link)
        slender, rest = _slender(mass, centre, tensor, end, 0.5 / beam.elements)
        _inertial(body, *rest)
        piece, step, first = body, end / beam.elements, 0.5 / beam.elements
        self._sites(body, beam.link, end, (-np.inf, first))
        for element in range(beam.elements):
            # Springs sit in the middle of elements; the last piece is half as long.
            size = (0.5 if element == beam.elements - 1 else 1.0) * step
            own = slender * np.linalg.norm(size) / np.linalg.norm(end - step / 2)
            shift = step / 2 if element == 0 else step
            name = f"{beam.link} piece {element}"
            piece = ElementTree.SubElement(piece, "body", name=name, pos=_text(shift))
            self._hinges(piece, f"{beam.link} element {element}")
            start = first + element / beam.elements
            reach = (start, np.inf if element == beam.elements - 1 else start + 2 * first)
            self._sites(piece, beam.link, end, reach, start * end)
            _inertial(piece, float(own), size / 2, _rod(float(own), size, end))
        self._grow(piece, beam.link, end - step / 2)

    def _sites(
        self,
        body: ElementTree.Element,
        link: str,
        end: np.ndarray | None = None,
        reach: tuple[float, float] = (-np.inf, np.inf),
        shift: np.ndarray | None = None,
    ) -> None:
        """Points of a link on one of its bodies: those within a reach, in shares of its `end`.

        `shift` (3,) is where the body sits in the link's frame.
        """
        for point in self._table.get("point", ()):
            place = np.array(point.get("position_m", (0.0, 0.0, 0.0)), dtype=float)
            share = 0.0 if end is None else float(place @ end / (end @ end))
            if point.get("link") == link and reach[0] <= share < reach[1]:
                turned = np.deg2rad(point.get("rpy_deg", (0.0, 0.0, 0.0)))
                at = place if shift is None else place - shift
                quat = _quaternion(*turned)
                name = str(point["name"])
                if name not in ("tcp", "sensor"):
                    ElementTree.SubElement(body, "site", name=name, pos=_text(at), quat=quat)

    def _lumps(self, body: ElementTree.Element, link: str) -> None:
        for extra in (a for a in self._deviation.added if a.link == link):
            # A point would do for the mass, but MuJoCo wants every body to have some inertia.
            lump = ElementTree.SubElement(body, "body", pos=_text(extra.position_m))
            _inertial(lump, extra.mass_kg, np.zeros(3), 1e-4 * extra.mass_kg * np.eye(3))
        for i, small in enumerate(self._deviation.resonators):
            if small.link == link:
                lump = ElementTree.SubElement(body, "body", pos=_text(small.position_m))
                self._hinges(lump, f"resonator {i}")
                _inertial(lump, small.mass_kg, np.zeros(3), 1e-4 * small.mass_kg * np.eye(3))

    def _inertial(self, body: ElementTree.Element, link: str) -> None:
        if self._links[link].find("inertial") is not None:
            _inertial(body, *self._scattered(link))

    def _scattered(self, link: str) -> tuple[float, np.ndarray, np.ndarray]:
        """Mass, centre (3,) and inertia (3, 3) about it, both in the link's frame."""
        inertial = self._links[link].find("inertial")
        scale = float(np.exp(self._deviation.inertia * self._rng.standard_normal()))
        turn = float(np.exp(self._deviation.inertia * self._rng.standard_normal()))
        shift = self._deviation.com_m * self._rng.standard_normal(3)
        position, quaternion = _placement(inertial.find("origin"))
        place = np.array([float(v) for v in position.split()]) + shift
        entries = inertial.find("inertia")
        xx, yy, zz, xy, xz, yz = (
            float(entries.get(k, 0)) * scale * turn
            for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        )
        rotation = _matrix(quaternion)
        tensor = rotation @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ rotation.T
        return float(inertial.find("mass").get("value")) * scale, place, tensor


def _rod(mass_kg: float, along: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """Inertia (3, 3) about the centre of a piece (3,) of a rod (3,), of THICK times its length."""
    radius2 = (THICK * np.linalg.norm(whole)) ** 2
    second = np.outer(along, along) / 12 + radius2 / 4 * np.eye(3)
    return mass_kg * (np.trace(second) * np.eye(3) - second)


def _slender(
    mass: float, centre: np.ndarray, tensor: np.ndarray, end: np.ndarray, start: float
) -> tuple[float, tuple[float, np.ndarray, np.ndarray]]:
    """Mass of a beam from `start` (a share) to `end`; and mass, centre, inertia of the rest.

    As much of the link's mass as leaves a rest that can be: one with second moments > 0.
    """

    def second(about: np.ndarray, m: float, inertia: np.ndarray) -> np.ndarray:
        return np.trace(inertia) / 2 * np.eye(3) - inertia + m * np.outer(about, about)

    rod, middle = MOST_SLENDER * mass, (1 + start) / 2 * end
    whole = second(centre, mass, tensor)
    while True:
        left = mass - rod
        place = (mass * centre - rod * middle) / left
        beam = second(middle, rod, _rod(rod, (1 - start) * end, end))
        own = whole - beam - left * np.outer(place, place)
        if np.min(np.linalg.eigvalsh(own)) > 0 or rod < LEAST_SLENDER * mass:
            return rod, (left, place, np.trace(own) * np.eye(3) - own)
        rod *= 0.8


def _inertial(
    body: ElementTree.Element, mass_kg: float, centre: np.ndarray, tensor: np.ndarray
) -> None:
    order = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    ElementTree.SubElement(
        body,
        "inertial",
        pos=_text(centre),
        mass=repr(float(mass_kg)),
        fullinertia=_text([tensor[ij] for ij in order]),
    )


def _text(values: Iterable[float]) -> str:
    return " ".join(repr(float(v)) for v in values)


def _limits(joint: Any) -> tuple[float, float]:
    limit = joint.find("limit")
    if limit is None or joint.get("type") == "continuous":
        return -np.pi, np.pi
    return float(limit.get("lower", 0.0)), float(limit.get("upper", 0.0))


def _placement(origin: ElementTree.Element | None) -> tuple[str, str]:
    """Position and quaternion (w x y z) of a URDF origin."""
    if origin is None:
        return "0 0 0", "1 0 0 0"
    return origin.get("xyz", "0 0 0"), _quaternion(
        *(float(v) for v in origin.get("rpy", "0 0 0").split())
    )


def _quaternion(roll: float, pitch: float, yaw: float) -> str:
    """w x y z of roll, pitch and yaw in rad."""
    cr, sr, cp, sp = np.cos(roll / 2), np.sin(roll / 2), np.cos(pitch / 2), np.sin(pitch / 2)
    cy, sy = np.cos(yaw / 2), np.sin(yaw / 2)
    values = (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
    return _text(values)


def _matrix(quaternion: str) -> np.ndarray:
    w, x, y, z = (float(v) for v in quaternion.split())
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
