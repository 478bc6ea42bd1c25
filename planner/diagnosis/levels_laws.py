"""How laws of joints that are not linear change what hits of a fitted robot answer.

What a law has on average over all hits the linear fit has already, as a spring and a damper; only
what goes beyond that changes FRFs.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.signal import hilbert

from planner.diagnosis.levels_hits import HitGroup
from planner.robot.joint_laws import Step

FARTHEST = 5.0  # of the linear swing: a joint that goes farther is no robot's


@dataclass(frozen=True, eq=False)
class JointMotions:
    """Of all H hits at one joint: how it swings in the linear fit, and how that answers a torque.

    `swing` (H, T) are angles in rad in the course of time, `kernel` (H, T) what a torque does
    later, under the records' window. `shown` (H, 3, L) are accelerances by spectra of torques,
    `stiffness` the joint's own in N·m/rad.
    """

    groups: Sequence[HitGroup]
    stiffness: float
    swing: np.ndarray
    kernel: np.ndarray
    shown: np.ndarray

    @classmethod
    def of(cls, groups: Sequence[HitGroup], port: int, stiffness: float) -> "JointMotions":
        """Of the joint of a number."""
        clock = groups[0].clock
        swing = clock.instants(np.concatenate([g.swing[:, port] for g in groups]))
        kernels = [clock.windowed(g.own[port])[None].repeat(len(g.swing), 0) for g in groups]
        shown = [-g.shown[port][:, g.lines] / g.force[:, None, g.lines] for g in groups]
        return cls(groups, stiffness, swing, np.concatenate(kernels), np.concatenate(shown))

    @cached_property
    def size(self) -> float:
        """Root mean square of the largest swings, in rad."""
        return float(np.sqrt(np.mean(np.max(np.abs(self.swing), axis=1) ** 2)))

    @property
    def window(self) -> np.ndarray:
        """(T,): what the records' window makes of instants."""
        return self.groups[0].clock.window

    def first_order(self, step: Step, a: np.ndarray) -> list[np.ndarray]:
        """Changes (C, n, 3, L) of each group by k = 1, bent at each of a (C,)."""
        return self._answers(self._beyond(self._along(step, a)))

    def free(self, nodes: np.ndarray) -> list[np.ndarray]:
        """By stiffnesses, then losses, that are hat functions of ln swing with `nodes` (B,)."""
        whole = np.asarray(hilbert(self.swing, axis=1))
        at = np.clip(np.log(np.abs(whole) + 1e-300), nodes[0], nodes[-1])
        hats = np.maximum(0.0, 1 - np.abs(at[:, None] - nodes[:, None]) / (nodes[1] - nodes[0]))
        both = [hats * whole.real[:, None], -hats * whole.imag[:, None]]
        return self._answers(self._beyond(np.concatenate(both, axis=1)))

    def bent(
        self, step: Step, k: np.ndarray, a: np.ndarray, off: np.ndarray
    ) -> list[list[np.ndarray]]:
        """Changes (3, n, 3, L) of each group by V variants of a law, and by 1 of `off` each.

        All hits are marched through time together: a joint does what it would do were it linear,
        less its own answer to the torque beyond what is common. That is a convolution, for which
        nothing else need be known of the robot. `off` (V, 2) is by how much what the linear fit has
        of stiffness and damping is not what is common, in N·m/rad.
        """
        window, end = self.window, self.swing.shape[1]
        linear, kernel = self.swing * window, self.kernel[:, ::-1].copy()
        common = self.linear(step, k, a, off)
        shown, swing = np.zeros((2, len(k), *self.swing.shape))
        state = before = np.zeros(swing.shape[:2])
        most = FARTHEST * np.max(np.abs(self.swing), axis=1)
        spring, damper, k, a = common[:, :1], common[:, 1:], k[:, None], a[:, None]
        for i in range(1, end):
            own = np.einsum("vht,ht->vh", shown[..., :i], kernel[:, end - 1 - i : end - 1])
            now = np.clip((linear[:, i] - own) / window[i], -most, most)
            state = step(state, before, now, a)
            torque = k * state - spring * now - damper * (now - before)
            shown[..., i], swing[..., i], before = torque * window[i], now, now
        both = np.stack([swing, self._steps * np.diff(swing, axis=-1, prepend=0.0)], axis=2)
        torques = np.concatenate([(shown / window)[:, :, None], -both], axis=2)
        return [self._answers(one) for one in torques]

    def linear(self, step: Step, k: np.ndarray, a: np.ndarray, off: np.ndarray) -> np.ndarray:
        """(V, 2): what the linear fit has of V laws, in N·m/rad, and the same per instant."""
        return self._common(self._along(step, a) * k[:, None]).T + off * (1.0, self._steps)

    @cached_property
    def _steps(self) -> float:
        """Swing over its change from one instant to the next."""
        return float(np.linalg.norm(self.swing) / np.linalg.norm(np.diff(self.swing, axis=1)))

    def _answers(self, torques: np.ndarray) -> list[np.ndarray]:
        """Changes (C, n, 3, L) of FRFs of each group by torques (H, C, T) in N·m."""
        g = self.groups[0]
        spectra = g.clock.spectrum(torques)[..., g.lines]
        changes = np.moveaxis(self.shown[:, None] * spectra[:, :, None], 1, 0)
        ends = np.cumsum([len(g.swing) for g in self.groups])[:-1]
        return np.split(changes, ends, axis=1)

    def _along(self, step: Step, a: np.ndarray) -> np.ndarray:
        """Torques (H, C, T) of k = 1 along the linear swing, bent at each of a (C,)."""
        swing = self.swing
        out = np.zeros((len(swing), len(a), swing.shape[1]))
        for i in range(1, swing.shape[1]):
            out[..., i] = step(out[..., i - 1], swing[:, i - 1, None], swing[:, i, None], a)
        return out

    @property
    def _linear(self) -> np.ndarray:
        """(2, H, T): the linear swing, and its change from one instant to the next."""
        return np.stack([self.swing, np.diff(self.swing, axis=1, prepend=0.0)])

    def _common(self, torques: np.ndarray) -> np.ndarray:
        """(2, C): stiffness, and damping per instant, of torques (H, C, T) along the swing."""
        shown = (self._linear * self.window).reshape(2, -1)
        seen = np.moveaxis(torques * self.window, 1, 0).reshape(torques.shape[1], -1)
        return np.linalg.solve(shown @ shown.T, shown @ seen.T)

    def _beyond(self, torques: np.ndarray) -> np.ndarray:
        """Torques (H, C, T) without what all hits have in common."""
        return torques - np.einsum("kc,kht->hct", self._common(torques), self._linear)
