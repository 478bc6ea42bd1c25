"""A small robot with something concealed, hit a few times: diagnosed in a minute."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from planner.proof.deviation import (
    AttachedMass,
    AttachedResonator,
    BentLink,
    Deviation,
    Feedback,
    StiffnessRipple,
    soft_floor,
)
from planner.proof.fault_injection import (
    Artefact,
    InjectedFaults,
    JointDrift,
    hand_visits,
    hit_poses,
)
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.proof.measurement_errors import LABORATORY, MeasurementErrors
from planner.proof.recordings import write_predict, write_recordings
from tests.support.arm_with_points import NODES, poses, write_arm

# Springs, dampers and bodies never are as stated; nobody is to call that a finding.
SCATTER = Deviation(5, stiffness=0.1, damping=0.15, inertia=0.03, com_m=0.003)
POSES, SEED, TCP_NODE = 5, 1, 17
HAMMER = Hammer(peak_n=250.0, noise=0.004)
BASE = {"x": 1.4e6, "y": 1.1e6}  # N·m/rad
SOFT = soft_floor(*BASE.values())
TURNED = Rotation.from_euler("zyx", [15.0, -10.0, 5.0], degrees=True).as_matrix()
GAIN, WINDOW_S, HOSE_HZ, HOSE_KG, MASS_KG = 0.7, 0.5, 21.0, 3.0, 25.0
DRIFT = JointDrift((("", -0.15, "linear"),))


@dataclass(frozen=True)
class Concealed:
    """What is wrong with a robot and its measuring chain, and by which effects at which places."""

    places: tuple[tuple[str, str], ...] = ()
    change: Mapping[str, object] = field(default_factory=dict)  # of SCATTER
    rest: Mapping[str, object] = field(default_factory=dict)  # of the secret

    def __or__(self, other: "Concealed") -> "Concealed":
        both = {**self.change, **other.change}, {**self.rest, **other.rest}
        return Concealed((*self.places, *other.places), *both)


def _artefact(effect: str, at: str, **change: object) -> Concealed:
    return Concealed(((effect, at),), rest={"artefact": replace(Artefact(), **change)})


CONCEALED = {
    "nothing": Concealed(),
    "soft base": Concealed((("base_compliance", "base"),), {"extra": SOFT}),
    "bending link": Concealed(
        (("link_flexibility", "link_2"),), {"beams": (BentLink("l2", (1.6e6, 2e6), 1.6e6, 3e-4),)}
    ),
    "added mass": Concealed(
        (("added_mass", "link_3"),), {"added": (AttachedMass("l3", (0.2, 0.15, 0.1), MASS_KG),)}
    ),
    "hose": Concealed(
        (("local_resonator", "link_3"),),
        {
            "resonators": (
                AttachedResonator("l3", (0.1, 0.1, 0), (0, 0.6, 0.8), HOSE_KG, HOSE_HZ, 0.03),
            )
        },
    ),
    "turned sensor": _artefact("sensor_rotation", "sensor", rotation=TURNED),
    "polarity": _artefact("polarity", "sensor_z", gain=(1.0, 1.0, -1.0)),
    "gain": _artefact("sensor_gain", "sensor_y", gain=(1.0, GAIN, 1.0)),
    "window": _artefact("exponential_window", "sensor", window_s=WINDOW_S),
    "drift": Concealed((("drift", "campaign"),), rest={"drift": DRIFT}),
    "angle": Concealed(
        (("angle_dependent_stiffness", "joint_2"),),
        {"harmonics": (StiffnessRipple("a2", 2, 0.35, 0.2),)},
    ),
    # A controller that breaks reciprocity: nothing that only holds or weighs does.
    "outsider": Concealed(
        (("unknown", ""),), {"feedback": (Feedback(driven="a2", sensed="a3", gain=2e5),)}
    ),
}  # fmt: skip
CONCEALED["base and gain"] = CONCEALED["soft base"] | CONCEALED["gain"]


@dataclass(frozen=True)
class SmallCase:
    """Files of a case: the robot's, the recordings', and poses whose FRFs may be asked for."""

    robot_toml: Path
    recordings: Path
    predict_csv: Path


def small_case(folder: Path, of: Concealed, errors: MeasurementErrors = LABORATORY) -> SmallCase:
    """An arm of four joints, hit once along each axis at a few poses."""
    tcp = f'[[point]]\nname = "tcp"\nnode = {TCP_NODE}\n'
    robot_toml, q = write_arm(folder / "robot", tcp), poses(POSES + 1, SEED)
    own = np.random.default_rng(SEED)
    injected = InjectedFaults(replace(SCATTER, **of.change), chain=errors.chain(own), **of.rest)
    truth, shots = load_truth(robot_toml, injected.deviation), [(f"+{a}", 250.0) for a in "xyz"]
    visits = hand_visits(errors, q[:POSES], shots, own)
    found = hit_poses(truth, injected, visits, HAMMER, np.random.default_rng(SEED))
    pairs = enumerate(zip(q, found, strict=False), 1)
    rows = [(f"P{i}", np.rad2deg(row), hits) for i, (row, hits) in pairs]
    folder /= "recordings"
    write_recordings(
        folder, truth.joint_names, rows, HAMMER, "small case", NODES | {"tcp": TCP_NODE}
    )
    unused = [("H1", q[POSES])]
    return SmallCase(robot_toml, folder, write_predict(folder, truth.joint_names, unused))
