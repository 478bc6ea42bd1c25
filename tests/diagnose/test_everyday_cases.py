"""Small concealed cases with everyday's hits, sensor and readback: what is said, what is not.

Where nothing is concealed, and of a soft base, it is the command that is asked, with the same hits:
`tests/cli/test_diagnose_command.py`.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner import Dataset, Robot, diagnose
from planner.report.diagnosis import DiagnosisReport
from planner.truth.deviation import (
    AttachedMass,
    AttachedResonator,
    BentLink,
    Deviation,
    Feedback,
    ScaledJoint,
    Spring,
    StiffnessRipple,
)
from planner.truth.handling import EVERYDAY
from planner.truth.secret import Artefact
from tests.support.small_cases import SCATTER, small_case, unlike

HOSE = AttachedResonator("link_3", (0.2, 0.0, 0.1), (0.0, 0.6, 0.8), 1.2, 24.0, 0.02)
BEARING = tuple(Spring("joint_2", axis, 2e5, 60.0) for axis in ((1.0, 0, 0), (0, 1.0, 0)))
BEAM = BentLink("link_3", (3e4, 3e4), 3e4, 1e-3)
TURNED = Rotation.from_rotvec(np.deg2rad([0, 0, 15])).as_matrix()


@dataclass(frozen=True)
class Concealed:
    """What a small case hides; `said` are effects and places, any one of them being right."""

    deviation: Deviation = SCATTER
    artefact: Artefact | None = None
    verdict: str = "explained"
    said: tuple[tuple[str, str], ...] = ()


CASES = {
    "another hand, nothing": Concealed(unlike(seed=11), verdict="consistent"),
    "weak joint, another gear a little uneven": Concealed(
        unlike(
            scaled=(ScaledJoint("joint_3", 0.4),),
            harmonics=(StiffnessRipple("joint_2", 1, 0.015, 0.01),),
        ),
        said=(("joint_stiffness", "joint_3"),),
    ),
    "bearing that tilts": Concealed(
        unlike(extra=BEARING), said=(("transverse_compliance", "joint_2"),)
    ),
    "link that bends": Concealed(unlike(beams=(BEAM,)), said=(("link_flexibility", "link_3"),)),
    "quiet channel": Concealed(
        artefact=Artefact(gain=(1.0, 0.75, 1.0)), said=(("sensor_gain", "sensor_y"),)
    ),
    "turned channel": Concealed(
        artefact=Artefact(gain=(1.0, 1.0, -1.0)), said=(("polarity", "sensor_z"),)
    ),
    "forgotten mass": Concealed(
        unlike(added=(AttachedMass("link_4", (0.1, 0.05, 0.1), 4.0),)),
        said=(("added_mass", "link_4"),),
    ),
    "hose pack": Concealed(unlike(resonators=(HOSE,)), said=(("local_resonator", "link_3"),)),
    "uneven gear": Concealed(
        unlike(harmonics=(StiffnessRipple("joint_2", 1, 0.5, 0.3),)),
        said=(("angle_dependent_stiffness", "joint_2"),),
    ),
    "turned sensor": Concealed(
        artefact=Artefact(rotation=TURNED), said=(("sensor_rotation", "sensor"),)
    ),
    "late channels": Concealed(
        artefact=Artefact(delay_s=2e-3), said=(("channel_delay", "sensor"),)
    ),
    "a controller": Concealed(
        unlike(feedback=(Feedback("joint_1", "joint_3", 4e4),)), verdict="unexplained"
    ),
}


def told(tmp_path, concealed: Concealed) -> DiagnosisReport:
    case = small_case(tmp_path, concealed.deviation, concealed.artefact, EVERYDAY)
    robot = Robot.load(case.robot_toml)
    return diagnose(Dataset.read(case.recordings, robot), robot)


LONG = {"link that bends"}  # a minute and more: bearings and inertias imitate it


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow if n in LONG else ()) for n in CASES]
)
def test_what_is_concealed_is_named_and_nothing_else(tmp_path, name):
    concealed = CASES[name]
    found = told(tmp_path, concealed)
    assert found.verdict == concealed.verdict
    named = {(f.effect, f.at) for f in found.findings}
    alternatives = {(one.effect, one.at) for group in found.sets for one in group[:2]}
    if concealed.said:
        assert len(named) == 1
        assert (named | alternatives) & set(concealed.said)
    else:
        assert not named
