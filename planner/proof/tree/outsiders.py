"""Concealed physics that no name of the library covers."""

import numpy as np

from planner.proof.tree.blueprint import Blueprint, link_way
from planner.proof.tree.effects import Effect, log_uniform
from planner.proof.tree.laws import FluidDamper, LateFeedback, Servo, Spring
from planner.proof.tree.spatial import inertia_of
from planner.proof.tree.stating import Truth
from planner.proof.tree.system import Tie
from planner.proof.tree.tree import Tree


def _unknown(kind: str, parameters: dict, apply) -> Effect:
    return Effect("unknown", None, {"kind": kind, **parameters}, apply)


def gyroscopic_spindle(rng: np.random.Generator, truth: Truth, _poses) -> Effect:
    """A rotor that keeps turning in the tool: angular momentum (N m s) along the tool's z."""
    inertia = np.linalg.eigvalsh(inertia_of(truth.robot.links[-1].second))[1]
    momentum = log_uniform(rng, 0.1, 3) * float(inertia) * 2 * np.pi * 20
    vector = truth.robot.tool[0][:, 2] * momentum

    def apply(plan: Blueprint, _q: np.ndarray, _w: float) -> None:
        plan.spin = vector

    return _unknown("gyroscopic_spindle", {"momentum": momentum}, apply)


def servo_loop(rng: np.random.Generator, truth: Truth, _poses) -> Effect:
    """A joint held by its drive: stiffness that depends on frequency, leading or lagging."""
    joint = int(rng.integers(min(4, len(truth.gears))))
    share = log_uniform(rng, 0.08, 1.2)
    middle, apart = 2 * np.pi * log_uniform(rng, 8, 40), log_uniform(rng, 1.2, 4)
    lead = rng.random() < 0.7
    zero, pole = (middle / apart, middle * apart) if lead else (middle * apart, middle / apart)
    delay = float(rng.uniform(0, 0.001))

    def apply(plan: Blueprint, _q: np.ndarray, _w: float) -> None:
        plan.gears[joint] = Servo(plan.gears[joint], share, zero, pole, delay)

    values = {"joint": joint + 1, "share": share, "zero": zero, "pole": pole, "delay": delay}
    return _unknown("servo_loop", values, apply)


