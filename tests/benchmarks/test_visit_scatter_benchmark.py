"""Intervals of fused frequencies hold new visits where visits scatter, at every count of poses.

Five robots, three simulations, scatter of 0, 0.3, 0.5 and 1 % from visit to visit, beside two
peers: a GP on the ratio to the simulation, and a GP alone. `pytest -m slow -s` prints the table:
coverage of 95 % intervals for new visits, RMSE in %. SCATTER_SEEDS (4) says how many designs a
cell.
"""

import os

import numpy as np
import pytest

from planner.surrogate.modal_surrogate import fit_primary
from tests.support.visit_scatter import MODES, OFF, ROBOTS, Visited, peer, visited

SEEDS = int(os.environ.get("SCATTER_SEEDS", "4"))
COUNTS, SCATTERS = (3, 5, 8, 12), (0.0, 0.003, 0.005, 0.01)
METHODS = ("before", "ours", "GP on the ratio", "GP")
Z_95 = 1.959964


def fused(case: Visited, identified: bool, visits: bool) -> tuple[np.ndarray, np.ndarray]:
    """Mean and sd of new visits' ln f; `visits` off: as before scatter was learned."""
    known = (np.full(MODES, OFF), None, 0.99) if identified else (None, None, 0.5)
    fitted = fit_primary(case.seen, *known, visits)
    return fitted.predict(case.x, case.simulated, nugget=visits)


def scored(case: Visited, identified: bool) -> np.ndarray:
    """(method, 2): mean square error, share inside."""
    answers = (
        fused(case, identified, False),
        fused(case, identified, True),
        peer(case, True),
        peer(case, False),
    )
    off = [(mean - case.shown, sd) for mean, sd in answers]
    return np.array([[np.mean(e**2), np.mean(np.abs(e) < Z_95 * sd)] for e, sd in off])


@pytest.mark.slow
@pytest.mark.timeout(0)
@pytest.mark.parametrize("simulation", ["stated", "identified", "offset", "foreign"])
def test_new_visits_lie_in_their_intervals(simulation):
    print(f"\nsimulation {simulation}: scatter %, n" + "".join(f"{m:>20s}" for m in METHODS))
    for scatter in SCATTERS:
        for n in COUNTS:
            runs = np.array(
                [
                    scored(visited(robot, simulation, n, scatter, seed), simulation == "identified")
                    for robot in ROBOTS
                    for seed in range(SEEDS)
                ]
            )
            rms = 100 * np.sqrt(runs[:, :, 0].mean(axis=0))
            inside = 100 * runs[:, :, 1].mean(axis=0)
            cells = "".join(f"{r:11.2f} ({c:3.0f} %)" for r, c in zip(rms, inside, strict=True))
            print(f"{100 * scatter:20.1f} {n:4d}  {cells}")
            assert inside[1] >= (90 if scatter else 88)
            # Where the simulation is off by an offset alone, the peer has but that to learn.
            assert rms[1] <= (1.08 if simulation == "offset" else 1.03) * min(rms[2:])
            if scatter == 0:
                assert rms[1] <= 1.05 * rms[0]
