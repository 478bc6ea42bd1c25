"""A campaign from Python without files: python ask_tell.py. Here a simulation plays the robot."""

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np

from planner import AskTell, Robot, Simulation

HERE = Path(__file__).parent
robot = Robot.load(HERE / "robot" / "robot.toml")
tables = {
    "workspace": {"joints_deg": [[-40, 40], [-20, 40], [-60, 10], [-30, 30], [20, 80], [0, 0]]},
    "modes": {"count": 3, "band_hz": [5.0, 80.0]},
    "acquisition": {"candidates": 100},
    "fidelity": {"simulation": "frozen"},  # "updated" learns from FRFs: tell(..., frf=...)
}

# Stands for the real robot: 10 % stiffer than robot.toml says. Put your measurement in its place.
springs = [msgspec.structs.replace(c, stiffness=1.1 * c.stiffness) for c in robot.config.compliance]
config = msgspec.structs.replace(robot.config, compliance=tuple(springs))
real_robot = Simulation(replace(robot, config=config))

loop = AskTell(robot, tables)
while not loop.done and len(loop.records()) < 30:
    proposal = loop.ask()[0]
    found = real_robot.modes(np.deg2rad([proposal.joints_deg]), 3)
    pairs = zip(found.frequency_hz[0], found.damping_ratio[0], strict=True)
    modes = [{"frequency_hz": f, "damping_ratio": z} for f, z in pairs]
    loop.tell(proposal.joints_deg, modes=modes)

unseen_deg = [5, 10, -20, 5, 50, 0]
print(f"{len(loop.records()) // 3} poses told")
for row in loop.predict_records(unseen_deg):  # pandas.DataFrame(loop.records()) works as well
    print("mode {mode}: {frequency_hz:.2f} ± {frequency_sd_hz:.2f} Hz".format(**row))
print("real:", real_robot.modes(np.deg2rad([unseen_deg]), 3).frequency_hz[0].round(2))