def _point(
    tree: Tree, links: list[int], link: int, place: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """World place (m) and (3, n) jacobian of a point given in a link's frame."""
    world = tree.at(links[link], place)
    return world, tree.jacobian(links[link], world)[:3]


def fluid_damper(rng: np.random.Generator, truth: Truth, _poses) -> Effect:
    """A tuned fluid damper between two links, two joints apart: inertance, damper and spring."""
    first = int(rng.integers(0, len(truth.gears) - 2))
    second, reach = first + 2, truth.robot.reach
    places = [
        0.6 * link_way(truth.robot, i) + 0.08 * reach * rng.normal(size=3) for i in (first, second)
    ]
    stiffness = log_uniform(rng, 0.1, 6) * truth.gears[first + 1].stiffness / (0.3 * reach) ** 2
    omega = 2 * np.pi * log_uniform(rng, 8, 60)
    inertance = stiffness / omega**2
    law = FluidDamper(stiffness, 2 * rng.uniform(0.05, 0.5) * inertance * omega, inertance)

    def make(tree: Tree, links: list[int]) -> Tie:
        (a, ja), (b, jb) = (
            _point(tree, links, i, p) for i, p in zip((first, second), places, strict=True)
        )
        row = (b - a) / np.linalg.norm(b - a) @ (jb - ja)
        return Tie("fluid", row, row, law)

    values = {"links": [first + 1, second + 1], "spring": stiffness, "inertance": inertance}
    return _unknown("fluid_damper", values, lambda plan, _q, _w: plan.ties.append(make))


def cable_to_ground(rng: np.random.Generator, truth: Truth, _poses) -> Effect:
    """A cable from a link to a fixed point of the hall: spring and damper along it."""
    link, reach = int(rng.integers(1, len(truth.gears))), truth.robot.reach
    place = link_way(truth.robot, link) * rng.uniform(0.3, 1)
    anchor = np.array([*(rng.uniform(-1, 1, 2) * 1.5 * reach), rng.uniform(1.2, 2.0) * reach])
    stiffness = log_uniform(rng, 0.03, 3) * truth.gears[1].stiffness / reach**2
    law = Spring(stiffness, rng.uniform(0.02, 0.3) * stiffness / (2 * np.pi * 15))

    def make(tree: Tree, links: list[int]) -> Tie:
        world, jacobian = _point(tree, links, link, place)
        row = (world - anchor) / np.linalg.norm(world - anchor) @ jacobian
        return Tie("cable", row, row, law)

    values = {"link": link + 1, "stiffness": stiffness, "anchor": anchor.tolist()}
    return _unknown("cable_to_ground", values, lambda plan, _q, _w: plan.ties.append(make))


def _gear(tree: Tree, joint: int) -> np.ndarray:
    return np.eye(len(tree.names))[tree.names.index(f"joint_{joint + 1}:gear")]


def joint_coupling(rng: np.random.Generator, truth: Truth, _poses) -> Effect:
    """One joint's twist loads another: off-diagonal stiffness rho sqrt(k_i k_j), both ways."""
    i = int(rng.integers(0, len(truth.gears) - 1))
    j = int(rng.integers(i + 1, min(i + 3, len(truth.gears))))
    rho = log_uniform(rng, 0.05, 0.6) * rng.choice([-1, 1])
    a, b = truth.gears[i], truth.gears[j]
    law = Spring(
        float(rho * np.sqrt(a.stiffness * b.stiffness)), float(rho * np.sqrt(a.damping * b.damping))
    )

    def apply(plan: Blueprint, _q: np.ndarray, _w: float) -> None:
        plan.ties.append(lambda tree, _l: Tie("coupling", _gear(tree, i), _gear(tree, j), law))
        plan.ties.append(lambda tree, _l: Tie("coupling", _gear(tree, j), _gear(tree, i), law))

    return _unknown("joint_coupling", {"joints": [i + 1, j + 1], "rho": float(rho)}, apply)


def late_feedback(rng: np.random.Generator, truth: Truth, _poses) -> Effect:
    """A controller that answers a joint's twist with torque on it or on the next, some ms late."""
    i = int(rng.integers(0, min(3, len(truth.gears) - 1)))
    j = i + int(rng.random() < 0.5)
    gain = log_uniform(rng, 0.05, 0.6) * float(rng.choice([-1, 1])) * truth.gears[i].stiffness
    law = LateFeedback(gain, log_uniform(rng, 0.002, 0.02), 2 * np.pi * rng.uniform(20, 120))

    def apply(plan: Blueprint, _q: np.ndarray, _w: float) -> None:
        plan.ties.append(lambda tree, _l: Tie("late", _gear(tree, i), _gear(tree, j), law))

    values = {"acts_on": i + 1, "hears": j + 1, "gain": gain, "delay": law.delay}
    return _unknown("late_feedback", values, apply)


def controller(effect: Effect) -> bool:
    """Whether an effect is a controller that may make the robot unstable."""
    return effect.parameters.get("kind") in ("servo_loop", "late_feedback")


def stable(systems: list) -> bool:
    """Whether every mode below 300 Hz keeps a damping ratio above 0.4 % (first order)."""
    for system in systems:
        frequencies, shapes = system.modes()
        some = frequencies < 300
        s = 2j * np.pi * frequencies[some]
        z = system.dynamic_stiffness(s)
        power = np.einsum("ni,inm,mi->i", shapes[:, some], z, shapes[:, some]).imag
        if np.any(power / (2 * np.abs(s) ** 2) < 0.004):
            return False
    return True


OUTSIDERS = (
    gyroscopic_spindle, servo_loop, fluid_damper, cable_to_ground, joint_coupling, late_feedback,
)  # fmt: skip
__all__ = ["OUTSIDERS", "controller", "stable"]
