"""Does choosing where to measure pay? Strategies × a simulation that learns, or stays, or both.

`pytest -m slow tests/studies/test_acquisitions.py -s` prints the figures. Truths are MuJoCo models
with ± 15 % springs, 4 % inertias and noise of EMA's size; errors are those at 60 poses never
measured, FRFs' at ten of them. Seeds 1-20 were used in development.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
import pytest

from planner.campaign.build import build, hits_unknown
from planner.campaign.cell import Cell
from planner.campaign.config import CampaignConfig
from planner.campaign.labels import from_mode
from planner.campaign.model import Model
from planner.campaign.proposals import propose
from planner.campaign.state import CampaignState, Measurement
from planner.design.space_filling import NESTED
from planner.frf.frf import Frf
from planner.frf.metrics import agreement
from planner.modal.modes import Mode
from planner.proof.arms import ARMS
from planner.proof.deviation import Deviation, soft_floor
from planner.proof.load import load_truth
from planner.proof.model import Truth

pytestmark = [pytest.mark.slow, pytest.mark.timeout(0)]
# Robot and what its simulation lacks: the floor's tilts, or transverse tilts of the joints too.
CELLS = [(robot, "floor") for robot in ("kr10", "irb6640", "kr210")]
CELLS += [("kr10", "tilts"), ("kr210", "tilts")]
SEEDS = 101, 102
MODES, CANDIDATES, UNUSED, LINES = 4, 200, 60, 160
OF_FRFS = 10  # unused poses at which FRFs are judged
FREQUENCY_SD, DAMPING_SD, FRF_SD = 1e-3, 0.05, 0.02  # relative, the last one to the FRF's rms
BASELINE, DEFAULT = "maximin_lhs", "integrated_variance"
BUDGET = {"updated": 5, "frozen": 12}
INITIAL = {"updated": 0, "frozen": 2}  # poses of the baseline's design with which all begin


@dataclass(frozen=True, eq=False)
class Case:
    """One true robot, what the planner knows of it, and unused poses with true frequencies."""

    truth: Truth
    cell: Cell
    seed: int
    unused: np.ndarray
    true_hz: np.ndarray
    lines_hz: np.ndarray
    true_frf: np.ndarray  # (OF_FRFS, 3, 3, LINES) at the first unused poses

    def measure(self, q: np.ndarray, number: int) -> tuple[Measurement, Frf]:
        """Modes and FRF at q (6,), with noise of its own for every pose."""
        rng, modes = np.random.default_rng([self.seed, number]), []
        for f, z, r in zip(*self.truth.modes(q, MODES), strict=True):
            sd = 0.03 * np.abs(r).max()
            noisy = r + sd * (rng.standard_normal((3, 3)) + 1j * rng.standard_normal((3, 3)))
            shape = np.linalg.svd(noisy)[0][:, 0]
            modes.append(
                Mode(
                    f * np.exp(FREQUENCY_SD * rng.standard_normal()), f * FREQUENCY_SD,
                    z * np.exp(DAMPING_SD * rng.standard_normal()), z * DAMPING_SD,
                    noisy, np.full((3, 3), sd), shape, 1.0,
                )
            )  # fmt: skip
        h = self.truth.accelerance(q, self.lines_hz)
        sd = FRF_SD * np.sqrt(np.mean(np.abs(h) ** 2, axis=(0, 2), keepdims=True))
        noise = rng.standard_normal(h.shape) + 1j * rng.standard_normal(h.shape)
        variance, unknown = np.broadcast_to(sd**2, h.shape), np.full(h.shape, np.nan)
        h, band = h + sd / np.sqrt(2) * noise, self.cell.config.modes.band_hz
        frf = Frf(self.lines_hz, h, variance, unknown, (4, 4, 4), band)
        found = tuple(from_mode(m) for m in modes)
        return Measurement(f"P{number}", tuple(np.rad2deg(q)), (), found), frf


def make(robot: str, seed: int, simulation: str, directory: Path, lacking: str) -> Case:
    """`lacking`: what the simulation has not, "floor" (a soft one) or "tilts" (and the floor)."""
    arm = ARMS[robot]
    full = arm.write(directory / "full", 2)
    toml = arm.write(directory / "robot", 1) if lacking == "tilts" else full
    soft = 25 * max(arm.torsion)
    truth = load_truth(full, Deviation(seed, 0.15, 0.15, 0.04, 0.005, soft_floor(soft, soft)))
    table = {
        "robot": str(toml),
        "workspace": {"joints_deg": [list(r) for r in arm.joints_deg]},
        "modes": {"count": MODES, "band_hz": [arm.band_hz[0], 0.4 * arm.band_hz[1]]},
        "fidelity": {"simulation": simulation},
        "acquisition": {"candidates": CANDIDATES, "hit_axes": "all"},
    }
    cell = Cell.load(toml, msgspec.convert(table, CampaignConfig))
    unused = arm.poses(UNUSED, 10_000 + seed)
    lines_hz = np.linspace(*cell.config.modes.band_hz, LINES)
    true_hz = np.array([truth.modes(q, MODES)[0] for q in unused])
    true_frf = np.array([truth.accelerance(q, lines_hz) for q in unused[:OF_FRFS]])
    return Case(truth, cell, seed, unused, true_hz, lines_hz, true_frf)


def campaign(case: Case, planned: list[int], budget: int) -> Iterator[tuple[Model, float]]:
    """Models after each pose, and minutes so far: first the candidates `planned`, then DEFAULT."""
    candidates = case.cell.candidates
    measurements: dict[str, Measurement] = {}
    frfs: dict[str, Frf] = {}
    hits_of = hits_unknown(frfs)
    minutes, at, model = 0.0, None, None
    for n in range(1, budget + 1):
        if n <= len(planned):
            q = candidates.q[planned[n - 1]]
        else:
            state = CampaignState(measurements=measurements, events=n)
            model = model or build(case.cell, state, hits_of)
            (proposal,) = propose(model, state, 1, DEFAULT)
            q = np.deg2rad(np.array(proposal.joints_deg))
        minutes += float(case.cell.cost.minutes(q[None], at, (0, 1, 2))[0])
        at = q
        measurement, frfs[f"P{n}"] = case.measure(q, n)
        measurements = {**measurements, measurement.pose: measurement}
        model = build(case.cell, CampaignState(measurements=measurements, events=n), hits_of)
        yield model, minutes


@dataclass(frozen=True, eq=False)
class Curve:
    """One campaign: errors, minutes, and what the model foretold after each measurement."""

    rmse: np.ndarray  # of ln f at unused poses, in %
    minutes: np.ndarray
    reached: np.ndarray  # foretold probability that the RMSE is below 1 %
    frac: np.ndarray  # Global FRAC of FRFs at unused poses, the mean over hits and responses

    @classmethod
    def of(cls, case: Case, strategy: str, budget: int, initial: int) -> "Curve":
        """`initial` poses of the baseline's design, then what the strategy says."""
        plan = NESTED[BASELINE](case.cell.candidates.features, budget, case.seed).tolist()
        rows = []
        planned = plan if strategy == BASELINE else plan[:initial]
        for n, (model, minutes) in enumerate(campaign(case, planned, budget), 1):
            found = np.sort(model.predict(case.unused).frequency_hz, axis=1)
            rmse = 100 * float(np.sqrt(np.mean(np.log(found / case.true_hz) ** 2)))
            frf, _ = model.frf(case.unused[:OF_FRFS], case.lines_hz)
            frac = float(np.mean(agreement(case.true_frf, frf).global_frac))
            # The rule does not speak before three measurements.
            rows.append((rmse, minutes, model.forecast.reached if n >= 3 else 0.0, frac))
        return cls(*np.array(rows).T)

    def until(self, good: np.ndarray) -> tuple[float, float]:
        """Measurements and minutes from which on it stays good (n,); ∞ beyond the budget."""
        bad = np.flatnonzero(~good)
        n = int(bad[-1]) + 1 if len(bad) else 0
        return (np.inf, np.inf) if n == len(good) else (n + 1, float(self.minutes[n]))


