"""Where the fits in time begin: laws fitted to equivalent stiffness against swing."""

import numpy as np

from planner.diagnose.equivalent import Equivalent, System
from planner.diagnose.laws import LAWS, Law
from planner.diagnose.nonlinear import Candidate

DECAY = np.linspace(0.0, 1.5, 6)  # ln of how far the swing has faded while it still counts
EFFECTIVE = 0.7  # of the largest swing: not all modes peak at once
ROUGH = 0.05  # error of an equivalent stiffness, in shares of the joint's
GRID = np.geomspace(0.01, 4.0, 28)  # a, times the median swing at the highest level


def faded(law: Law, swing: np.ndarray, a: float) -> np.ndarray:
    """Equivalent stiffness per unit of k of a hit that fades, by its energy."""
    weight = np.exp(-2 * DECAY)
    each = law.slow(EFFECTIVE * swing[..., None] * np.exp(-DECAY), a)
    return each @ (weight / weight.sum())


def starts(found: Equivalent, system: System, port: int, x: np.ndarray, own: int) -> list[Candidate]:
    """One candidate a law (and sign of k), at the best of a grid of a."""
    scale = float(system.elasticity.stiffness[system.blocks[port]])
    swing, delta = found.swing[:, :, port], found.delta[:, port]
    weight = 1 / (1 / np.maximum(found.precision[:, port], 1e-300) + (ROUGH * scale) ** 2)
    middle = float(np.median(swing[:, 1]))
    out = []
    for law in LAWS:
        best: dict[int, tuple[float, float, float, float]] = {}
        for a in GRID * middle:
            weak, strong = faded(law, swing[:, 0], a), faded(law, swing[:, 1], a)
            shape = weak - strong
            power = float(np.sum(weight * np.abs(shape) ** 2))
            k = float(np.sum(weight * (shape.conj() * delta).real)) / max(power, 1e-300)
            sign = 1 if k > 0 else -1
            if not law.signed and sign < 0:
                continue
            low, high = law.least_share * scale, 5 * scale
            k = float(np.clip(k, low if law.signed else 0.02 * scale, high))
            left = float(np.sum(weight * np.abs(delta - k * shape) ** 2))
            there = float(np.median(strong.real))
            if sign not in best or left < best[sign][0]:
                best[sign] = left, k, float(a), there
        if not best:
            best[1] = 0.0, 0.3 * scale, 0.3 * middle, 0.0
        left, k, a, there = min(best.values())
        moved = x.copy()
        total = np.clip(1 - k * there / scale, 0.3, 3.0)
        moved[own] += float(np.log(total))
        share = k / scale
        nu = np.array([share if law.signed else np.log(share), np.log(a)])
        out.append(Candidate(law, port, scale, float(np.log(middle)), moved, nu))
    return out
