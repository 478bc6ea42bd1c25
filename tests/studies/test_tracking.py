"""Labels of modes identified from simulated hits on true robots (MuJoCo), and who they are.

`pytest -m slow tests/studies/test_tracking.py -s` prints the share of right labels.
"""

from collections.abc import Sequence

import numpy as np
import pytest

from planner.dynamics.simulation import Simulation
from planner.modal.tracking import Guide, Tracks, track
from planner.robot.robot import Robot
from tests.support.random_ways import (
    Way,
    exchanges,
    hidden_modes,
    nearly_symmetric_kr10,
    random_kr10,
    random_kr240,
    reliability,
    right,
    right_renamed,
    scattered_modes,
)
from tests.support.true_modes import Measured, measure_all

pytestmark = [pytest.mark.slow, pytest.mark.timeout(3600)]
COUNT, ABOVE, POSES = 4, 2, 60


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
