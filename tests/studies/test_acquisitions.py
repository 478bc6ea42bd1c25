"""Does choosing where to measure pay? Strategies × a simulation that learns, or stays, or both.

`pytest -m slow tests/studies/test_acquisitions.py -s` prints the tables. STUDY_CELLS (all five,
names separated by ";"), STUDY_SEEDS (2), STUDY_FIRST (101) and STUDY_STRATEGIES (by ";", beside
those that are compared) make it larger or smaller; STUDY_KEPT names a folder that keeps finished
runs, so that it can be stopped, and several processes can share it. Truths are MuJoCo models with
± 15 % springs, 4 % inertias and noise of EMA's size; errors are those at 60 poses never measured,
FRFs' at ten of them.
Seeds 1-20 were used in development.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
import pytest

from planner.design.space_filling import NESTED
from tests.support.acquisition_cases import CELLS, campaign, make

pytestmark = [pytest.mark.slow, pytest.mark.timeout(0)]
NAMES = os.environ.get("STUDY_CELLS", ";".join(CELLS)).split(";")
SEEDS = int(os.environ.get("STUDY_SEEDS", "2"))
FIRST = int(os.environ.get("STUDY_FIRST", "101"))
BASELINE, DEFAULT = "maximin_lhs", "integrated_variance"
MORE = tuple(filter(None, os.environ.get("STUDY_STRATEGIES", "").split(";")))
BUDGET = {
    "updated": int(os.environ.get("STUDY_BUDGET", "5")),
    "frozen": int(os.environ.get("STUDY_FROZEN", "12")),
}
INITIAL = {"updated": 0, "frozen": 2}  # poses of the baseline's design with which all begin
GOALS: dict[str, Callable[["Curve"], tuple[float, float]]] = {
    "RMSE 1 %": lambda c: c.until(1.0),
    "RMSE 0.5 %": lambda c: c.until(0.5),
    "FRAC 95 %": lambda c: c.alike(0.95),
}


@dataclass(frozen=True, eq=False)
class Curve:
    """One campaign: errors, minutes, and what the model foretold after each measurement."""

    rmse: np.ndarray
    minutes: np.ndarray
    reached: np.ndarray  # foretold probability that the RMSE is below 1 %
    frac: np.ndarray  # Global FRAC of FRFs

    def until(self, percent: float) -> tuple[float, float]:
        """Measurements and minutes from which on the RMSE stays below; ∞ beyond the budget."""
        return self._stays(self.rmse <= percent)

    def alike(self, frac: float) -> tuple[float, float]:
        """Measurements and minutes from which on the FRAC stays above; ∞ beyond the budget."""
        return self._stays(self.frac >= frac)

    def _stays(self, good: np.ndarray) -> tuple[float, float]:
        bad = np.flatnonzero(~good)
        n = int(bad[-1]) + 1 if len(bad) else 0
        if n == len(good):
            return np.inf, np.inf
        return n + 1, float(self.minutes[n])


def curve(case, strategy: str, budget: int, initial: int) -> Curve:
    x = case.cell.candidates.features
    first = NESTED[BASELINE](x, budget, case.seed).tolist()[:initial]
    plan = strategy
    if strategy in NESTED:
        plan = NESTED[strategy](x, budget, case.seed).tolist()
    rows = []
    for step in campaign(case, first, plan, budget):
        # The rule does not speak before three measurements.
        reached = step.model.forecast.reached if step.n >= 3 else 0.0
        rows.append((step.rmse_percent, step.minutes, reached, step.frac))
    return Curve(*np.array(rows).T)


def kept(name: str, make_it: Callable[[], Curve]) -> Curve:
    """A run from the folder STUDY_KEPT, or made and kept there."""
    folder = os.environ.get("STUDY_KEPT")
    if not folder:
        return make_it()
    path = Path(folder) / f"{name}.npy"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        np.save(path, np.array(list(vars(make_it()).values())))
    return Curve(*np.load(path))


def played(simulation: str, folder: Path, strategies: tuple[str, ...]) -> dict[str, list[Curve]]:
    """Curves by strategy, cell by cell and seed by seed.

    "mixed best": along the axes that tell most per minute, not along all.
    """
    found: dict[str, list[Curve]] = {s: [] for s in strategies}
    budget, initial = BUDGET[simulation], INITIAL[simulation]
    for name, seed in ((n, s) for s in range(FIRST, FIRST + SEEDS) for n in NAMES):
        robot, lacking = CELLS[name]

        @lru_cache
        def case(axes: str, robot=robot, seed=seed, lacking=lacking):
            own = folder / f"{robot}{seed}{lacking}{axes}"
            return make(robot, seed, simulation, own, lacking, axes)

        for strategy, curves in found.items():
            plain, _, axes = strategy.partition(" ")
            run = f"{simulation} {lacking} {robot} {seed} {strategy} {budget} {initial}"
            made = partial(_curve_of, case, axes or "all", plain, budget, initial)
            curves.append(kept(run.replace(" ", "_"), made))
    return found


def _curve_of(case: Callable, axes: str, strategy: str, budget: int, initial: int) -> Curve:
    return curve(case(axes), strategy, budget, initial)


@pytest.fixture(scope="module", params=["updated", "frozen"])
def runs(request, tmp_path_factory) -> tuple[str, dict[str, list[Curve]]]:
    strategies = (BASELINE, DEFAULT, *MORE)
    return request.param, played(request.param, tmp_path_factory.mktemp("cases"), strategies)


def reached(curves: list[Curve], goal: str) -> np.ndarray:
    """(runs, 2) measurements and minutes to a goal of GOALS."""
    return np.array([GOALS[goal](c) for c in curves])


def test_the_default_beside_a_frozen_simulation_on_a_latin_hypercube(tmp_path):
    """What `planner next` does unless told otherwise, and AR1 on maximin LHS."""
    ours = played("updated", tmp_path, (DEFAULT,))[DEFAULT]
    theirs = played("frozen", tmp_path, (BASELINE,))[BASELINE]
    for goal in GOALS:
        own, other = reached(ours, goal), reached(theirs, goal)
        n, minutes = np.median(own, axis=0)
        n_other, minutes_other = np.median(other, axis=0)
        worse = np.sum(own[:, 0] > other[:, 0])
        print(
            f"\nto {goal}: default {n:g} measurements, {minutes:.1f} min; AR1 + maximin LHS "
            f"{n_other:g}, {minutes_other:.1f} min; more in {worse} of {len(own)} runs"
        )
    own, other = reached(ours, "RMSE 1 %"), reached(theirs, "RMSE 1 %")
    assert np.median(own[:, 0]) <= 0.5 * np.median(other[:, 0])
    assert np.median(own[:, 1]) <= 0.5 * np.median(other[:, 1])


def test_when_it_says_done_it_is(runs):
    """The rule fires (probability ≥ 0.95 that RMSE ≤ 1 %): was it so, at that moment?"""
    simulation, found = runs
    fired, right, early = 0, 0, []
    for c in (c for curves in found.values() for c in curves):
        done = np.flatnonzero(c.reached[2:] >= 0.95)  # not before three measurements
        if len(done):
            fired += 1
            right += int(c.rmse[done[0] + 2] <= 1.0)
            n, _ = c.until(1.0)
            early.append(done[0] + 3 - n)
    late = float(np.median(early)) if early else float("nan")
    print(
        f"\n{simulation}: 'done at 1 %' said in {fired} runs, true in {right}; {late:.0f} "
        f"measurements after it became true (median)"
    )
    assert fired > 0
    assert right >= 0.95 * fired
