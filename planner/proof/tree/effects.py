"""Concealed linear effects: each draws its size and says how it changes the elastic robot."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from planner.proof.tree.blueprint import Bend, Blueprint, Hanging, link_way
from planner.proof.tree.laws import Spring
from planner.proof.tree.layouts import X, Y, Z
from planner.proof.tree.spatial import across
from planner.proof.tree.stating import Truth
from planner.proof.tree.tree import Body

Apply = Callable[[Blueprint, np.ndarray, float], None]


def nothing(_plan: Blueprint, _q: np.ndarray, _warmth: float) -> None:
    """Leaves the robot as it is."""


@dataclass(frozen=True)
class Effect:
    """`apply(plan, q, warmth)`: q (rad), warmth 0 to 1 in the course of the campaign.

    `law`: nonlinear torque (see nonlinear.py) of the gear of joint number `joint`; `chain`: what an
    artefact does to the channels.
    """

    effect: str
    at: str | None
    parameters: dict[str, Any]
    apply: Apply = nothing
    law: Any = None
    joint: int = -1
    chain: dict[str, Any] = field(default_factory=dict)
    memory_per_hit: float = 0.0  # hits after which drift has come to 63 %


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Evenly drawn in its logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def base_compliance(rng: np.random.Generator, truth: Truth, _poses) -> Effect:
    """Floor or pedestal tilts about x and y, perhaps turns or bounces; own damping."""
    top = max(truth.gears[0].stiffness, truth.gears[1].stiffness)
    size, ratio = log_uniform(rng, 1.2, 120), log_uniform(rng, 0.5, 2.0)
    hysteretic = bool(rng.integers(2))
    kinds = [("turn", X, top * size), ("turn", Y, top * size * ratio)]
    if rng.random() < 0.3:
        kinds.append(("turn", Z, top * size * log_uniform(rng, 2, 10)))
    if rng.random() < 0.3:
        kinds.append(("slide", Z, top * size * 8 / truth.robot.reach**2))
    loss = rng.uniform(0.02, 0.15)
    springs = [
        (kind, axis, Spring(k, 0.0, loss) if hysteretic else Spring(k, loss * k / (2 * np.pi * 15)))
        for kind, axis, k in kinds
    ]
    return Effect(
        "base_compliance", "base",
        {"stiffness": [float(k) for _, _, k in kinds], "moves": [k[0] for k in kinds],
         "loss_at_15_hz": loss, "hysteretic": hysteretic},
        lambda plan, _q, _w: plan.base.extend(springs),
    )  # fmt: skip


def transverse_compliance(rng: np.random.Generator, truth: Truth, _poses) -> Effect:
    """The bearing of a joint without listed transverse springs tilts about one axis or both."""
    listed = truth.robot.cross or {}
    joint = int(rng.choice([j for j in range(min(5, len(truth.gears))) if j not in listed]))
    size = log_uniform(rng, 0.8, 60)
    factors = [size, size * log_uniform(rng, 0.5, 2)][: 1 + int(rng.random() < 0.7)]
    gear, damping = truth.gears[joint], rng.uniform(0.5, 3)
    springs = [replace(gear.times(f), damping=gear.damping * f * damping) for f in factors]
    axes = across(truth.robot.joints[joint].axis)

    def apply(plan: Blueprint, _q: np.ndarray, _w: float) -> None:
        rest = plan.bearings[joint][len(springs) :]
        plan.bearings[joint] = [*zip(axes, springs, strict=False), *rest]

    return Effect(
        "transverse_compliance", f"joint_{joint + 1}",
        {"stiffness": [s.stiffness for s in springs], "times_gear": factors,
         "axes": [a.tolist() for a in axes[: len(springs)]]}, apply,
    )  # fmt: skip


def joint_stiffness(rng: np.random.Generator, truth: Truth, _poses) -> Effect:
    """A gear far softer or stiffer than stated, against its stated value."""
    joint = int(rng.integers(len(truth.gears)))
    soft = bool(rng.integers(2))
    factor = log_uniform(rng, 0.3, 0.6) if soft else log_uniform(rng, 1.7, 3.0)
    true = factor * truth.robot.gears[joint].stiffness

    def apply(plan: Blueprint, _q: np.ndarray, _w: float) -> None:
        gear = plan.gears[joint]
        plan.gears[joint] = gear.times(true / truth.gears[joint].stiffness)

    return Effect(
        "joint_stiffness", f"joint_{joint + 1}", {"stiffness": true, "times_stated": factor}, apply
    )


def angle_dependent_stiffness(rng: np.random.Generator, truth: Truth, poses) -> Effect:
    """k(q) = k (1 + a f(q)): a ripple, a cable that stiffens, or a gravity compensator's spring."""
    joint = int(rng.integers(1, min(4, len(truth.gears))))
    share, law = log_uniform(rng, 0.05, 0.7), str(rng.choice(["ripple", "cable", "compensator"]))
    middle, half = float(np.mean(poses[:, joint])), float(np.ptp(poses[:, joint])) / 2
    periods, phase = int(rng.integers(1, 4)), float(rng.uniform(0, 2 * np.pi))
    arm = float(rng.uniform(0.2, 0.6))  # of the compensator's lever over its anchor's distance

    def pull(q: float) -> float:
        beta = q + phase
        length = np.sqrt(1 + arm**2 + 2 * arm * np.cos(beta))
        return float((length - 0.35) * arm * np.sin(beta) / length)

    def shape(q: float) -> float:
        if law == "ripple":
            return float(np.cos(periods * q + phase))
        if law == "cable":
            return float(((q - middle) / half) ** 2)
        return -(pull(q + 1e-4) - pull(q - 1e-4)) / 2e-4 / (0.65 * arm)

    def apply(plan: Blueprint, q: np.ndarray, _w: float) -> None:
        plan.gears[joint] = plan.gears[joint].times(max(0.15, 1 + share * shape(float(q[joint]))))

    values = {
        "share": share,
        "law": law,
        "phase": phase,
        "periods": periods,
        "middle": middle,
        "arm": arm,
    }
    return Effect("angle_dependent_stiffness", f"joint_{joint + 1}", values, apply)


