"""The table of all that can be concealed, and what is drawn from it for a case."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from planner.proof.deviation import Deviation
from planner.proof.effects import EFFECTS, LINEAR, NONLINEAR
from planner.proof.fault_injection import InjectedFaults
from planner.proof.model import Truth
from planner.proof.out_of_library import ARTEFACTS, OUT_OF_LIBRARY
from planner.proof.scene import Draw, Parameters, Scene, log_uniform

TABLE: dict[str, Draw] = {**EFFECTS, **ARTEFACTS, **OUT_OF_LIBRARY}
SINGLES, OUT_OF_LIBRARY_KINDS = (*EFFECTS, *ARTEFACTS), tuple(OUT_OF_LIBRARY)
KINDS = ("null", *TABLE, "pair", "drives")  # "drives": one law in several of them
DRIVES = 2, 4  # how many joints, at least and at most
SIZES = 0.03, 1.0  # of effects, log-uniform; 1 is a large one
SMALLER = 3.0  # at most: the first of several effects over any other; chosen
ATTEMPTS = 40

Load = Callable[[Deviation], Truth]


class NothingDetectableError(Exception):
    """A seed of which nothing comes; take another one."""


@dataclass(frozen=True)
class DrawnEffect:
    """An effect of a case: name and place as a diagnosis states them, true parameters in SI.

    `injected` holds it and all that was there before; `size` as in `Scene`.
    """

    effect: str
    at: str | None
    parameters: Parameters
    injected: InjectedFaults
    size: float


def drawn(name: str, scene: Scene) -> DrawnEffect:
    """One of TABLE, beside what is concealed in a scene already."""
    at, parameters, with_it = TABLE[name](scene)
    if name in OUT_OF_LIBRARY:
        name, parameters = "unknown", {"cause": name, **parameters}
    return DrawnEffect(name, at, parameters, with_it.injected, scene.size)


def concealed(kind: str, scene: Scene, load: Load) -> list[DrawnEffect]:
    """Effects of one of KINDS, added one after the other.

    Drawn again is what could not be: a robot that shakes by itself, a joint with two laws.
    """
    found: list[DrawnEffect] = []
    rng, largest = scene.rng, scene.log_uniform(*SIZES)
    for name in _names(kind, scene):
        size = largest
        for _ in range(ATTEMPTS):
            if found:
                size = largest * log_uniform(rng, 1 / SMALLER, 1.0)
            one = drawn(name, replace(scene, size=size))
            if kind == "drives" and not _joins(one, found):
                continue
            with_it = load(one.injected.deviation)
            if all(np.all(with_it.poles(q)[0].real < 0) for q in scene.poses):
                found.append(one)
                scene = replace(scene, injected=one.injected)
                break
        else:
            raise NothingDetectableError(f"No {name} of this robot can be; take another seed.")
    return found


def _names(kind: str, scene: Scene) -> list[str]:
    """Of the effects of a case; at most one of a pair is nonlinear."""
    rng = scene.rng
    if kind == "pair":
        linear = [n for n in LINEAR if n != "transverse_compliance" or scene.per_joint == 1]
        first, second = (str(name) for name in rng.choice(linear, 2, replace=False))
        return [first, str(rng.choice(list(NONLINEAR)))] if rng.random() < 0.3 else [first, second]
    if kind == "drives":
        return [str(rng.choice(list(NONLINEAR)))] * int(rng.integers(DRIVES[0], DRIVES[1] + 1))
    return [] if kind == "null" else [kind]


def _joins(one: DrawnEffect, before: list[DrawnEffect]) -> bool:
    """Whether a law is at a joint of its own, and hardens or softens as the others do."""
    numbers = [next(iter(d.parameters.values())) for d in (one, *before)]
    signs = {v > 0 for v in numbers if isinstance(v, float)}
    return len(signs) == 1 and all(d.at != one.at for d in before)
