"""Where the fits in time begin: laws fitted to equivalent stiffness against swing."""

from itertools import product

import numpy as np

from planner.diagnosis.laws.equivalent_stiffness import Equivalent, System
from planner.diagnosis.laws.law_at_joints import LawAtJoints
from planner.diagnosis.laws.torque_laws import LAWS, Law

DECAY = np.linspace(0.0, 1.5, 6)  # ln of how far the swing has faded while it still counts
EFFECTIVE = 0.7  # of the largest swing: not all modes peak at once
ROUGH = 0.05  # error of an equivalent stiffness, in shares of the joint's
MOST, MOST_LACKING = 5.0, 0.9  # of k, in shares of the joint's stiffness
ASIDE = (-4, 0, 4, 8)  # steps of the grid to the neighbours: fading hits look like smaller a
# Share of the weight that a gear bears. This and the next two: chosen, looking at two cases.
BORNE = (0.02, 0.06, 0.2, 0.6)
SLACK = (0.5, 0.98)  # of their stiffness, that they lack in the gap
# Of such joints, times the median swing at the highest level: a; and the sag of those that turn
# about an upright axis.
GAPS, WEIGHTLESS = (0.03, 0.15, 0.6), 1e-3
GRID = np.geomspace(0.01, 4.0, 28)  # a, times the median swing at the highest level


def faded(law: Law, swing: np.ndarray, a: float) -> np.ndarray:
    """Equivalent stiffness per unit of k of a hit that fades, by its energy."""
    weight = np.exp(-2 * DECAY)
    each = law.slow(EFFECTIVE * swing[..., None] * np.exp(-DECAY), a)
    return each @ (weight / weight.sum())


def starts(
    found: Equivalent, system: System, port: int, x: np.ndarray, own: int
) -> list[LawAtJoints]:
    """Every law (and sign of k): the best of a grid of a, and its neighbours."""
    scale = float(system.elasticity.stiffness[system.blocks[port]])
    middle = float(np.median(found.swing[:, 1, port]))
    out = []
    for law in LAWS:
        tried = [_at(found, law, port, scale, float(a)) for a in GRID * middle]
        for sign in (1, -1) if law.signed else (1,):
            fitting = [(left, i) for i, (left, k, _) in enumerate(tried) if sign * k > 0]
            if not fitting:
                continue
            best = min(fitting)[1]
            for i in sorted({int(np.clip(best + shift, 0, len(GRID) - 1)) for shift in ASIDE}):
                _, k, there = tried[i]
                if sign * k > 0:
                    moved = x.copy()
                    moved[own] += float(np.log(np.clip(1 - k * there / scale, 0.3, 3.0)))
                    share = k / scale if law.signed else np.log(k / scale)
                    nu = np.array([[share], [np.log(GRID[i])]])
                    out.append(
                        LawAtJoints(
                            law, 0 if law.signed else 1, np.array([port]), np.array([scale]),
                            np.log([middle]), moved, nu, system.slides[port : port + 1],
                        )
                    )  # fmt: skip
    return out


def held_starts(
    found: Equivalent, system: System, port: int, x: np.ndarray, sag: np.ndarray
) -> list[LawAtJoints]:
    """Backlash of a joint that its weight holds at one end of the gap.

    By `sag` (n,) in rad its spring gives at each visit under all of the weight, of which
    compensator and brake bear a part. Where it swings farther it leaves that end: it grows
    softer, then stiffer.
    """
    law = next(law for law in LAWS if law.effect == "backlash")
    scale = float(system.elasticity.stiffness[system.blocks[port]])
    middle = float(np.median(found.swing[:, 1, port]))
    if np.max(np.abs(sag)) <= WEIGHTLESS * middle:
        return []
    slides, ports = system.slides[port : port + 1], np.array([port])
    return [
        LawAtJoints(
            law, 1, ports, np.array([scale]), np.log([middle]), x.copy(),
            np.array([[np.log(slack)], [np.log(a)]]), slides, sag[:, None], borne,
        )
        for borne, slack, a in product(BORNE, SLACK, GAPS)
    ]  # fmt: skip


def _at(
    found: Equivalent, law: Law, port: int, scale: float, a: float
) -> tuple[float, float, float]:
    """What is left at a, the best k, and the equivalent stiffness per k of the strongest hits."""
    swing, delta = found.swing[:, :, port], found.delta[:, port]
    weight = 1 / (1 / np.maximum(found.precision[:, port], 1e-300) + (ROUGH * scale) ** 2)
    weak, strong = faded(law, swing[:, 0], a), faded(law, swing[:, 1], a)
    shape = weak - strong
    power = float(np.sum(weight * np.abs(shape) ** 2))
    k = float(np.sum(weight * (shape.conj() * delta).real)) / max(power, 1e-300)
    high = MOST_LACKING if law.effect == "backlash" else MOST
    k = float(np.clip(k, max(law.least_share, -0.9) * scale, high * scale))
    left = float(np.sum(weight * np.abs(delta - k * shape) ** 2))
    return left, k, float(np.median(strong.real))
