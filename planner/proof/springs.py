"""All springs of a true robot: those that robot.toml states, as they are, and those it lacks.

Damping is partly a loss factor: Maxwell branches whose losses hardly go with frequency.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.proof.deviation import BentLink, Compensator, Deviation, Spring, triple

STATED = ("stiffness", "n_m"), ("damping", "n_s_m")  # entries of a shift, with their units

ANGLE_STEP = 1e-4  # rad, for the change of a gas spring's torque

OF_TOOL = "tcp", "sensor"  # points that need no link: robot.toml names their frames

LOSS_BAND_HZ = 1.5, 300.0  # where a loss factor is nearly the same: all bands of the arms
BRANCHES = 5  # a factor of 3.8 apart: within the band the loss factor varies by a tenth
MIDDLE_HZ = 15.0  # where a loss factor takes as much as the viscous damping it replaces


def check(table: dict, root: ElementTree.Element, deviation: Deviation, robot_toml: Path) -> None:
    """Raise InputError for places that do not exist, which would be left out in silence."""
    joints = {j.get("name") for j in root.findall("joint") if j.get("type") != "fixed"}
    links = {link.get("name") for link in root.findall("link")}
    stated = [c["joint"] for c in table.get("compliance", ())]
    wrong = [name for name in stated if name not in joints | {"base"}]
    wrong += [s.joint for s in deviation.extra if s.joint not in joints | links | {"base"}]
    at_links = (*deviation.added, *deviation.resonators, *deviation.beams)
    wrong += [a.link for a in at_links if a.link not in links]
    wrong += [name for b in deviation.bridges for name in b.links if name not in links]
    changes = (*deviation.scaled, *deviation.harmonics, *deviation.compensators, *deviation.servos)
    named = [change.joint for change in changes]
    named += [wave.by for wave in deviation.harmonics if wave.by]
    named += [name for loop in deviation.feedback for name in (loop.driven, loop.sensed)]
    wrong += [name for name in named if name not in stated]
    points = [p for p in table.get("point", ()) if p.get("link") or p["name"] not in OF_TOOL]
    wrong += [p.get("link") for p in points if p.get("link") not in links]
    wrong += [table.get(k) for k in ("tcp_frame", "sensor_frame") if table.get(k) not in links]
    if wrong or not stated:
        what = f"no joint or link {wrong[0]}" if wrong else "no [[compliance]]"
        raise InputError(f"{robot_toml} and its URDF have {what}; correct the name or add it.")


def springs(
    table: dict, root: ElementTree.Element, deviation: Deviation, rng: np.random.Generator
) -> tuple[tuple[Spring, ...], dict[str, int]]:
    """The stated ones first; and where a joint's own one is, or a named other.

    Names of others are "extra K" and "resonator K", K counting in the deviation.
    """
    nominal = [_stated(c) for c in table["compliance"]]
    axes = own_axes(root)
    factors = {change.joint: change.factor for change in deviation.scaled}
    scattered = [
        _times(_deviating(s, deviation, rng), factors.get(s.joint, 1.0))
        if _parallel(s, axes)
        else _deviating(s, deviation, rng)
        for s in nominal
    ]
    scattered = [_times(s, deviation.common) for s in scattered]
    if deviation.mixed > 0:  # of the gears' own springs: each branch costs the engine a state
        gears = [i for i, s in enumerate(scattered) if _parallel(s, axes)]
        for i, s in zip(gears, mixed([scattered[i] for i in gears], deviation), strict=True):
            scattered[i] = s
    bent = [s for beam in deviation.beams for s in _beam(beam, root)]
    small = []
    for i, r in enumerate(deviation.resonators):
        w = 2 * np.pi * r.frequency_hz
        k, c = r.mass_kg * w**2, 2 * r.damping_ratio * r.mass_kg * w
        small.append(Spring(f"resonator {i}", r.direction, k, c, slide=True))
    found = (*scattered, *deviation.extra, *bent, *small)
    own = {s.joint: i for i, s in reversed(list(enumerate(found))) if _parallel(s, axes)}
    own |= {f"extra {k}": len(nominal) + k for k in range(len(deviation.extra))}
    own |= {s.joint: len(found) - len(small) + k for k, s in enumerate(small)}
    return found, own


def compensation(spring: Compensator, angle_rad: float) -> float:
    """Stiffness (N·m/rad) that a gas spring adds to its joint at an angle."""

    def torque(angle: float) -> float:
        turned = angle + spring.offset_rad
        product = spring.arm_m * spring.base_m
        length = np.sqrt(spring.arm_m**2 + spring.base_m**2 - 2 * product * np.cos(turned))
        force = spring.force_n + spring.stiffness * (length - spring.arm_m)
        return float(force * product * np.sin(turned) / length)

    return (torque(angle_rad + ANGLE_STEP) - torque(angle_rad - ANGLE_STEP)) / (2 * ANGLE_STEP)


def _stated(block: dict) -> Spring:
    """Of a [[compliance]]: a shift where it says so, is stated in N/m, or has a lever."""
    slide = bool(block.get("slide", False)) or "stiffness_n_m" in block or "lever_m" in block
    lever = block.get("lever_m", 1.0)
    k, c = (block[f"{n}_{u}" if f"{n}_{u}" in block else n] / lever**2 for n, u in STATED)
    return Spring(block["joint"], tuple(block["axis"]), k, c, slide)


def _deviating(spring: Spring, deviation: Deviation, rng: np.random.Generator) -> Spring:
    k = spring.stiffness * np.exp(deviation.stiffness * rng.standard_normal())
    c = spring.damping * np.exp(deviation.damping * rng.standard_normal())
    return replace(spring, stiffness=float(k), damping=float(c * k / spring.stiffness))


def vector(text: str) -> np.ndarray:
    """Numbers of a URDF's attribute."""
    return np.array([float(v) for v in text.split()])


