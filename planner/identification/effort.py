"""How exact an identification is: quick between hits, thorough when asked for by itself."""

from dataclasses import dataclass

from planner.measurement.agreement import MOST_LINES

STAGES = (0.1, 0.28, 0.59, 1.0)  # of the band: 25, 60, 120, 200 Hz of 5 to 200


@dataclass(frozen=True)
class Effort:
    """How exact an identification is: lines a pose and completions of cut-off records.

    Each for a start and for the last fit, which is judged on as many lines; iterations end where a
    step gains less than `tolerance`.
    """

    lines: int = 160
    last_lines: int = MOST_LINES
    completions: int = 2  # after the first: exact to second order
    last_completions: int = 6
    tolerance: float = 1e-6
    sloped: bool = True  # a completion holds to first order, not at one point only
    stages: tuple[float, ...] = STAGES
    log_lines: int = 64  # a pose, in the logarithmic stages
    log_steps: int = 40
    steps: int = 80
    doubtful: bool = True  # of a warm start that fits worse than before: all is searched anew
    openings: int = 4  # rounds at most, in which what hits leave open follows the fit


THOROUGH = Effort()
QUICK = Effort(
    48, 80, 0, 1, 1e-4, False, stages=(0.28, 1.0), log_lines=40, log_steps=12, doubtful=False,
    openings=1,
)  # fmt: skip
