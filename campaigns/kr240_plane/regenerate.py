"""Makes the recordings of this campaign again: python campaigns/kr240_plane/regenerate.py

They are SIMULATED: no recording of such a robot is publicly available. The truth comes from
MuJoCo and differs from robot.toml in stiffness, damping, inertia and a soft base; it was fixed
before the planner ever saw it. Needs the extra: pip install 'planner[truth]'.
"""

import heapq
import json
import shutil
from pathlib import Path

import numpy as np

from planner.proof import inverse
from planner.proof.deviation import Deviation, Spring
from planner.proof.load import load_truth
from planner.proof.model import Truth
from planner.proof.recordings import record_poses

HERE = Path(__file__).parent
# Table A1 of Busch et al. 2022, mended: see NOTES.md.
X_M = (0.95, 1.175, 1.4, 1.625, 1.85)
Y_M = (-0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)
Z_M = 1.24
START_DEG = (14.0, -105.0, 115.0, -132.0, -18.0, 133.0)  # elbow up, joint 5 negative
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


def joint_angles(truth: Truth) -> dict[str, np.ndarray]:
    """Angles (rad) of the 35 positions, all with joint 5 negative, by shortest joint travel.

    Positions are reached one from another, outwards from the middle. Near x 1.1 m, y 0 the wrist
    is straight (joint 5 = 0); joints 4 and 6 wind once around that point, so they have to jump
    somewhere between it and the robot: at A13.
    """
    rotation = inverse.tool_rotation(np.array([0.0, 0.0, -1.0]))
    upper = truth.upper_rad.copy()
    upper[4] = -0.01
    found: dict[tuple[int, int], np.ndarray] = {}
    place = np.array([X_M[2], Y_M[3], Z_M])
    first = inverse.joint_angles(truth, rotation, place, np.deg2rad(START_DEG), upper_rad=upper)
    heap = [(0.0, (2, 3), tuple(first))] if first is not None else []
    while heap:
        _, (i, j), q = heapq.heappop(heap)
        if (i, j) in found:
            continue
        found[i, j] = np.array(q)
        for a, b in ((i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)):
            if (a, b) not in found and 0 <= a < len(X_M) and 0 <= b < len(Y_M):
                place = np.array([X_M[a], Y_M[b], Z_M])
                near = inverse.joint_angles(truth, rotation, place, found[i, j], upper_rad=upper)
                if near is not None:
                    travel = float(np.max(np.abs(near - found[i, j])))
                    heapq.heappush(heap, (travel, (a, b), tuple(near)))
    if len(found) < len(X_M) * len(Y_M):
        raise SystemExit(f"only {len(found)} positions can be reached")
    return {f"A{i + 1}{j + 1}": found[i, j] for i, j in sorted(found)}


def main() -> None:
    """Write recordings/ and truth.json."""
    robot_toml = HERE / "robot" / "robot.toml"
    truth = load_truth(robot_toml, DEVIATION)
    poses = list(joint_angles(truth).items())
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
