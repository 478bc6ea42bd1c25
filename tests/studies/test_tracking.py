"""Labels of modes identified from simulated hits on true robots (MuJoCo), and who they are.

Ways are random and smooth. `pytest -m slow tests/studies/test_tracking.py -s` prints the share of
right labels, and how far their certainty holds.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, permutations
from pathlib import Path

import numpy as np
import pytest

from planner.campaign.cell import Cell
from planner.campaign.config import load_campaign_config
from planner.demo import NAME, shipped
from planner.dynamics.mode_families import Families
from planner.dynamics.simulation import Simulation
from planner.modal.modes import Mode
from planner.modal.tracking import Guide, Tracks, track
from planner.proof.arms import KR10
from planner.proof.deviation import Deviation, Spring
from planner.proof.load import load_truth
from planner.proof.model import Truth
from planner.robot.robot import Robot
from tests.support.true_modes import Measured, measure_all, undamped

pytestmark = [pytest.mark.slow, pytest.mark.timeout(3600)]
COUNT, ABOVE, POSES = 4, 2, 60
CAMPAIGN = shipped(NAME)
SOFT_FLOOR = (
    Spring("base", (1.0, 0.0, 0.0), 2.2e7, 1.8e4),
    Spring("base", (0.0, 1.0, 0.0), 1.9e7, 1.6e4),
)
SMALL_SOFT_FLOOR = (
    Spring("base", (1.0, 0.0, 0.0), 4e5, 1.5e2),
    Spring("base", (0.0, 1.0, 0.0), 5e5, 1.5e2),
)
LOW_DEG, HIGH_DEG = (-60, -110, 40, -60, 20, -90), (60, -40, 120, 60, 80, 90)
STATED = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0 + 1e-9)


@dataclass(frozen=True, eq=False)
class Way:
    """A simulation's folder, the true robot, and poses (n, 6) in rad on a way through 4 poses."""

    toml: Path
    truth: Truth
    q: np.ndarray
    band_hz: tuple[float, float]

    @property
    def x(self) -> np.ndarray:
        """Poses scaled to the span of the way."""
        span = np.ptp(self.q, axis=0)
        return ((self.q - self.q.min(axis=0)) / np.where(span > 0, span, 1.0))[:, span > 0]


def through(turning_rad: np.ndarray, count: int) -> np.ndarray:
    """Poses (count, 6) on straight lines between turning points."""
    t, at = np.linspace(0, 1, count), np.linspace(0, 1, len(turning_rad))
    return np.stack([np.interp(t, at, angles) for angles in turning_rad.T], axis=1)


def random_kr10(seed: int, count: int, directory: Path) -> Way:
    """Between four random poses of all six joints; the truth stands on a soft floor."""
    rng = np.random.default_rng([seed, 77])
    turning = np.deg2rad(rng.uniform(LOW_DEG, HIGH_DEG, (4, 6)))
    toml = KR10.write(directory, 2)
    truth = load_truth(toml, Deviation(seed, 0.12, 0.15, 0.04, 0.005, extra=SMALL_SOFT_FLOOR))
    return Way(toml, truth, through(turning, count), KR10.band_hz)


def random_kr240(seed: int, count: int) -> Way:
    """Between four random candidates of the shipped campaign."""
    rng = np.random.default_rng([seed, 77])
    toml = CAMPAIGN / "robot" / "robot.toml"
    cell = Cell.load(toml, load_campaign_config(CAMPAIGN / "campaign.toml"))
    candidates = cell.candidates.q
    turning = candidates[rng.choice(len(candidates), 4, replace=False)]
    truth = load_truth(toml, Deviation(seed, 0.12, 0.15, 0.04, 0.005, extra=SOFT_FLOOR))
    return Way(toml, truth, through(turning, count), cell.config.modes.band_hz)


