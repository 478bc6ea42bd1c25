"""Damping that is another one at every visit: brakes engage anew, grease is warm or cold."""

from dataclasses import dataclass, replace

import numpy as np

from planner.truth.model import Truth


@dataclass(frozen=True)
class DampingScatter:
    """Every joint's damping times a factor of its own at each visit, of log-sd `sd`."""

    sd: float
    seed: int = 0

    def applied(self, truth: Truth, progress: float) -> Truth:
        """The robot at a time of the campaign: the same at the same `progress`."""
        rng = np.random.default_rng([self.seed, round(1e6 * progress)])
        names = dict.fromkeys(spring.joint for spring in truth.springs)
        factors = {name: float(np.exp(self.sd * rng.standard_normal())) for name in names}
        springs = tuple(
            replace(s, damping=factors[s.joint] * s.damping, loss=factors[s.joint] * s.loss)
            for s in truth.springs
        )
        return replace(truth, springs=springs)
