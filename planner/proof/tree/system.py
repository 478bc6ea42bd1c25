"""The linear system of one pose: dynamic stiffness, FRFs, modes.

    Z(s) = s2 M + s G + Kg + sum over ties of l d(s) r',   H(s) = s2 C Z(s)^-1 B

B: wrench at the tcp in tcp axes (N, N m); C: acceleration and angular acceleration (m/s2, rad/s2)
of the sensor frame in its own axes. So H is (6, 6) at every s.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import eigh

HIGHEST_HZ = 1500.0  # modes above are left out of the truth, everywhere alike
CHUNK = 2048  # lines at once


@dataclass(frozen=True)
class Tie:
    """Load -left d(s) (right' x): a spring where left and right are the same (n)."""

    name: str
    left: np.ndarray
    right: np.ndarray
    law: Any

    @property
    def mutual(self) -> bool:
        """Whether left is right: a spring or damper, not a controller."""
        return self.left is self.right


@dataclass(frozen=True)
class System:
    """See the module; `parts` maps a link to the (6, n) jacobian of its frame, in its axes."""

    mass: np.ndarray
    gravity: np.ndarray
    spin: np.ndarray
    ties: tuple[Tie, ...]
    load: np.ndarray  # B (n, 6)
    sense: np.ndarray  # C (6, n)
    ground: np.ndarray  # (n, 3) load per floor acceleration
    carried: np.ndarray  # (3, 3) floor acceleration in the sensor's axes
    parts: dict[str, np.ndarray]
    weight: dict[str, float]  # of gravity, per coordinate at rest (N m or N)

    def stiffness_at_rest(self) -> np.ndarray:
        """Gravity's stiffness and every mutual tie's (n, n)."""
        total = self.gravity.copy()
        for tie in self.ties:
            if tie.mutual:
                total += tie.law.stiffness * np.outer(tie.left, tie.right)
        return total

    def modes(self) -> tuple[np.ndarray, np.ndarray]:
        """Undamped eigenfrequencies (Hz) and mass-normalised shapes (columns)."""
        values, shapes = eigh(self.stiffness_at_rest(), self.mass)
        return np.sqrt(np.abs(values)) * np.sign(values) / (2 * np.pi), shapes

    def reduced(self, highest_hz: float = HIGHEST_HZ) -> "System":
        """The same in its modes up to `highest_hz`."""
        frequencies, shapes = self.modes()
        basis = shapes[:, frequencies < highest_hz]
        ties = []
        for tie in self.ties:
            left = basis.T @ tie.left
            right = left if tie.mutual else basis.T @ tie.right
            ties.append(Tie(tie.name, left, right, tie.law))
        return replace(
            self,
            mass=basis.T @ self.mass @ basis,
            gravity=basis.T @ self.gravity @ basis,
            spin=basis.T @ self.spin @ basis,
            ties=tuple(ties),
            load=basis.T @ self.load,
            sense=self.sense @ basis,
            ground=basis.T @ self.ground,
            parts={name: part @ basis for name, part in self.parts.items()},
        )

    def dynamic_stiffness(self, s: np.ndarray) -> np.ndarray:
        """Z (lines, n, n)."""
        size = len(self.mass)
        laws = np.array([tie.law(s) for tie in self.ties]).T
        dyads = np.array([np.outer(tie.left, tie.right).ravel() for tie in self.ties])
        z = (laws @ dyads).reshape(len(s), size, size)
        return z + s[:, None, None] ** 2 * self.mass + s[:, None, None] * self.spin + self.gravity

    def frf(self, s: np.ndarray, ground: bool = False) -> np.ndarray:
        """(lines, 6, 6) accelerance at `s`; with `ground` (lines, 3, 3) per floor acceleration."""
        load = self.ground if ground else self.load
        parts = []
        for start in range(0, len(s), CHUNK):
            some = s[start : start + CHUNK]
            answer = np.linalg.solve(self.dynamic_stiffness(some), load[None].astype(complex))
            parts.append(some[:, None, None] ** 2 * (self.sense @ answer))
        total = np.concatenate(parts)
        return total[:, :3] + self.carried if ground else total
