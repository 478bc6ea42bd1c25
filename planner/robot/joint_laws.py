"""Laws of joints that are not linear: their shapes, their numbers, their entries in robot.toml.

A law's torque is k times a shape bent at the angle a, beside the linear spring's: rad (m),
N·m/rad (N/m).
"""

from collections.abc import Callable
from typing import Annotated, Literal

import msgspec
import numpy as np

from planner.toml_file import limited

UNKNOWN = "unknown"
NEARLY = 1 - 1e-12
Kind = Literal["hardening", "softening", "friction", "backlash"]
Step = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]
# A spring's stiffness, in whichever unit: up to 10⁷ times a heavy robot's.
LargeNumber = Annotated[float, limited(gt=0, le=1e14)]
Share = Annotated[float, limited(gt=-10, lt=10)]


def stiffening(state: np.ndarray, before: np.ndarray, now: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Secant stiffness 0 at small angles, 1 at large ones, half of it at a."""
    return now**3 / (now**2 + a**2)


def dead_zone(state: np.ndarray, before: np.ndarray, now: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Within ± a the spring lacks 1."""
    return -np.clip(now, -a, a)


def dahl(state: np.ndarray, before: np.ndarray, now: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Dahl 1968: dz/dθ = 1 − sgn(dθ) z / a, exact along a motion one way."""
    way = now - before
    end = np.sign(way) * a
    return end + (state - end) * np.exp(-np.abs(way) / a)


def bouc_wen(state: np.ndarray, before: np.ndarray, now: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Bouc and Wen, dz/dθ = 1 − z²/a² while it loads, 1 while it unloads: exact one way."""
    way = now - before
    loaded = np.sign(way) * state
    straight = np.minimum(np.abs(way), np.maximum(-loaded, 0.0))
    begun = np.clip((loaded + straight) / a, -NEARLY, NEARLY)
    return np.sign(way) * a * np.tanh(np.arctanh(begun) + (np.abs(way) - straight) / a)


def fluid(state: np.ndarray, before: np.ndarray, now: np.ndarray, a: np.ndarray) -> np.ndarray:
    """With the square of the speed, as oil has it: no effect that is named, but what else it is."""
    return (now - before) * np.abs(now - before) / a


# An effect's torque for k = 1 after a motion from one angle to another, and its two numbers: k, and
# a or k a; named for joints that turn and that slide.
SHAPES: tuple[tuple[str, Step], ...] = (
    ("nonlinear_stiffness", stiffening),
    ("friction", dahl),
    ("friction", bouc_wen),
    ("backlash", dead_zone),
    (UNKNOWN, fluid),
)
NUMBERS = {
    "nonlinear_stiffness": ("stiffness_change", ("angle", "shift"), False),
    "friction": ("presliding_stiffness", ("coulomb_torque", "coulomb_force"), True),
    "backlash": ("lost_stiffness", ("half_gap", "half_gap"), False),
    UNKNOWN: ("damping", ("angle", "shift"), False),
}
UNITS = {False: ("N·m/rad", "rad", "N·m"), True: ("N/m", "m", "N")}
# Relative sd of both: what a linear fit that a law has bent leaves wrong. Of 20 concealed joints.
INEXACT = 0.05
NUMBER_ENTRIES = (  # of [[law]]; which two go with a kind says `LawTable.entries`
    "stiffness_n_m_rad", "angle_rad", "coulomb_torque_n_m",
    "stiffness_n_m", "shift_m", "coulomb_force_n",
)  # fmt: skip
HYSTERESES = {"dahl": dahl, "bouc_wen": bouc_wen}


def numbers_of(
    effect: str, slides: bool, sign: float, log_k_a: np.ndarray, covariance: np.ndarray
) -> dict[str, tuple[float, float, str]]:
    """A law's numbers by name: value, sd, unit; of logarithms of |k| and a (2,)."""
    stiffness, ways, product = NUMBERS[effect]
    both = np.array([[1.0, 0.0], [1.0 if product else 0.0, 1.0]])
    values = np.exp(both @ log_k_a)
    sds = values * np.hypot(np.sqrt(np.diag(both @ covariance @ both.T)), INEXACT)
    first, way, force = UNITS[slides]
    return {
        stiffness: (float(sign * values[0]), float(sds[0]), first),
        ways[slides]: (float(values[1]), float(sds[1]), force if product else way),
    }


class LawTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """How a joint's own spring is not linear: a torque beside that of its [[compliance]].

    "hardening" adds `stiffness_n_m_rad` where the joint swings far ("softening" takes it away),
    half of it at `angle_rad`. "friction" holds with that stiffness until it slides at
    `coulomb_torque_n_m`, by the `hysteresis` of Dahl or of Bouc and Wen. "backlash" takes it away
    within ± `angle_rad`. Of a joint that slides they are `stiffness_n_m`, `shift_m`,
    `coulomb_force_n`.

    What [[compliance]] has of the law already, as where it was identified from hits, is told in
    shares of that stiffness: `in_spring`, and `in_damper_s` in s (both 0: its spring and damper are
    those beside the law). So the law counts where a force is stated (`peak_force_n` of
    predict.csv), and springs are as stated elsewhere.

    A campaign takes out of each hit what the law does at its force, and identifies the robot from
    what is left: hits may be of several levels. Where no force is stated it predicts what hits as
    those of its first pose show on average.
    """

    joint: str
    kind: Kind
    stiffness_n_m_rad: LargeNumber | None = None
    angle_rad: LargeNumber | None = None
    coulomb_torque_n_m: LargeNumber | None = None
    stiffness_n_m: LargeNumber | None = None
    shift_m: LargeNumber | None = None
    coulomb_force_n: LargeNumber | None = None
    hysteresis: Literal["dahl", "bouc_wen"] = "dahl"
    in_spring: Share = 0.0
    in_damper_s: Share = 0.0

    @classmethod
    def of(
        cls, joint: str, slides: bool, step: Step, k: float, a: float, linear: tuple[float, float]
    ) -> "LawTable":
        """With k and a in the units of a joint that slides or turns; what is `linear` of k = 1."""
        kinds: dict[Step, Kind] = {dead_zone: "backlash", dahl: "friction", bouc_wen: "friction"}
        kind = kinds.get(step) or ("hardening" if k > 0 else "softening")
        hysteresis = "bouc_wen" if step is bouc_wen else "dahl"
        stiffness, bend = cls.entries(kind, slides)
        size = abs(k) * a if kind == "friction" else a
        numbers = {stiffness: abs(k), bend: size, "in_spring": linear[0], "in_damper_s": linear[1]}
        rounded = {name: float(f"{value:.6g}") for name, value in numbers.items()}
        return cls(joint, kind, hysteresis=hysteresis, **rounded)

    @staticmethod
    def entries(kind: str, slides: bool) -> tuple[str, str]:
        """The names of its two numbers."""
        bend = ("coulomb_torque_n_m", "coulomb_force_n") if kind == "friction" else (
            "angle_rad", "shift_m")  # fmt: skip
        return ("stiffness_n_m_rad", "stiffness_n_m")[slides], bend[slides]

    @property
    def k(self) -> float:
        """By which the shape is multiplied, in N·m/rad (N/m)."""
        size = self.stiffness_n_m_rad or self.stiffness_n_m or 0.0
        return -size if self.kind == "softening" else size

    @property
    def a(self) -> float:
        """At which it is bent, in rad (m)."""
        force = self.coulomb_torque_n_m or self.coulomb_force_n
        return force / self.k if force else self.angle_rad or self.shift_m or 0.0

    @property
    def step(self) -> Step:
        """Its shape."""
        if self.kind == "friction":
            return HYSTERESES[self.hysteresis]
        return dead_zone if self.kind == "backlash" else stiffening

    @property
    def weakest(self) -> float:
        """The least secant stiffness of the law in N·m/rad (N/m), beside that in the spring."""
        least = {"softening": 1.0, "backlash": -1.0}.get(self.kind, 0.0)
        return self.k * (least - self.in_spring)
