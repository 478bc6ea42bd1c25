"""A campaign from a script: python example.py (recordings are simulated, and labelled so)."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from planner import Campaign

SHIPPED, HERE = Path(__file__).parent, Path.cwd()
campaign = Campaign.new(HERE / "cell", SHIPPED / "robot/robot.toml", SHIPPED / "campaign.toml")
for pose in ("A11", "A24", "A57"):
    campaign.import_paths((SHIPPED / "recordings",), pose)
at = (proposal := campaign.next()[0]).joints_deg
expected, (h, sd) = campaign.predict(joints_deg=at), campaign.frf(joints_deg=at)
print(proposal.pose, at, expected.frequency_hz, expected.frequency_sd_hz)
lines, size, band = campaign.frequency_lines, np.abs(h[0, 0, 0]), 2 * sd[0, 0, 0]
plt.fill_between(lines, np.maximum(size - band, 0), size + band, alpha=0.3)
plt.plot(lines, size)
plt.savefig(HERE / "frf_xx.png")
