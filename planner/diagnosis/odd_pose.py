"""One pose at odds with all others: the robot did not stand there as said, or differs there."""

from collections.abc import Sequence
from dataclasses import dataclass

from planner.diagnosis.linear.predict import anew
from planner.diagnosis.linear_diagnosis import Diagnosis
from planner.diagnosis.thresholds import RESIDUAL_CLEARLY
from planner.words import significant

LEAST, MOST = 3, 12  # poses among which one can be odd; beyond, refits take long. Chosen
TRIED = 2  # poses that refitting follows least: each takes a refit of seconds. Chosen
AGREES = 1.0  # misfit at noise and what just does not matter


@dataclass(frozen=True)
class OddPose:
    """Misfit (χ² per value) of the simulation refitted to all poses, and without this one."""

    pose: str
    misfit: float
    misfit_without: float

    @property
    def sentence(self) -> str:
        """For the engineer."""
        without, whole = significant(self.misfit_without), significant(self.misfit)
        return (
            f"Pose {self.pose} is at odds with all others: without it the refitted simulation "
            f"agrees with them (misfit {without}, with it {whole}; 1 just matters). Check whether "
            f"the robot stood there as said, or measure it again."
        )


def odd_pose(found: Diagnosis, poses: Sequence[str]) -> OddPose | None:
    """The pose (named as the problem's FRFs are) without which refitting alone explains the rest.

    None where there is no such pose among the worst, or more than one: then it is not known which.
    """
    problem, refitted = found.problem, found.refitted
    names = list(dict.fromkeys(poses))
    if refitted.per_value <= RESIDUAL_CLEARLY or not LEAST <= len(names) <= MOST:
        return None
    misfit = {name: 0.0 for name in names}
    for pose, chi2 in zip(poses, refitted.data.chi2, strict=True):
        misfit[pose] += float(chi2)
    odd = []
    for name in sorted(names, key=lambda name: -misfit[name])[:TRIED]:
        rest = problem.at([i for i, pose in enumerate(poses) if pose != name])
        without = anew(rest, refitted).per_value
        if without <= AGREES:
            odd.append(OddPose(name, refitted.per_value, without))
    return odd[0] if len(odd) == 1 else None
