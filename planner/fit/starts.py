"""Where fits with one more effect begin, and which of many effects are tried."""

from collections.abc import Iterable, Sequence

import numpy as np

from planner.effects.effect import Operator, Start
from planner.fit.fitted import StructureFit
from planner.fit.structure import RobotStructure

KEPT = 6  # operators by first order beside the best of each kind
PULLED = 1.5  # prior sds, from which another prior may pay
STRAYED = 1.5  # prior sds softer than stated
SOFTER = 1.2  # prior sds by which springs may be softer than expected


def in_place_of(base: StructureFit, structure: RobotStructure) -> list[np.ndarray]:
    """Where a fit with one effect more may begin: in place of what is stated and strayed.

    Springs that are far softer may stand in for the effect's: back to what is stated, the new ones
    as soft as they were. A body may stand in for a mass that it carries.
    """
    x, known = structure.carried(base.structure, base.at.x), set(base.structure.names)
    stiffnesses = range(structure.stiffnesses)
    new = [i for i in stiffnesses if structure.names[i] not in known]
    away = (x - structure.mean) / structure.sd
    far = [i for i in stiffnesses if structure.parameters[i].stated and away[i] < -STRAYED]
    if not (new and far):
        return _carried_by(structure, x)
    softest = x[far].min()
    x[far] = structure.mean[far]
    low, high = structure.mean[new] - 3 * structure.sd[new], structure.mean[new]
    x[new] = np.clip(softest, low, high)
    return [x]


def _carried_by(structure: RobotStructure, x: np.ndarray) -> list[np.ndarray]:
    """x with what the last effect's body has beside what is stated in that effect, as far as such a
    mass can be: FRFs are the same, where what is left of it is as likely as what is stated."""
    effect, own, bodies = structure.effects[-1], structure.own[-1], structure.bodies
    carried = effect.inertia(x[own])
    if carried is None:
        return []
    body, out = bodies.bodies.index(carried[0]), x.copy()
    strayed = bodies.difference(x[structure.inertial])[body]
    psi = effect.of_matter(strayed)
    there = None if psi is None else effect.inertia(psi)
    if psi is None or there is None:
        return []
    out[own], mine, left = psi, bodies.mine[body], strayed - there[1]
    numbers = np.linalg.lstsq(bodies.change[body, mine].T, left)[0]
    out[structure.inertial][mine] = np.clip(numbers, -1, 1)
    return [out]


def from_stated(structure: RobotStructure, start: Start) -> Iterable[np.ndarray]:
    """Where a fit from afar begins: as stated, new springs as expected and softer."""
    effect, x = structure.effects[-1], structure.mean.copy()
    if not effect.springs:
        begun = []
        for psi in (start.psi, *effect.beside(start.psi)):
            begun.append(x.copy())
            begun[-1][structure.own[-1]] = psi
        return begun
    new = [i for i in range(structure.stiffnesses) if not structure.parameters[i].stated]
    mine = [i for i in new if set(structure.parameters[i].blocks) & set(effect.springs)]
    softer = x.copy()
    softer[mine] -= SOFTER * structure.sd[mine]
    return x, softer


def anywhere(best: StructureFit, number: int) -> list[np.ndarray]:
    """As stated, but for the numbers of effects that are there; one of them, by its `number`, and
    its springs from all places where they may begin."""
    s, effect, kept = best.structure, best.structure.effects[number], best.structure.own
    springs = enumerate(s.parameters[: s.stiffnesses])
    mine = [i for i, p in springs if set(p.blocks) & set(effect.springs)]
    found = []
    for psi in (effect.mean, *effect.beside(effect.mean)):
        for softer in (0.0, SOFTER):
            x = s.mean.copy()
            x[kept[0].start : s.chain.start] = best.at.x[kept[0].start : s.chain.start]
            x[kept[number]] = psi
            x[mine] -= softer * s.sd[mine]
            found.append(x)
    return found


def pulled(base: StructureFit, effect: Operator) -> bool:
    """Whether anything is gained where springs that are there need not be as they are expected."""
    s, known = base.structure, effect.spring_priors
    there = [i for i in range(s.stiffnesses) if known.keys() & set(s.parameters[i].blocks)]
    away = np.abs((base.at.x - s.mean) / s.sd)[there]
    return not there or bool(np.any(away > PULLED))


def leaders(starts: Sequence[Start], least: float = 0.0) -> list[Start]:
    """Springs, which the first order says little of, the first operators, the best of each kind.

    Operators gain more than `least` nats.
    """
    kept: list[Start] = []
    kinds: set[str] = set()
    operators = 0
    for start in sorted(starts, key=lambda s: -s.gain_nats):
        effect: Operator = start.effect
        new = effect.kind not in kinds
        told = np.isinf(start.gain_nats) or effect.artefact
        if told or (start.gain_nats > least and (operators < KEPT or new)):
            kept.append(start)
            kinds.add(effect.kind)
            operators += not np.isinf(start.gain_nats)
    return kept