def link_flexibility(rng: np.random.Generator, truth: Truth, _poses) -> Effect:
    """A long link bends in two directions: four hinges of 4 EI/L each."""
    robot = truth.robot
    lengths = [float(np.linalg.norm(link_way(robot, i))) for i in range(len(robot.joints))]
    link = int(rng.choice([i for i, length in enumerate(lengths) if length > 0.2 * robot.reach]))
    size, ratio = log_uniform(rng, 0.8, 50), log_uniform(rng, 0.5, 2)
    bending = [truth.gears[link].stiffness * size * f for f in (1, ratio)]
    loss, count = rng.uniform(0.005, 0.03), 4
    springs = tuple(Spring(count * b, loss * count * b / (2 * np.pi * 40)) for b in bending)

    def apply(plan: Blueprint, _q: np.ndarray, _w: float) -> None:
        plan.bends[link] = Bend(count, springs)

    return Effect(
        "link_flexibility", f"link_{link + 1}",
        {"stiffness": bending, "length_m": lengths[link], "hinges": count}, apply,
    )  # fmt: skip


def added_mass(rng: np.random.Generator, truth: Truth, _poses) -> Effect:
    """Something heavy on a link, or (seldom) a link or payload lighter than stated."""
    robot = truth.robot
    link = int(rng.integers(1, len(robot.links)))
    body, total = robot.links[link], sum(b.mass for b in robot.links)
    if rng.random() < 0.25:
        share = log_uniform(rng, 0.08, 0.6)
        return Effect(
            "added_mass", f"link_{link + 1}", {"mass": -share * body.mass, "share_of_link": -share},
            lambda plan, _q, _w: plan.lighter.update({link: 1 - share}),
        )  # fmt: skip
    mass = log_uniform(rng, 0.004, 0.15) * total
    place = rng.uniform(0, 1) * link_way(robot, link) + rng.normal(size=3) * 0.05 * robot.reach
    extra = Body(mass, place, np.eye(3) * mass * (0.02 * robot.reach) ** 2)
    return Effect(
        "added_mass", f"link_{link + 1}", {"mass": mass, "centre": place.tolist()},
        lambda plan, _q, _w: plan.masses.append((link, extra)),
    )  # fmt: skip


def local_resonator(rng: np.random.Generator, truth: Truth, _poses) -> Effect:
    """One or two loose masses on a link: hose pack, bracket. Three springs of unlike stiffness."""
    robot = truth.robot
    link = int(rng.integers(1, len(robot.links)))
    total, items, told = sum(b.mass for b in robot.links), [], []
    for _ in range(1 + int(rng.random() < 0.25)):
        mass, ratio = log_uniform(rng, 0.003, 0.06) * total, rng.uniform(0.01, 0.12)
        place = (
            rng.uniform(0.2, 1) * link_way(robot, link) + rng.normal(size=3) * 0.05 * robot.reach
        )
        middle = log_uniform(rng, 8, 75)
        hertz = [middle * f for f in (1.0, log_uniform(rng, 0.8, 4), log_uniform(rng, 1.5, 6))]
        rates = [2 * np.pi * f for f in hertz]
        springs = [Spring(mass * w**2, 2 * ratio * mass * w) for w in rates]
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0].T
        items.append(Hanging(link, place, mass, tuple(zip(axes, springs, strict=True))))
        told.append({"mass": mass, "frequency_hz": hertz, "damping_ratio": ratio})
    return Effect(
        "local_resonator", f"link_{link + 1}", {"resonators": told},
        lambda plan, _q, _w: plan.hanging.extend(items),
    )  # fmt: skip


def drift(rng: np.random.Generator, truth: Truth, _poses) -> Effect:
    """Some gears grow softer by a few percent as the campaign goes on."""
    count = int(rng.integers(1, len(truth.gears) + 1))
    joints = sorted(int(j) for j in rng.choice(len(truth.gears), count, replace=False))
    falls = [log_uniform(rng, 0.01, 0.15) for _ in joints]
    pace = log_uniform(rng, 8, 60)

    def apply(plan: Blueprint, _q: np.ndarray, warmth: float) -> None:
        for j, fall in zip(joints, falls, strict=True):
            plan.gears[j] = plan.gears[j].times(1 - fall * warmth)

    values = {"joints": [j + 1 for j in joints], "fall": falls, "hits": pace}
    return Effect("drift", "campaign", values, apply, memory_per_hit=pace)
