"""Makes the recordings of this campaign again: python campaigns/kr240_plane/regenerate.py

They are SIMULATED: no recording of such a robot is publicly available. The truth comes from
MuJoCo and differs from robot.toml in stiffness, damping, inertia and a soft base; it was fixed
before the planner ever saw it. Needs the extra: pip install 'planner[truth]'.
"""

import json
import shutil
from pathlib import Path

import numpy as np

from planner.campaign.config import load_campaign_config
from planner.robot.collision import Collisions
from planner.robot.inverse import solve
from planner.robot.robot import Robot
from planner.robot.workspace import Workspace
from planner.truth.hits import record_poses
from planner.truth.model import Deviation, Spring, load_truth

HERE = Path(__file__).parent
# Table A1 of Busch et al. 2022, mended: see NOTES.md.
X_M = (0.95, 1.175, 1.4, 1.625, 1.85)
Y_M = (-0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)
Z_M = 1.24
SEED = 20221
DEVIATION = Deviation(
    seed=SEED,
    stiffness=0.12,
    damping=0.15,
    inertia=0.04,
    com_m=0.005,
    extra=(
        Spring("base", (1.0, 0.0, 0.0), 2.2e7, 1.8e4),
        Spring("base", (0.0, 1.0, 0.0), 1.9e7, 1.6e4),
    ),
)


def joint_angles(robot: Robot, workspace: Workspace) -> list[tuple[str, np.ndarray]]:
    """Angles (rad) of the 35 positions, each on the IK branch of the candidates around it."""
    collisions, rotation, found = Collisions(robot), workspace.rotation(0.0), []
    candidates = workspace.candidates(robot, 500, 0)
    for i, x in enumerate(X_M):
        for j, y in enumerate(Y_M):
            place = np.array([x, y, Z_M])
            distance = np.linalg.norm(candidates.position_m - place, axis=1)
            for near in np.argsort(distance)[:20]:
                result = solve(robot, rotation, place, candidates.q[near], collisions, restarts=0)
                if result.q is not None:
                    found.append((f"A{i + 1}{j + 1}", result.q))
                    break
            else:
                raise SystemExit(f"x {x}, y {y}: {result.reason}")
    return found


def main() -> None:
    """Write recordings/ and truth.json."""
    robot_toml = HERE / "robot" / "robot.toml"
    config = load_campaign_config(HERE / "campaign.toml")
    robot = Robot.load(robot_toml)
    poses = joint_angles(robot, Workspace.from_table(config.workspace, robot))
    truth = load_truth(robot_toml, DEVIATION)
    shutil.rmtree(HERE / "recordings", ignore_errors=True)
    record_poses(truth, poses, HERE / "recordings", seed=SEED)
    table = {}
    for pose, q in poses:
        frequency, damping, _ = truth.modes(q, 4)
        table[pose] = {
            "position_m": truth.position(q).round(4).tolist(),
            "frequency_hz": frequency.round(5).tolist(),
            "damping_ratio": damping.round(6).tolist(),
        }
    note = "SIMULATED truth, for scoring only; the planner never reads it"
    content = {"note": note, "engine": truth.description, "poses": table}
    (HERE / "truth.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
