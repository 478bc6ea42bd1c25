"""A joint's own spring that is far from what is stated."""

from collections.abc import Mapping
from dataclasses import dataclass

from planner.effects.effect import Operator, SpringPrior


@dataclass(frozen=True)
class FarOffSpring(Operator):
    """What is stated of the spring does not count: its logarithm has `log_sd`."""

    own: int = 0
    log_sd: float = 1.5
    spring_name: str = ""

    kind = "joint_stiffness"
    absorbed = True

    @property
    def spring_priors(self) -> Mapping[int, SpringPrior]:
        """See `Operator.spring_priors`."""
        return {self.own: SpringPrior(0.0, self.log_sd)}

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        value, sd = values[f"stiffness of {self.spring_name}"]
        return (
            f"The spring of {self.at} is {value:.3g} ± {sd:.1g} N·m/rad, far from what robot.toml "
            "states: check the gear, its preload, and the datasheet."
        )