def own_axes(root: ElementTree.Element) -> dict[str, tuple[np.ndarray, bool]]:
    """Axes (3,) of the joints, and whether they slide along them."""
    axes = {}
    for joint in root.findall("joint"):
        axis = joint.find("axis")
        text = "1 0 0" if axis is None else axis.get("xyz", "1 0 0")
        if joint.get("type") != "fixed":
            axes[joint.get("name", "")] = vector(text), joint.get("type") == "prismatic"
    return axes


def _parallel(spring: Spring, axes: dict[str, tuple[np.ndarray, bool]]) -> bool:
    """Whether a spring turns about the axis of its joint, or shifts along that of one that does."""
    own, slides = axes.get(spring.joint, (None, False))
    if own is None or spring.slide != slides:
        return False
    return bool(np.allclose(np.cross(own, spring.axis), 0, atol=1e-9))


def _times(spring: Spring, factor: float) -> Spring:
    return replace(spring, stiffness=factor * spring.stiffness, damping=factor * spring.damping)


def across(along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors normal to one."""
    along = along / np.linalg.norm(along)
    first = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    first /= np.linalg.norm(first)
    return first, np.cross(along, first)


def beam_end(link: str, root: ElementTree.Element) -> np.ndarray:
    """(3,) in m: the farthest frame that a link carries, in its own."""
    ends = []
    for joint in root.findall("joint"):
        parent, origin = joint.find("parent"), joint.find("origin")
        if parent is not None and parent.get("link") == link and origin is not None:
            ends.append(vector(origin.get("xyz", "0 0 0")))
    return max(ends, key=lambda place: float(np.linalg.norm(place)))


def _beam(beam: BentLink, root: ElementTree.Element) -> list[Spring]:
    """Three springs an element; in series they are the link's compliances."""
    along = beam_end(beam.link, root)
    axes = *across(along), along / np.linalg.norm(along)
    found = []
    for element in range(beam.elements):
        for axis, whole in zip(axes, (*beam.bending, beam.torsion), strict=True):
            k, name = whole * beam.elements, f"{beam.link} element {element}"
            found.append(Spring(name, triple(axis), k, beam.damping_s * k))
    return found


def mixed(springs: Sequence[Spring], deviation: Deviation) -> list[Spring]:
    """Springs of which a drawn share of the damping is a loss factor's."""
    rng = np.random.default_rng([deviation.seed, 1])
    out = []
    for spring in springs:
        share = deviation.mixed * float(rng.random())
        loss = share * 2 * np.pi * MIDDLE_HZ * spring.damping / spring.stiffness
        out.append(replace(spring, damping=(1 - share) * spring.damping, loss=float(loss)))
    return out


def branches(springs: Sequence[Spring], stiffness: np.ndarray) -> list[tuple[int, float, float]]:
    """(spring, stiffness, rate in 1/s) of Maxwell branches beside springs of `stiffness` (e,)."""
    rates = 2 * np.pi * np.geomspace(*LOSS_BAND_HZ, BRANCHES)
    # Σ x / (1 + x²) over branches a ratio r apart is π / (2 ln r).
    each = 2 * np.log(rates[1] / rates[0]) / np.pi
    return [
        (j, float(each * spring.loss * stiffness[j]), float(rate))
        for j, spring in enumerate(springs)
        if spring.loss > 0
        for rate in rates
    ]
