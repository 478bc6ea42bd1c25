"""Milling step by step in time: a check of the lobes that shares nothing with them but the modes.

What is stepped is the deviation from the forced vibration, which every tooth repeats and which
so leaves the chip as it is. Each tooth cuts down to where it is; it cuts nothing where it is above
the surface that the teeth before it left, and the static force is then missing (loss of contact).
"""

from dataclasses import dataclass

import numpy as np

from planner.milling.cut import Cut
from planner.milling.cutter_modes import CutterModes

STEPS_PER_RADIAN = 12.0  # of the fastest mode
LEAST_STEPS = 90  # of a tooth's period
DISTURBED = 1e-4  # of the feed per tooth: the deviation that is begun with
LOST = 0.3  # of the feed per tooth: a deviation that has grown so far is chatter
ROUNDING = 1e-10  # of the feed: a deviation below this has died out
JUDGED = 0.5  # share of the teeth that pass, at the end, over which growth is judged


@dataclass(frozen=True, eq=False)
class Simulated:
    """Largest deviation (teeth, points) while each tooth passes, in feeds per tooth."""

    peak: np.ndarray

    @property
    def stable(self) -> np.ndarray:
        """(points,) bool: whether the deviation dies out."""
        with np.errstate(all="ignore"):
            size = np.log(np.maximum(self.peak, 1e-280))
        last = size[-int(JUDGED * len(size)) :]
        middle = len(last) // 2
        falls = last[middle:].max(axis=0) < last[:middle].max(axis=0)
        gone = self.peak[-1] < ROUNDING
        return (falls | gone) & (np.max(self.peak, axis=0) < LOST)


def simulate(
    modes: CutterModes, cut: Cut, rpm: np.ndarray, depth_m: np.ndarray, teeth: int, seed: int = 0
) -> Simulated:
    """At points (p,) of speed and depth, while so many teeth pass.

    Modes in the plane of the cut; teeth at equal angles, without helix.
    """
    count = _steps(modes, cut, float(np.min(rpm)))
    step = 60 / (np.asarray(rpm) * cut.teeth * count)  # (p,) s
    whole, half = (_transition(modes, step * share) for share in (1.0, 0.5))
    pitch = 2 * np.pi / cut.teeth
    phi = np.mod(pitch * np.arange(cut.teeth)[:, None] + pitch * (np.arange(count) + 0.5) / count,
                 2 * np.pi)  # fmt: skip
    start, end = cut.immersion_rad
    inside = (phi >= start) & (phi <= end)
    normal = np.stack([np.sin(phi), np.cos(phi)], axis=-1)  # (teeth, count, 2)
    kt, kr = cut.kt_n_m2, cut.kr_n_m2
    push = np.stack([-kt * np.cos(phi) - kr * np.sin(phi), kt * np.sin(phi) - kr * np.cos(phi)], -1)
    random = np.random.default_rng(seed)
    shown = modes.shapes * modes.weight[:, None]  # (k, 2)
    z = np.repeat(random.standard_normal((1, len(modes.poles), 2)) @ [1, 1j], len(step), axis=0)
    z *= DISTURBED / np.abs(shown).max(axis=1)
    surface = np.zeros((cut.teeth, count, len(step)))
    surface -= np.sin(phi)[..., None]  # one feed before the first pass
    peak = np.zeros((teeth, len(step)))
    force = np.zeros((len(step), 2))
    depth = np.asarray(depth_m)
    with np.errstate(all="ignore"):
        for passed in range(teeth):
            for i in range(count):
                ahead = z * half[0] + (force @ modes.drives.T) * half[1]
                u = (ahead @ shown).real
                force = np.zeros_like(force)
                for j in np.flatnonzero(inside[:, i]):
                    at = np.sin(phi[j, i]) * passed + u @ normal[j, i]
                    chip = np.maximum(at - surface[j, i], 0.0)
                    surface[j, i] = np.maximum(surface[j, i], at)
                    change = depth * (chip - np.sin(phi[j, i]))
                    force += change[:, None] * push[j, i]
                z = z * whole[0] + (force @ modes.drives.T) * whole[1]
                size = np.abs(u).max(axis=1)
                peak[passed] = np.maximum(peak[passed], size)
    return Simulated(np.where(np.isfinite(peak), peak, np.inf))


def _steps(modes: CutterModes, cut: Cut, slowest_rpm: float) -> int:
    angle = float(np.max(np.abs(modes.poles))) * 60 / (slowest_rpm * cut.teeth)
    return int(max(LEAST_STEPS, np.ceil(STEPS_PER_RADIAN * angle)))


def _transition(modes: CutterModes, step_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(p, k) each: what is left of a state after a step, and what a force of 1 adds meanwhile."""
    left = np.exp(modes.poles * step_s[:, None])
    return left, (left - 1) / modes.poles
