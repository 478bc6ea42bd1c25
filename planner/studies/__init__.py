"""The papers' studies again, on simulated recordings: tables, pictures, and whether they agree.

No recordings of the papers are public. What stands in for them comes from MuJoCo
(`planner.proof`), never from the planner's own simulation.
"""

from pathlib import Path

# Each study lies beside its paper's robot in campaigns/, of the package or of a checkout.
__path__ += [str(folder / "campaigns") for folder in Path(__file__).parents[1:3]]
