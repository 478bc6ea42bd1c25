"""500 of each fault that a hand or a chain makes, on MuJoCo's robots: found, and good hits kept."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.recording.records import Hit
from planner.recording.repeats import screen_repeats
from planner.recording.screening import ScreeningLimits, screen
from planner.truth.deviation import Deviation
from planner.truth.load import load_truth
from tests.support.faulty_hits import FAULTS, Scene
from tests.support.robots import JOINTS_DEG, make_arm

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
LARGE = np.array([[-60, 60], [-110, -40], [40, 120], [-40, 40], [-80, 80], [-60, 60]])
FOUND, REFUSED = 0.97, 0.01  # at least, of each fault; at most, of good hits


def places(folder: Path) -> list[tuple[Path, np.ndarray, tuple[float, float]]]:
    """Robots with ranges of their joints and bands."""
    return [
        (make_arm(folder / "arm"), np.array(JOINTS_DEG), (5.0, 110.0)),
        (CAMPAIGNS / "kr240_busch2022" / "robot" / "robot.toml", LARGE, (4.0, 60.0)),
        (CAMPAIGNS / "kr240_plane" / "robot" / "robot.toml", LARGE, (4.0, 60.0)),
        (CAMPAIGNS / "kr10_birk2025" / "robot" / "robot_12p.toml", LARGE, (10.0, 150.0)),
    ]


def refused(hits: tuple[Hit, ...], band_hz: tuple[float, float]) -> list[str]:
    """Kind of the fault of each hit, empty for a good one, as an import judges them."""
    limits = replace(ScreeningLimits(), band_hz=band_hz)
    kinds = [next((f.kind for f in screen(hit, limits) if f.refuse), "") for hit in hits]
    good = [i for i, kind in enumerate(kinds) if not kind]
    for i, faults in zip(good, screen_repeats(tuple(hits[i] for i in good), band_hz), strict=True):
        kinds[i] = next((f.kind for f in faults if f.refuse), "")
    return kinds


def tried(folder: Path, count: int, seed: int) -> tuple[Counter[str], Counter[str], int]:
    """Faults found, good hits refused (alone: "", beside a fault: its name), and good hits."""
    robots = [
        (load_truth(path, Deviation(seed=s, stiffness=0.12, damping=0.1, inertia=0.04)), *more)
        for path, *more in places(folder)
        for s in range(3)
    ]
    found, lost, good = Counter[str](), Counter[str](), 0
    for k in range(count):
        truth, limits, band = robots[k % len(robots)]
        scene = Scene.draw(truth, limits, band, [seed, k])
        group = scene.group()
        good += len(group)
        lost[""] += sum(map(bool, refused(scene.recorded(group), band)))
        for name, make in FAULTS.items():
            i = int(scene.rng.integers(len(group)))
            hits = [*group[:i], make(scene, group[i]), *group[i + 1 :]]
            kinds = refused(scene.recorded(hits), band)
            found[name] += bool(kinds[i])
            lost[name] += sum(bool(kind) for j, kind in enumerate(kinds) if j != i)
    return found, lost, good


def test_faults_are_found_and_good_hits_are_kept(tmp_path):
    found, lost, _ = tried(tmp_path, 4, seed=1)
    assert lost[""] == 0
    assert {name: found[name] for name in FAULTS if found[name] < 3} == {}


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_500_of_each_fault(tmp_path):
    count = 500
    found, lost, good = tried(tmp_path, count, seed=4)
    lines = [f"good hits refused {lost['']} of {good}"]
    lines += [
        f"{name}: found {found[name]} of {count}; good ones beside it refused {lost[name]} of "
        f"{good - count}"
        for name in FAULTS
    ]
    print("\n" + "\n".join(lines))
    assert all(found[name] >= FOUND * count for name in FAULTS)
    assert lost[""] <= REFUSED * good
    assert all(lost[name] <= REFUSED * (good - count) for name in FAULTS)
