"""From URDF and robot.toml to rigid parts: a coordinate for each of the robot's joints and springs.

The URDF reader is not the planner's: an error there would hide itself.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from planner.proof.deviation import BentLink, Deviation, Spring
from planner.proof.mechanics import Hinge, Part
from planner.proof.springs import beam_end, own_axes, vector

MOST_SLENDER, LEAST_SLENDER = 0.6, 0.01  # of a bending link's mass, that is spread along it
THICK = 0.05  # radius of a beam over its length, for the inertia of its pieces

Inertia = tuple[float, np.ndarray, np.ndarray]  # mass, centre (3,), tensor (3, 3) about it


class Builder:
    """`parts`, and `joint_names`, `slides` and `limits` of the robot's own joints.

    Draws the scatter of the inertias.
    """

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
        first = next(name for name in self._links if name not in childs)
        self._root, self._table, self._springs = root, table, springs
        self._axes = own_axes(root)
        self._deviation, self._rng = deviation, rng
        self.parts: list[Part] = []
        self.joint_names: list[str] = []
        self.slides: list[bool] = []
        self.limits: list[tuple[float, float]] = []
        base = self._add(first, -1, np.zeros(3), hinges=self._hinges("base"))
        self._sites(base, first)
        self._lumps(base, first)
        self._inertial(base, first)
        self._grow(base, first)

    def _add(self, name: str, parent: int, place: np.ndarray, **more: Any) -> int:
        self.parts.append(Part(name, parent, place, **more))
        return len(self.parts) - 1

    def _change(self, part: int, **changes: Any) -> None:
        self.parts[part] = replace(self.parts[part], **changes)

    def _weigh(self, part: int, inertia: Inertia) -> None:
        mass, centre, tensor = inertia
        self._change(part, mass=mass, centre=centre, tensor=tensor)

    def _hinges(self, joint: str) -> list[Hinge]:
        return [
            Hinge(f"spring_{i}", spring.axis, spring.slide)
            for i, spring in enumerate(self._springs)
            if spring.joint == joint
        ]

    def _grow(self, parent: int, link: str, shift: np.ndarray | float = 0.0) -> None:
        """The bodies that hang on `link`; `shift` (3,) is where `parent` sits in its frame."""
        for joint in self._children.get(link, []):
            name, child = joint.get("name"), joint.find("child").get("link")
            place, rotation = _placement(joint.find("origin"))
            hinges: list[Hinge] = []
            if joint.get("type") != "fixed":
                along, slides = self._axes[name]
                hinges = [Hinge(name, along, slides), *self._hinges(name)]
                self.joint_names.append(name)
                self.slides.append(slides)
                self.limits.append(_limits(joint))
            sites = [
                (site, np.zeros(3), np.eye(3))
                for site in ("tcp", "sensor")
                if child == self._table[f"{site}_frame"]
            ]
            body = self._add(
                child, parent, place - shift, rotation=rotation, hinges=hinges, sites=sites
            )
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

    def _split(self, body: int, link: str) -> None:
        """A link in two halves with springs between, half-way to the farthest frame it carries."""
        end = beam_end(link, self._root)
        mass, centre, tensor = self._scattered(link)
        along = end / np.linalg.norm(end)
        # Two halves apart by ±d keep the link's mass, centre and inertia; a uniform rod has this d.
        second = np.trace(tensor) / 2 * np.eye(3) - tensor
        apart = np.sqrt(0.75 / (mass * (along @ np.linalg.solve(second, along))))
        half = (tensor - mass * apart**2 * (np.eye(3) - np.outer(along, along))) / 2
        self._weigh(body, (mass / 2, centre - apart * along, half))
        self._sites(body, link, end, (-np.inf, 0.5))
        outer = self._add(f"{link} outer", body, end / 2, hinges=self._hinges(link))
        self._sites(outer, link, end, (0.5, np.inf), end / 2)
        self._weigh(outer, (mass / 2, centre + apart * along - end / 2, half))
        self._grow(outer, link, end / 2)

    def _bent(self, body: int, beam: BentLink) -> None:
        """A link as a chain of rigid pieces; what no slender beam can have stays on the first."""
        end, link = beam_end(beam.link, self._root), beam.link
        slender, rest = _slender(*self._scattered(link), end, 0.5 / beam.elements)
        self._weigh(body, rest)
        piece, step, first = body, end / beam.elements, 0.5 / beam.elements
        self._sites(body, link, end, (-np.inf, first))
        for element in range(beam.elements):
            # Springs sit in the middle of elements; the last piece is half as long.
            size = (0.5 if element == beam.elements - 1 else 1.0) * step
            own = float(slender * np.linalg.norm(size) / np.linalg.norm(end - step / 2))
            shift = step / 2 if element == 0 else step
            hinges = self._hinges(f"{link} element {element}")
            piece = self._add(f"{link} piece {element}", piece, shift, hinges=hinges)
            start = first + element / beam.elements
            reach = (start, np.inf if element == beam.elements - 1 else start + 2 * first)
            self._sites(piece, link, end, reach, start * end)
            self._weigh(piece, (own, size / 2, _rod(own, size, end)))
        self._grow(piece, link, end - step / 2)

    def _sites(
        self,
        body: int,
        link: str,
        end: np.ndarray | None = None,
        reach: tuple[float, float] = (-np.inf, np.inf),
        shift: np.ndarray | float = 0.0,
    ) -> None:
        """Points of a link on one of its bodies: those within a reach, in shares of its `end`.

        `shift` (3,) is where the body sits in the link's frame.
        """
        for point in self._table.get("point", ()):
            place = np.array(point.get("position_m", (0.0, 0.0, 0.0)), dtype=float)
            share = 0.0 if end is None else float(place @ end / (end @ end))
            name, here = str(point["name"]), reach[0] <= share < reach[1]
            if point.get("link") == link and here and name not in ("tcp", "sensor"):
                turn = _turn(np.deg2rad(point.get("rpy_deg", (0.0, 0.0, 0.0))))
                self._change(body, sites=[*self.parts[body].sites, (name, place - shift, turn)])

    def _lumps(self, body: int, link: str) -> None:
        small = [(r, self._hinges(f"resonator {i}"))
                 for i, r in enumerate(self._deviation.resonators)]  # fmt: skip
        for extra, hinges in [*((a, []) for a in self._deviation.added), *small]:
            if extra.link == link:
                # A point would do for the mass, but MuJoCo wants every body to have some inertia.
                lump = self._add("", body, np.array(extra.position_m), hinges=hinges)
                self._weigh(lump, (extra.mass_kg, np.zeros(3), 1e-4 * extra.mass_kg * np.eye(3)))

    def _inertial(self, body: int, link: str) -> None:
        if self._links[link].find("inertial") is not None:
            self._weigh(body, self._scattered(link))

    def _scattered(self, link: str) -> Inertia:
        """Mass, centre (3,) and inertia (3, 3) about it, both in the link's frame."""
        inertial = self._links[link].find("inertial")
        scale = float(np.exp(self._deviation.inertia * self._rng.standard_normal()))
        turn = float(np.exp(self._deviation.inertia * self._rng.standard_normal()))
        shift = self._deviation.com_m * self._rng.standard_normal(3)
        place, rotation = _placement(inertial.find("origin"))
        entries = inertial.find("inertia")
        xx, yy, zz, xy, xz, yz = (
            float(entries.get(k, 0)) * scale * turn
            for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        )
        tensor = rotation @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ rotation.T
        return float(inertial.find("mass").get("value")) * scale, place + shift, tensor


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


def _limits(joint: Any) -> tuple[float, float]:
    limit = joint.find("limit")
    if limit is None or joint.get("type") == "continuous":
        return -np.pi, np.pi
    return float(limit.get("lower", 0.0)), float(limit.get("upper", 0.0))


def _placement(origin: Any) -> tuple[np.ndarray, np.ndarray]:
    """Place (3,) and rotation (3, 3) of a URDF origin."""
    if origin is None:
        return np.zeros(3), np.eye(3)
    return vector(origin.get("xyz", "0 0 0")), _turn(vector(origin.get("rpy", "0 0 0")))


def _turn(rpy: np.ndarray) -> np.ndarray:
    """(3, 3) of roll, pitch and yaw in rad, about fixed axes."""
    return Rotation.from_euler("xyz", rpy).as_matrix()