def nearly_symmetric_kr10(seed: int, directory: Path) -> Way:
    """In the plane of an arm that is its mirror image but for a share: modes cross or nearly do."""
    share, com_m = ((0.0, 0.0), (0.1, 0.0005), (0.3, 0.002), (1.0, 0.005))[seed % 4]
    bodies = tuple(
        replace(
            body,
            com=(body.com[0], body.com[1] * share, body.com[2]),
            rpy=tuple(share * angle for angle in body.rpy),
        )
        for body in KR10.bodies
    )
    turning = np.random.default_rng([seed, 79]).uniform(LOW_DEG, HIGH_DEG, (4, 6))
    turning[:, [3, 5]] = 0.0
    toml = replace(KR10, bodies=bodies).write(directory, 2)
    truth = load_truth(toml, Deviation(seed, 0.12, 0.15, 0.04 if com_m else 0.0, com_m))
    poses = through(np.deg2rad(turning), (60, 30, 90)[seed % 3])
    return Way(toml, truth, poses, KR10.band_hz)


def scattered_modes(way: Way, count: int, rng: np.random.Generator) -> Measured:
    """The truth's own modes with the scatter of good measurements, in place of hits."""
    place = Families(way.q[0], way.q, lambda q: undamped(way.truth, q)).places(way.q)[:, :count]
    modes, true_hz = [], []
    for i, q in enumerate(way.q):
        frequency, damping, residues = way.truth.modes(q, count + 4)
        row = [
            _scattered(*values, rng) for values in zip(frequency, damping, residues, strict=True)
        ]
        modes.append(row)
        true_hz.append(frequency[place[i]])
    order = [np.argsort([mode.frequency_hz for mode in row]) for row in modes]
    partner = np.array([np.argsort(o)[p] for o, p in zip(order, place, strict=True)])
    found = tuple(tuple(row[j] for j in o) for row, o in zip(modes, order, strict=True))
    return Measured(found, place, np.array(true_hz), partner)


def _scattered(
    frequency_hz: float, damping: float, residue: np.ndarray, rng: np.random.Generator
) -> Mode:
    shape = np.linalg.svd(residue)[0][:, 0]
    shape = shape * np.exp(-1j * np.angle(shape[np.argmax(np.abs(shape))]))
    shape = shape + 0.03 * (rng.normal(size=3) + 1j * rng.normal(size=3)) / np.sqrt(2)
    nothing = np.full((3, 3), np.nan)
    sd = 1e-3 * frequency_hz
    return Mode(
        frequency_hz + sd * rng.normal(), sd, damping * np.exp(0.1 * rng.normal()), 0.1 * damping,
        nothing, nothing, shape / np.linalg.norm(shape), 0.95,
    )  # fmt: skip


def right(measured: Measured, tracks: Tracks) -> np.ndarray:
    """(n, k): the label carries the mode of its true family, or none where that was not found."""
    return _right(measured, tracks, tuple(range(measured.partner.shape[1])))


def right_renamed(measured: Measured, tracks: Tracks) -> np.ndarray:
    """The same, entries by label, after the one renaming of all labels that suits best."""
    count = measured.partner.shape[1]
    cases = [_right(measured, tracks, names) for names in permutations(range(count))]
    return max(cases, key=lambda case: case.sum())


def _right(measured: Measured, tracks: Tracks, names: tuple[int, ...]) -> np.ndarray:
    """`names[k]` is the true family that label k is said to be."""
    out = np.zeros(measured.partner.shape, bool)
    for i, k in np.ndindex(*out.shape):
        j = measured.partner[i, names[k]]
        out[i, k] = tracks.modes[i][k] is (measured.modes[i][j] if j >= 0 else None)
    return out


def reliability(stated: np.ndarray, correct: np.ndarray) -> tuple[float, str]:
    """Expected calibration error (Naeini et al. 2015) of probabilities (m,), and its table."""
    error, lines = 0.0, ["  stated        labels  mean stated  right"]
    for low, high in pairwise(STATED):
        inside = (stated >= low) & (stated < high)
        if not inside.any():
            continue
        said, true = stated[inside].mean(), correct[inside].mean()
        error += inside.mean() * abs(said - true)
        lines.append(f"  {low:.2f} to {high:.2f}  {inside.sum():6d}     {said:.3f}      {true:.3f}")
    return float(error), "\n".join(lines)


def exchanges(place: np.ndarray) -> int:
    """Between how many neighbours on the way families (n, k) exchange their order."""
    return int(np.sum(np.any(np.diff(place, axis=0) != 0, axis=1)))


