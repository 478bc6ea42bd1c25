"""The effects that a case of a kind conceals."""

from typing import Any

import numpy as np

from planner.proof.tree import effects as physical
from planner.proof.tree.chain import ARTEFACTS
from planner.proof.tree.effects import Effect
from planner.proof.tree.gears import GEARS
from planner.proof.tree.outsiders import OUTSIDERS
from planner.proof.tree.stating import Truth

LINEAR = (
    physical.base_compliance, physical.transverse_compliance, physical.joint_stiffness,
    physical.angle_dependent_stiffness, physical.link_flexibility, physical.added_mass,
    physical.local_resonator,
)  # fmt: skip
SINGLE = {f.__name__: f for f in (*LINEAR, *GEARS, physical.drift, *ARTEFACTS)}
OUTSIDE = {f.__name__: f for f in OUTSIDERS}
KINDS = ("none", "pair", *SINGLE, *OUTSIDE)


def draw_effects(
    rng: np.random.Generator, kind: str, truth: Truth, poses: np.ndarray
) -> list[Effect]:
    """What is concealed in a case of a kind; poses (n, joints) in rad."""
    if kind == "none":
        return []
    if kind != "pair":
        return [{**SINGLE, **OUTSIDE}[kind](rng, truth, poses)]
    first, second = rng.choice(len(LINEAR), 2, replace=False)
    makers: list[Any] = [LINEAR[first], LINEAR[second]]
    if rng.random() < 0.3:
        makers[1] = GEARS[rng.integers(len(GEARS))]
    drawn: list[Effect] = []
    for _ in range(50):
        drawn = [maker(rng, truth, poses) for maker in makers]
        if len({e.at for e in drawn}) == 2 or drawn[1].law is None:
            return drawn
    return drawn
