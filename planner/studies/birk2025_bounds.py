"""Bounds of the parameters in Birk et al. 2025, Tables 1 and 2, in N·m/° and N·m·s/°."""

import numpy as np

from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Priors, parametrise

DEGREE = 180 / np.pi
TORSION_BOUNDS = ((500, 5000), (500, 5000), (250, 3000), (100, 1500), (30, 1000), (30, 1000))
TRANSVERSE_BOUNDS = (
    (2500, 80000), (2500, 80000), (1250, 40000), (500, 5000), (150, 12000), (150, 12000)
)  # fmt: skip
DAMPING_BOUNDS = (0.0001, 0.7)


def paper_priors(simulation: Simulation) -> Priors:
    """A prior from the bounds for each parameter of `robot_12p.toml` or `robot_24p.toml`."""
    bounds = {}
    for name in (p.name for p in parametrise(simulation, Priors()).parameters):
        joint = int(name.partition("joint_")[2][0]) - 1
        stiffness = (TRANSVERSE_BOUNDS if name.endswith("across") else TORSION_BOUNDS)[joint]
        low, high = stiffness if name.startswith("stiffness") else DAMPING_BOUNDS
        bounds[name] = low * DEGREE, high * DEGREE
    return Priors(bounds=bounds)