GOALS: dict[str, Callable[[Curve], tuple[float, float]]] = {
    "RMSE 1 %": lambda c: c.until(c.rmse <= 1.0),
    "RMSE 0.5 %": lambda c: c.until(c.rmse <= 0.5),
    "FRAC 95 %": lambda c: c.until(c.frac >= 0.95),
}


def played(simulation: str, folder: Path, *strategies: str) -> dict[str, list[Curve]]:
    """Curves by strategy, seed by seed and cell by cell."""
    found: dict[str, list[Curve]] = {s: [] for s in strategies}
    for seed in SEEDS:
        for robot, lacking in CELLS:
            case = make(robot, seed, simulation, folder / f"{robot}{seed}{lacking}", lacking)
            for strategy, curves in found.items():
                curves.append(Curve.of(case, strategy, BUDGET[simulation], INITIAL[simulation]))
    return found


def reached(curves: list[Curve], goal: str) -> np.ndarray:
    """(runs, 2) measurements and minutes to a goal of GOALS."""
    return np.array([GOALS[goal](c) for c in curves])


def test_the_default_beside_a_frozen_simulation_on_a_latin_hypercube(tmp_path):
    """What `planner next` does unless told otherwise, and AR1 on maximin LHS."""
    ours = played("updated", tmp_path, DEFAULT)[DEFAULT]
    theirs = played("frozen", tmp_path, BASELINE)[BASELINE]
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


@pytest.mark.parametrize("simulation", ["updated", "frozen"])
def test_when_it_says_done_it_is(simulation, tmp_path):
    """The rule fires (probability ≥ 0.95 that RMSE ≤ 1 %): was it so, at that moment?"""
    fired, right, early = 0, 0, []
    found = played(simulation, tmp_path, BASELINE, DEFAULT)
    for c in (c for curves in found.values() for c in curves):
        done = np.flatnonzero(c.reached[2:] >= 0.95)  # not before three measurements
        if len(done):
            fired += 1
            right += int(c.rmse[done[0] + 2] <= 1.0)
            early.append(done[0] + 3 - GOALS["RMSE 1 %"](c)[0])
    late = float(np.median(early)) if early else float("nan")
    print(
        f"\n{simulation}: 'done at 1 %' said in {fired} runs, true in {right}; {late:.0f} "
        f"measurements after it became true (median)"
    )
    assert fired > 0
    assert right >= 0.95 * fired
