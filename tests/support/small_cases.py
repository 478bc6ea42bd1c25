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
)
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.proof.measurement_errors import LABORATORY, MeasurementErrors
from planner.proof.recordings import write_predict
from tests.support.arm_with_points import NODES, poses, write_arm
from tests.support.struck_poses import record_by_hand

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


def _physics(effect: str, at: str, **change: object) -> Concealed:
    return Concealed(((effect, at),), change)


BENT = BentLink("l2", (1.6e6, 2e6), 1.6e6, 3e-4)
HOSE = AttachedResonator("l3", (0.1, 0.1, 0), (0, 0.6, 0.8), HOSE_KG, HOSE_HZ, 0.03)
MASS = AttachedMass("l3", (0.2, 0.15, 0.1), MASS_KG)
RIPPLE = StiffnessRipple("a2", 2, 0.35, 0.2)
BREAKING = Feedback(driven="a2", sensed="a3", gain=2e5)  # reciprocity, as only a controller can
CONCEALED = {
    "nothing": Concealed(),
    "soft base": _physics("base_compliance", "base", extra=SOFT),
    "bending link": _physics("link_flexibility", "link_2", beams=(BENT,)),
    "added mass": _physics("added_mass", "link_3", added=(MASS,)),
    "hose": _physics("local_resonator", "link_3", resonators=(HOSE,)),
    "turned sensor": _artefact("sensor_rotation", "sensor", rotation=TURNED),
    "polarity": _artefact("polarity", "sensor_z", gain=(1.0, 1.0, -1.0)),
    "gain": _artefact("sensor_gain", "sensor_y", gain=(1.0, GAIN, 1.0)),
    "window": _artefact("exponential_window", "sensor", window_s=WINDOW_S),
    "drift": Concealed((("drift", "campaign"),), rest={"drift": DRIFT}),
    "angle": _physics("angle_dependent_stiffness", "joint_2", harmonics=(RIPPLE,)),
    "outsider": _physics("unknown", "", feedback=(BREAKING,)),
}
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
    truth, folder = load_truth(robot_toml, injected.deviation), folder / "recordings"
    hit = [(f"P{i}", row) for i, row in enumerate(np.rad2deg(q[:POSES]), 1)]
    record_by_hand(folder, truth, injected, errors, hit, ("+x", "+y", "+z"), HAMMER, own,
                   noise=np.random.default_rng(SEED), nodes=NODES | {"tcp": TCP_NODE})  # fmt: skip
    unused = [("H1", q[POSES])]
    return SmallCase(robot_toml, folder, write_predict(folder, truth.joint_names, unused))
