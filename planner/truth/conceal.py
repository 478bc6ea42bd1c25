"""Which effects a case conceals: drawn once, or drawn until they show."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.proof.engine import NothingShowsError
from planner.truth.detect import clarity
from planner.truth.effects import LINEAR, NONLINEAR, OTHER
from planner.truth.everyday_effects import EVERYDAY_EFFECTS
from planner.truth.hits import Hammer
from planner.truth.load import load_truth
from planner.truth.mishaps import ARTEFACTS, OUTSIDERS
from planner.truth.outsiders import MORE_OUTSIDERS
from planner.truth.scene import Draw, Drawn, Scene, log_uniform
from planner.truth.secret import Secret
from planner.truth.world import World

EFFECTS: dict[str, Draw] = {**LINEAR, **NONLINEAR, **OTHER, **ARTEFACTS, **OUTSIDERS}
# In everyday cells damping is mixed anyway: a loss factor is nothing that was left out.
EVERYDAY: dict[str, Draw] = {**EFFECTS, **EVERYDAY_EFFECTS, **MORE_OUTSIDERS}
del EVERYDAY["structural_damping"]
DRIVES = 2, 4  # how many joints, at least and at most
ATTEMPTS = 40
SMALLER = 3.0  # at most: the first of several effects over any other; chosen


def kinds(world: World) -> tuple[str, ...]:
    """Of cases: "null", an effect's or outsider's name, a "pair", one law in several "drives"."""
    return ("null", *(EVERYDAY if world.imperfect else EFFECTS), "pair", "drives")


def concealed(
    kind: str,
    scene: Scene,
    secret: Secret,
    robot_toml: Path,
    hammer: Hammer,
    world: World,
    rng: np.random.Generator,
) -> list[Drawn]:
    """Effects added one after the other.

    Drawn again is what could not be (a robot that shakes by itself, a joint with two laws), and
    where the world says so, what does not show clearly in the FRFs.
    """
    found: list[Drawn] = []
    table = EVERYDAY if world.imperfect else EFFECTS
    largest = log_uniform(rng, *world.sizes) if world.sizes else 1.0
    for name in _names(kind, scene, rng):
        size = largest
        for _ in range(ATTEMPTS):
            if world.sizes and found:
                size = largest * log_uniform(rng, 1 / SMALLER, 1.0)
            drawn = table[name](replace(scene, size=size), secret, rng)
            if kind == "drives" and not _joins(drawn, found):
                continue
            with_it = load_truth(robot_toml, drawn.secret.deviation)
            if not all(np.all(with_it.poles(q)[0].real < 0) for q in scene.poses):
                continue  # a feedback loop that would shake by itself
            without = load_truth(robot_toml, secret.deviation)
            if not world.sizes:
                measure = clarity(without, secret, with_it, drawn.secret, scene, hammer)
                if not measure.shows(in_levels=name in NONLINEAR, in_time=name == "drift"):
                    continue
            found.append(replace(drawn, size=size))
            secret = drawn.secret
            break
        else:
            raise NothingShowsError(
                f"No {name} of this robot shows in the noise; take another seed."
            )
    return found


def _names(kind: str, scene: Scene, rng: np.random.Generator) -> list[str]:
    several = {"null": lambda *_: [], "pair": _pair, "drives": _drives}
    return several[kind](scene, rng) if kind in several else [kind]


def _pair(scene: Scene, rng: np.random.Generator) -> list[str]:
    """Two different effects of the robot's own physics, at most one of them nonlinear."""
    linear = [n for n in LINEAR if n != "transverse_compliance" or scene.per_joint == 1]
    first, second = (str(name) for name in rng.choice(linear, 2, replace=False))
    return [first, str(rng.choice(list(NONLINEAR)))] if rng.random() < 0.3 else [first, second]


def _drives(scene: Scene, rng: np.random.Generator) -> list[str]:
    """The same law several times."""
    return [str(rng.choice(list(NONLINEAR)))] * int(rng.integers(DRIVES[0], DRIVES[1] + 1))


def _joins(drawn: Drawn, concealed: list[Drawn]) -> bool:
    """Whether a law is at a joint of its own, and hardens or softens as the others do."""
    numbers = [next(iter(d.parameters.values())) for d in (drawn, *concealed)]
    signs = {v > 0 for v in numbers if isinstance(v, float)}
    return len(signs) == 1 and all(d.at != drawn.at for d in concealed)
