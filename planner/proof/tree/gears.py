"""Concealed nonlinear gears: their law is sized after how far the gear moves in the hits."""

from typing import Any

import numpy as np

from planner.proof.tree import nonlinear as laws
from planner.proof.tree.effects import Effect, log_uniform
from planner.proof.tree.stating import Truth


class Sizing:
    """Draws a law once the angle (rad) and rate (rad/s) of a hit of middle level are known.

    `law(peak, rate, weights)` answers the law; weights: gravity's torque on it, hit by hit (N m).
    """

    def __init__(self, rng: np.random.Generator, kind: str, stiffness: float) -> None:
        self.kind, self.stiffness = kind, stiffness
        self.form = str(rng.choice(["softening", "hardening", "piecewise"]))
        low, high = {
            "nonlinear_stiffness": (0.3, 8), "friction": (0.01, 0.5), "backlash": (0.02, 0.6),
        }[kind]  # fmt: skip
        self.size = log_uniform(rng, low, high)
        self.slope = float(rng.choice([rng.uniform(0.4, 0.8), rng.uniform(1.3, 3)]))
        self.presliding = log_uniform(rng, 0.1, 1.0)
        self.coulomb = bool(rng.integers(2))
        self.borne = float(rng.uniform(0, 0.3) * (rng.random() < 0.5))
        self.told: dict[str, Any] = {}

    def law(self, peak: float, rate: float, weights: np.ndarray) -> Any:
        """The law; `told` is what the answer says of it."""
        k, size = self.stiffness, self.size
        if self.kind == "friction":
            limit = size * k * peak
            self.told = {"limit": limit, "law": "coulomb" if self.coulomb else "dahl"}
            if self.coulomb:
                return laws.Coulomb(limit, 0.1 * rate)
            return laws.Dahl(limit, self.presliding * k)
        width = size * peak
        if self.kind == "backlash":
            known = {w: laws.hanging_at(self.borne * w, k, width) for w in set(weights)}
            self.told = {"half_gap": width, "gravity_share": self.borne}
            rest = np.array([known[w] for w in weights])
            return laws.Backlash(k, width, rest)
        self.told = {"law": self.form, "width": width, "peak_angle": peak}
        if self.form == "softening":
            return laws.Softening(k, width)
        if self.form == "hardening":
            return laws.Hardening(k, width)
        self.told["slope"] = self.slope
        return laws.Piecewise(k, 0.7 * width, self.slope)


def _gear(kind: str):
    def draw(rng: np.random.Generator, truth: Truth, _poses) -> Effect:
        joint = int(rng.integers(min(4, len(truth.gears))))
        sizing = Sizing(rng, kind, truth.gears[joint].stiffness)
        return Effect(kind, f"joint_{joint + 1}", sizing.told, law=sizing, joint=joint)

    draw.__name__ = kind
    return draw


GEARS = tuple(_gear(kind) for kind in ("nonlinear_stiffness", "friction", "backlash"))
