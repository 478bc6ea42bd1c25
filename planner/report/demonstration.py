"""Answer of `demo`: the course of a campaign on shipped recordings, and how well it predicts."""

from dataclasses import dataclass

import numpy as np
from rich.console import Group
from rich.text import Text

from planner.report.answer import Answer
from planner.report.text import SIMULATED, number, table


@dataclass(frozen=True, eq=False)
class DemonstrationStep:
    """A measurement: the pose, the one proposed next, frequencies of its modes, and times."""

    pose: str
    proposed: str
    frequency_hz: tuple[float, ...]
    refused: int
    frequency_sd_percent: np.ndarray
    refit_seconds: float
    seconds: float


@dataclass(frozen=True, eq=False)
class DemonstrationReport(Answer):
    """Answer of `demo`: predictions judged on the `unused` poses of the pool."""

    campaign: str
    robot: str
    simulated: bool
    pool: int
    measurements: int
    used: tuple[str, ...]
    unused: int
    modes_compared: int
    frequency_rmse_percent: float
    simulation_rmse_percent: float
    frequency_rmse_percent_per_mode: tuple[float, ...]
    simulation_rmse_percent_per_mode: tuple[float, ...]
    coverage95: float
    coverage95_per_mode: tuple[float, ...]
    remarks: tuple[str, ...]
    step_seconds: tuple[float, ...]
    steps: tuple[DemonstrationStep, ...]
    rrd: str

    def text(self) -> Group:
        """The course, and the errors mode by mode."""
        course = table("Course", "measurement", "pose", "measured (Hz)", "sd of frequencies (%)")
        for k, step in enumerate(self.steps, 1):
            hz = "  ".join(f"{f:.2f}" for f in step.frequency_hz)
            sd = "  ".join(f"{v:.2f}" for v in step.frequency_sd_percent)
            course.add_row(str(k), step.pose, hz, sd)
        made = table(
            f"Demonstration on {self.robot}: {self.measurements} of {self.pool} poses",
            *("mode", "planner RMSE (%)", "simulation alone RMSE (%)", "in 95 % interval (%)"),
        )
        columns = (
            self.frequency_rmse_percent_per_mode,
            self.simulation_rmse_percent_per_mode,
            self.coverage95_per_mode,
        )
        for k, (ours, simulation, inside) in enumerate(zip(*columns, strict=True), 1):
            made.add_row(str(k), number(ours), number(simulation), f"{100 * inside:.0f}")
        every = number(self.frequency_rmse_percent), number(self.simulation_rmse_percent)
        made.add_row("all", *every, f"{100 * self.coverage95:.0f}", style="bold")
        first, *later = self.step_seconds
        lines = [
            *self.remarks,
            f"On {self.unused} poses that were never used. Refit and next proposal: first "
            f"{first:.2f} s, then at most {max(later, default=0.0):.2f} s.",
            f"Campaign: {self.campaign}",
            f"Rerun recording: {self.rrd} (open with: rerun FILE)",
        ]
        return Group(course, made, Text("\n".join(lines)), SIMULATED)
