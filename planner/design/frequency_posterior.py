"""The natural frequencies' posterior as acquisitions see it, with fantasies of poses to come.

ln f_k(q) = GP_k(q) + trust_k · S_k(q)·(θ − θ̂): what the measurements leave open of the
discrepancy, and what they leave open of the simulation's parameters, linearised. The two are
independent given what was measured.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.inference.covariance import eigen
from planner.inference.per_pose import PerPose
from planner.surrogate.gp import Posterior
from planner.surrogate.modal_surrogate import Surrogate

MEASUREMENT_SD = 1e-3  # relative sd that EMA gives a frequency, from hits along all axes
AXES = 3  # of the hit: x, y, z of the tcp
ALL_AXES = (0, 1, 2)


@dataclass(frozen=True, eq=False)
class Poses(PerPose):
    """n poses: model coordinates x (n, d) and centred low fidelity (n, k).

    `slope` (n, k, p) is ∂ ln f by the simulation's parameters, `information` (n, 3, p, p) the
    Fisher information that a hit along each axis gives about them; p = 0: nothing is identified.
    """

    x: np.ndarray
    low: np.ndarray
    slope: np.ndarray
    information: np.ndarray

    @classmethod
    def plain(cls, x: np.ndarray, low: np.ndarray) -> "Poses":
        """Poses of a model whose simulation has no open parameters."""
        n, k = low.shape
        return cls(x, low, np.zeros((n, k, 0)), np.zeros((n, AXES, 0, 0)))

    def __len__(self) -> int:
        return len(self.x)

    @property
    def uninformed(self) -> "Poses":
        """The same without what hits would tell of parameters."""
        return replace(self, information=np.zeros((len(self), AXES, 0, 0)))


@dataclass(frozen=True, eq=False)
class Target:
    """Where the model has to be good: poses, and how much each label counts there (u, k).

    The importance sums to 1.
    """

    poses: Poses
    importance: np.ndarray

    @classmethod
    def evenly(cls, poses: Poses, weights: np.ndarray | None = None) -> "Target":
        """Every pose alike; labels by `weights` (k,), none given: alike."""
        u, k = poses.low.shape
        given = np.ones(k) if weights is None else np.asarray(weights, dtype=float)
        return cls(poses, np.tile(given / (given.sum() * u), (u, 1)))


@dataclass(frozen=True, eq=False)
class Margins:
    """u yes-or-no questions that depend on frequencies, such as "is this cut stable here?".

    The answer is yes where `margin` (u,), with standard deviation `sd` (u,), is above 0. `slope`
    (u, k) is the change of each margin per relative change of each label's frequency at `poses`;
    `variance` (u,) is the part of the margin's variance that comes from the frequencies, before any
    further measurement.
    """

    poses: Poses
    margin: np.ndarray
    sd: np.ndarray
    slope: np.ndarray
    variance: np.ndarray


@dataclass(frozen=True, eq=False)
class FrequencyOutputs:
    """Log-frequencies of k labels, and the workspace (and goal) to be good at.

    `planned` are poses already chosen and not measured yet: their effect on every covariance is
    exact, for it does not depend on what will be measured there.
    """

    posteriors: tuple[Posterior, ...]  # (k,)
    workspace: Target
    goal: Target
    noise: np.ndarray  # (k,) variance of one measurement
    planned: Poses
    trust: np.ndarray  # (k,) weight of the simulation in each label
    covariance_root: np.ndarray  # (p, p): root rootᵀ is that of the simulation's parameters
    margins: Margins | None = None  # where a decision is asked for

    @classmethod
    def of(
        cls,
        surrogate: Surrogate,
        workspace: Target,
        goal: Target | None = None,
        covariance: np.ndarray | None = None,
    ) -> "FrequencyOutputs":
        """As a surrogate leaves them, and the parameters' covariance (p, p) if any are open."""
        k, primary = surrogate.count, surrogate.primary
        noise = primary.nugget_variance[:k] + MEASUREMENT_SD**2
        open_ = np.zeros((0, 0)) if covariance is None else covariance
        return cls(
            primary.most_probable.outputs[:k],
            workspace,
            goal or workspace,
            noise,
            workspace.poses[:0].uninformed,
            surrogate.frequency_trust,
            np.linalg.cholesky(open_ + 1e-12 * np.eye(len(open_))),
        )

    @property
    def count(self) -> int:
        """Number of labels."""
        return len(self.noise)

    @property
    def weights(self) -> np.ndarray:
        """(k,) how much each label counts, over the workspace."""
        return self.workspace.importance.sum(axis=0)

    def planning(self, pose: Poses, axes: tuple[int, ...] = ALL_AXES) -> "FrequencyOutputs":
        """The same once a pose (n = 1) has been hit along `axes` too."""
        root = self.covariance_root
        planned = Poses.joined([self.planned, pose.uninformed])
        if not pose.information.shape[-1]:
            return replace(self, planned=planned)
        gained = root.T @ pose.information[0, list(axes)].sum(axis=0) @ root
        # G ≥ 0, though rounding may say otherwise where a resonance has next to no damping.
        values, vectors = eigen(gained)
        left = root @ vectors / np.sqrt(1 + np.maximum(values, 0))  # root (I + G)⁻¹ rootᵀ
        return replace(self, planned=planned, covariance_root=left)

    def covariance(self, k: int, a: Poses, b: Poses) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of label k's GP: covariance (s, a, b) and variances (s, a), (s, b), per sample s."""
        cov, va, vb = self._measured(k, a, b)
        if not len(self.planned):
            return cov, va, vb
        wa, wb = self.whitened_planned(k, a), self.whitened_planned(k, b)
        cov = cov - np.swapaxes(wa, 1, 2) @ wb
        return cov, va - np.sum(wa**2, axis=1), vb - np.sum(wb**2, axis=1)

    def variance(self, k: int, poses: Poses) -> np.ndarray:
        """Variance (n,) of label k, averaged over the hyperparameters; GP and parameters."""
        # One point on the other side: only the variances are wanted.
        _, variance, _ = self.covariance(k, poses, self.workspace.poses[:1])
        return np.mean(variance, axis=0) + self.parameter_variance(poses)[:, k]

    def parameter_variance(self, poses: Poses) -> np.ndarray:
        """Variance (n, k) that the simulation's parameters leave."""
        return np.sum((poses.slope @ self.covariance_root) ** 2, axis=-1) * self.trust**2

    def whitened_planned(self, k: int, poses: Poses) -> np.ndarray:
        """L⁻¹ cov(planned, poses) (s, t, n), L Lᵀ being the planned measurements' covariance."""
        pp, _, _ = self._measured(k, self.planned, self.planned)
        root = np.linalg.cholesky(pp + self.noise[k] * np.eye(len(self.planned)))
        cross, _, _ = self._measured(k, self.planned, poses)
        return np.linalg.solve(root, cross)

    def _measured(self, k: int, a: Poses, b: Poses) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.posteriors[k].covariance(a.x, a.low[:, k], b.x, b.low[:, k])