def hidden_modes(cases: Sequence[Measured]) -> int:
    """True modes that were not found."""
    return sum(int(np.sum(case.partner < 0)) for case in cases)


def followed(simulation: Simulation, q: np.ndarray) -> Guide:
    """The simulation's families from the first pose on."""
    modes = simulation.followed(q, COUNT + ABOVE, simulation.families(q[0], q))
    return Guide(modes.frequency_hz, modes.shape)


def hide(measured: Measured, rng: np.random.Generator) -> Measured:
    """The same with one of the tracked modes not found at every third pose."""
    modes, partner = list(measured.modes), measured.partner.copy()
    for i in range(0, len(modes), 3):
        k = int(rng.integers(partner.shape[1]))
        j = partner[i, k]
        modes[i] = tuple(m for n, m in enumerate(modes[i]) if n != j)
        partner[i] = np.where(partner[i] > j, partner[i] - 1, partner[i])
        partner[i, k] = -1
    return Measured(tuple(modes), measured.place, measured.true_hz, partner)


def show(name: str, cases: Sequence[Measured], tracks: Sequence[Tracks]) -> tuple[float, float]:
    """Prints how many labels are right and how sure they were; returns the share and the ECE."""
    plain = np.concatenate([right(*case) for case in zip(cases, tracks, strict=True)])
    best = np.concatenate([right_renamed(*case) for case in zip(cases, tracks, strict=True)])
    stated = np.concatenate([t.probability[:, :COUNT] for t in tracks])
    error, table = reliability(stated.ravel(), best.ravel())
    unnamed = reliability(stated.ravel(), plain.ravel())[0]
    crossed = sum(exchanges(case.place) for case in cases)
    print(
        f"\n{name}, {len(cases)} ways, {best.size} labels ({hidden_modes(cases)} modes not found, "
        f"{crossed} exchanges of order): {100 * best.mean():.2f} % right up to one renaming a way "
        f"(ECE {error:.3f}), {100 * plain.mean():.2f} % as named (ECE {unnamed:.3f})\n{table}"
    )
    return float(best.mean()), error


def tracked(way: Way, measured: Measured) -> Tracks:
    return track(measured.modes, followed(Simulation(Robot.load(way.toml)), way.q), way.x)


def prove(name: str, ways: Sequence[Way], cases: Sequence[Measured]) -> None:
    for what, seen in (
        ("as measured", cases),
        ("every third pose with a hidden mode", hidden(cases)),
    ):
        tracks = [tracked(way, case) for way, case in zip(ways, seen, strict=True)]
        share, error = show(f"{name}, {what}", seen, tracks)
        assert share >= 0.97
        assert error <= 0.07


def hidden(cases: Sequence[Measured]) -> list[Measured]:
    return [hide(case, np.random.default_rng(i)) for i, case in enumerate(cases)]


@pytest.mark.parametrize("robot", ["KR240", "KR10"])
def test_labels_and_their_certainty_on_random_ways(robot, tmp_path):
    """Truth seeds that nothing was fitted to; true families in steps of 0.02 rad on the way."""
    seeds = range(200, 216)
    ways = [
        random_kr240(s, POSES) if robot == "KR240" else random_kr10(s, POSES, tmp_path / str(s))
        for s in seeds
    ]
    cases = [measure_all(way.truth, way.q, way.band_hz, COUNT, way.q[0]) for way in ways]
    prove(robot, ways, cases)


def test_certainty_where_modes_cross_or_nearly_do(tmp_path):
    """Whether they do cannot always be seen: then the labels beyond must say so."""
    cases, tracks = [], []
    for seed in range(200, 260):
        way = nearly_symmetric_kr10(seed, tmp_path / str(seed))
        cases.append(scattered_modes(way, COUNT, np.random.default_rng([seed, 80])))
        tracks.append(tracked(way, cases[-1]))
    share, error = show("nearly symmetric KR10", cases, tracks)
    assert sum(exchanges(case.place) for case in cases) >= 5
    assert share >= 0.9
    assert error <= 0.07
