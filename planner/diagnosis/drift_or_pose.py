"""Whether what hits tell as drift may go with the pose instead: each pose has a time of its own."""

from planner.dataset.dataset import Dataset
from planner.diagnosis.effects.angle_dependent_stiffness import AngleDependentStiffness
from planner.diagnosis.finding import Finding
from planner.diagnosis.linear_diagnosis import Diagnosis, diagnose
from planner.diagnosis.screens.drift import returned
from planner.diagnosis.thresholds import DRIFT_CRUDE, DRIFT_GAINS, PAYS
from planner.dynamics.simulation import Simulation


def doubtful(drift: Finding, recorded: Dataset, simulation: Simulation) -> bool:
    """Whether the pose's effects have to be weighed against drift.

    Where no pose was returned to, a joint whose stiffness goes with its angle may look like one
    whose stiffness goes with time.
    """
    if drift.misfit > DRIFT_CRUDE or drift.gain < DRIFT_GAINS:
        return True
    if returned(recorded) is not None:
        return False
    waves = AngleDependentStiffness.everywhere(simulation)
    found = diagnose(recorded.ended_frfs, recorded.q, simulation, effects=waves)
    return found.verdict == "explained" and less_likely(drift, found)


def less_likely(drift: Finding, found: Diagnosis) -> bool:
    """Whether linear effects explain more than drift: by far, where drift explains most."""
    if drift.misfit > DRIFT_CRUDE:
        return drift.misfit > PAYS * found.best.per_value
    return found.refitted.per_value / found.best.per_value > drift.gain
