"""A small robot with something concealed, hit a few times: diagnosed in seconds by the command."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.truth.deviation import Deviation
from planner.truth.handling import LABORATORY, Handling
from planner.truth.hits import Hammer, write_predict, write_recordings
from planner.truth.load import load_truth
from planner.truth.secret import Artefact, HitVisit, Secret, hit_poses
from tests.support.known_robots import KR10

# Springs, dampers and bodies never are as stated; nobody is to call that a finding.
SCATTER = Deviation(5, stiffness=0.1, damping=0.15, inertia=0.03, com_m=0.003)
POSES, SEED = 4, 1
HAMMER = Hammer(peak_n=150.0, noise=0.01)


@dataclass(frozen=True)
class SmallCase:
    """Files of a case: the robot's, the recordings', and poses whose FRFs may be asked for."""

    robot_toml: Path
    recordings: Path
    predict_csv: Path


def small_case(
    folder: Path,
    deviation: Deviation = SCATTER,
    artefact: Artefact | None = None,
    handling: Handling = LABORATORY,
) -> SmallCase:
    """A KR10 with six springs, hit once along each axis at POSES poses.

    Its robot.toml knows the gravity that the truth has, so that nothing differs but what is
    concealed, and what `handling` leaves open.
    """
    robot_toml = KR10.write(folder / "robot")
    stated = robot_toml.read_text()
    robot_toml.write_text(f"geometric_stiffness = true\n{stated}")
    truth = load_truth(robot_toml, deviation)
    angles_deg = np.round(np.rad2deg(KR10.poses(POSES + 1, SEED)), 4)
    shots = [(f"+{axis}", HAMMER.peak_n) for axis in "xyz"]
    own = np.random.default_rng(SEED)
    visits = []
    for i, q in enumerate(np.deg2rad(angles_deg[:POSES])):
        off = np.deg2rad(handling.readback_deg) * own.standard_normal(len(q))
        visits.append(HitVisit(q + off, shots, i / POSES, handling.aims([0, 1, 2], own)))
    secret = Secret(deviation, artefact=artefact or Artefact(), chain=handling.chain(own))
    found = hit_poses(truth, secret, visits, HAMMER, np.random.default_rng(SEED))
    rows = [
        (f"P{i + 1}", q, 1, hit)
        for i, (q, hits) in enumerate(zip(angles_deg[:POSES], found, strict=True))
        for hit in hits
    ]
    folder /= "recordings"
    write_recordings(folder, truth.joint_names, rows, HAMMER, "small case")
    unused = [("H1", np.deg2rad(angles_deg[POSES]))]
    return SmallCase(robot_toml, folder, write_predict(folder, truth.joint_names, unused))


def unlike(**change: object) -> Deviation:
    """SCATTER with something else beside it."""
    return replace(SCATTER, **change)
