"""Does choosing where to measure pay? Strategies × a simulation that learns, or stays, or both.

`pytest -m slow tests/studies/test_acquisitions.py -s` prints the tables. STUDY_ROBOTS (all
three), STUDY_SEEDS (5), STUDY_FIRST (101) and STUDY_LACKING ("floor"; "" for the right physics,
"tilts") make it larger; STUDY_KEPT names a folder that keeps finished runs. Truths are MuJoCo
models with ± 15 % springs, 4 % inertias and noise of EMA's size; errors are those at 60 poses
never measured. Seeds 1-20 were used in development.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from acquisition_cases import ROBOTS, campaign, make
from planner.acquire.designs import NESTED

pytestmark = [pytest.mark.slow, pytest.mark.timeout(0)]
NAMES = os.environ.get("STUDY_ROBOTS", ",".join(ROBOTS)).split(",")
SEEDS = int(os.environ.get("STUDY_SEEDS", "5"))
FIRST = int(os.environ.get("STUDY_FIRST", "101"))
LACKING = os.environ.get("STUDY_LACKING", "floor")
BASELINE = "maximin_lhs"
STRATEGIES = {
    "updated": (
        BASELINE, "integrated_variance", "parameter_information", "mixed",
        "parameter_information best",
    ),
    "frozen": (BASELINE, "integrated_variance", "variance", "integrated_variance best"),
}  # "best": along the axes that tell most per minute, not along all  # fmt: skip
AXES = ("all", "best")
BUDGET = {
    "updated": int(os.environ.get("STUDY_BUDGET", "6")),
    "frozen": int(os.environ.get("STUDY_FROZEN", "14")),
}
INITIAL = {"updated": 0, "frozen": 2}  # poses of the baseline's design with which all begin


@dataclass(frozen=True, eq=False)
class Curve:
    """One campaign: errors, minutes, and what the model foretold after each measurement."""

    rmse: np.ndarray
    worst: np.ndarray
    minutes: np.ndarray
    reached: np.ndarray  # foretold probability that the RMSE is below 1 %
    bound: np.ndarray  # foretold 95 % bound of the RMSE

    def until(self, percent: float) -> tuple[float, float]:
        """Measurements and minutes from which on the RMSE stays below; ∞ beyond the budget."""
        above = np.flatnonzero(self.rmse > percent)
        n = int(above[-1]) + 1 if len(above) else 0
        if n == len(self.rmse):
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
        told = step.model.forecast if step.n >= 3 else None
        reached, bound = (told.reached, told.bound_percent) if told else (0.0, np.inf)
        rows.append((step.rmse_percent, step.worst_percent, step.minutes, reached, bound))
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


@pytest.fixture(scope="module", params=["updated", "frozen"])
def runs(request, tmp_path_factory) -> tuple[str, dict[str, list[Curve]]]:
    simulation, folder = request.param, tmp_path_factory.mktemp("cases")
    found: dict[str, list[Curve]] = {s: [] for s in STRATEGIES[simulation]}
    budget, initial = BUDGET[simulation], INITIAL[simulation]
    for seed in range(FIRST, FIRST + SEEDS):
        for name in NAMES:
            place = folder / f"{name}{seed}"
            cases = {a: make(name, seed, simulation, place / a, LACKING, a) for a in AXES}
            for strategy, curves in found.items():
                plain, _, axes = strategy.partition(" ")
                case = cases[axes or "all"]
                run = f"{simulation} {LACKING} {name} {seed} {strategy} {budget} {initial}"
                made = partial(curve, case, plain, budget, initial)
                curves.append(kept(run.replace(" ", "_"), made))
    return simulation, found


def saving(ours: np.ndarray, theirs: np.ndarray) -> str:
    """One less the ratio of medians in %, with a 95 % bootstrap interval over paired runs.

    What was not reached counts as if reached just beyond the budget.
    """
    rng = np.random.default_rng(0)
    picks = rng.integers(0, len(ours), (2000, len(ours)))
    beyond = 1.05 * np.max(np.concatenate([ours, theirs]), where=np.isfinite(
        np.concatenate([ours, theirs])), initial=0.0)  # fmt: skip
    ours, theirs = (np.where(np.isfinite(v), v, beyond) for v in (ours, theirs))
    if not beyond:
        return "not to be said"
    ratios = np.median(ours[picks], axis=1) / np.median(theirs[picks], axis=1)
    low, middle, high = np.quantile(100 * (1 - ratios), [0.025, 0.5, 0.975])
    return f"{middle:+.0f} % [{low:+.0f}, {high:+.0f}]"


def test_measurements_to_the_target(runs):
    simulation, found = runs
    base = found[BASELINE]
    count = len(base)
    print(f"\n{simulation} simulation that lacks '{LACKING}', {count} runs a strategy, RMSE in %")
    hits = range(1, BUDGET[simulation] + 1)
    for strategy, curves in found.items():
        middle = np.median([c.rmse for c in curves], axis=0)
        print(f"  {strategy:22s}" + " ".join(f"{v:5.2f}" for v in middle) + f"  after {hits}")
    for percent in (1.0, 0.5):
        print(f"  to {percent} %: median measurements, minutes; reached; saving against {BASELINE}")
        at = np.array([c.until(percent) for c in base])
        for strategy, curves in found.items():
            own = np.array([c.until(percent) for c in curves])
            n, minutes = np.median(own, axis=0)
            print(
                f"    {strategy:22s}{n:5.1f} {minutes:6.1f}  {np.isfinite(own[:, 0]).sum()}/{count}"
                f"  measurements {saving(own[:, 0], at[:, 0])}, minutes "
                f"{saving(own[:, 1], at[:, 1])}"
            )
    print("  worst error in % after 4: median, and saving")
    at = np.array([c.worst[3] for c in base])
    for strategy, curves in found.items():
        own = np.array([c.worst[3] for c in curves])
        print(f"    {strategy:22s}{np.median(own):6.2f}  {saving(own, at)}")
    for curves in found.values():
        assert all(np.isfinite(c.rmse).all() for c in curves)


def test_when_it_says_done_it_is(runs):
    """The rule fires (probability ≥ 0.95 that RMSE ≤ 1 %): was it so, at that moment?"""
    simulation, found = runs
    fired, right, early = 0, 0, []
    inside, steps = 0, 0
    for curves in found.values():
        for c in curves:
            inside += int(np.sum(c.rmse[2:] <= c.bound[2:]))
            steps += len(c.rmse) - 2
            done = np.flatnonzero(c.reached[2:] >= 0.95)  # not before three measurements
            if len(done):
                fired += 1
                right += int(c.rmse[done[0] + 2] <= 1.0)
                n, _ = c.until(1.0)
                early.append(done[0] + 3 - n)
    late = float(np.median(early)) if early else float("nan")
    total = sum(len(c) for c in found.values())
    print(
        f"\n{simulation}: 'done at 1 %' said in {fired} of {total} runs, true in {right}; "
        f"{late:.0f} measurements after it became true (median); "
        f"RMSE within its 95 % bound in {100 * inside / max(steps, 1):.0f} % of {steps} forecasts"
    )
    assert right >= 0.95 * fired
