"""The contact between two parts of a tool, or between tool and holder: springs and dampers."""

from dataclasses import dataclass, replace

import numpy as np

# Places of the motions that a contact lets slip: across the axis, and turning about that.
ACROSS, TURNING = (0, 1), (3, 4)
NUMBERS = ("stiffness_n_m", "stiffness_nm_rad", "damping_ns_m", "damping_nms_rad")


@dataclass(frozen=True)
class ToolContact:
    """Complex stiffness k + iωc across the axis and in bending; along and about it, it holds.

    Stiffness in N/m and N·m/rad, damping in N·s/m and N·m·s/rad; `sd_percent` says how well each
    of the four numbers is known.
    """

    stiffness_n_m: float
    stiffness_nm_rad: float
    damping_ns_m: float = 0.0
    damping_nms_rad: float = 0.0
    sd_percent: float = 0.0

    def flexibility(self, omega: np.ndarray) -> np.ndarray:
        """(F, 6): how far its sides move apart, for each unit of force or moment."""
        out = np.zeros((len(omega), 6), complex)
        out[:, ACROSS] = 1 / (self.stiffness_n_m + 1j * omega * self.damping_ns_m)[:, None]
        out[:, TURNING] = 1 / (self.stiffness_nm_rad + 1j * omega * self.damping_nms_rad)[:, None]
        return out

    def transfer(self, omega: np.ndarray) -> np.ndarray:
        """(F, 12, 12) of the state from the tip's side to the holder's; omega (F,) in rad/s."""
        out = np.zeros((len(omega), 12, 12), complex)
        out[:, range(12), range(12)] = 1
        out[:, range(6), range(6, 12)] = -self.flexibility(omega)
        return out

    def scaled(self, name: str, factor: float) -> "ToolContact":
        """The same with one of its four numbers multiplied."""
        return replace(self, **{name: factor * getattr(self, name)})
