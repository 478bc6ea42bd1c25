"""Two engines that share no formula are one robot; robots drawn at random are sound.

`pytest -m slow tests/proof/test_engines.py` makes a whole case twice.
"""

from dataclasses import replace

import numpy as np
import pytest

from planner.proof import cases
from planner.proof.arms import ARMS, in_a_cell
from planner.proof.cases import RANDOM, SCATTER, make_case
from planner.proof.deviation import Deviation, Spring
from planner.proof.fault_injection import InjectedFaults
from planner.proof.imperfections import imperfect
from planner.proof.load import load_truth
from planner.proof.model import Truth
from planner.proof.random_arms import BAND_HZ, LAYOUTS, draw_arm, standing
from planner.proof.scene import Scene
from planner.proof.table import drawn


def same(one: Truth, other: Truth, q: np.ndarray) -> None:
    """Whatever an engine tells of a robot: matrices, frames, and what its links weigh."""
    for a, b in zip(one.matrices(q), other.matrices(q), strict=True):
        assert np.max(np.abs(a - b)) < 1e-7 * max(np.max(np.abs(a)), 1e-12)
    (a, parts), (b, others) = one.frames(q), other.frames(q)
    assert a == pytest.approx(b, abs=1e-9)
    assert list(parts) == list(others)
    for link, part in parts.items():
        assert part == pytest.approx(others[link], abs=1e-9)
    for a, b in zip(one.tcp(q), other.tcp(q), strict=True):
        assert a == pytest.approx(b, abs=1e-12)
    for link, pieces in one.pieces().items():
        for (m, centre, tensor), (n, middle, inertia) in zip(
            pieces, other.pieces()[link], strict=True
        ):
            assert m == n
            assert centre == pytest.approx(middle, abs=1e-9)
            assert tensor == pytest.approx(inertia, rel=1e-6, abs=1e-8)


LACKING = (
    "base_compliance", "added_mass", "rattling_part", "bridging_cable", "link_flexibility",
    "turning_spindle",
)  # fmt: skip


@pytest.mark.parametrize("name", LACKING)
def test_both_engines_are_one_robot_whatever_it_lacks(tmp_path, name):
    arm, rng = in_a_cell("irb6640"), np.random.default_rng(2)
    path, plain = arm.write(tmp_path), InjectedFaults(replace(SCATTER, seed=4))
    scene = Scene(arm, load_truth(path), 1, arm.poses(2), 1e3, plain, rng)
    deviation = drawn(name, replace(scene, injected=imperfect(scene)[0])).injected.deviation
    one, other = (load_truth(path, deviation, engine) for engine in ("mujoco", "tree"))
    same(one, other, scene.poses[1])
    same(one.loaded("spindle", 1.4), other.loaded("spindle", 1.4), scene.poses[1])


def test_both_engines_split_a_link_and_shift_a_base_alike(tmp_path):
    path = ARMS["kr10"].write(tmp_path, 3)
    springs = (
        Spring("link_2", (0.0, 0.0, 1.0), 1e5, 10.0),
        Spring("base", (0.0, 1.0, 0.0), 1e7, 1.0, slide=True),
    )
    both = (load_truth(path, Deviation(7, inertia=0.05, extra=springs), e)
            for e in ("mujoco", "tree"))  # fmt: skip
    same(*both, ARMS["kr10"].poses(1)[0])


@pytest.mark.parametrize("seed", range(3))
def test_robots_drawn_at_random_stand_and_have_modes_in_the_band(tmp_path, seed):
    per_joint, rng = 1 + 2 * (seed % 2), np.random.default_rng(seed)
    arm = draw_arm(rng, tmp_path, per_joint)
    one, other = (load_truth(tmp_path / "robot.toml", engine=e) for e in ("mujoco", "tree"))
    assert arm.name.split("-")[0] in LAYOUTS
    assert len(one.springs) == per_joint * len(arm.joints)
    for q in standing(rng, arm, one, 3):
        same(one, other, q)
        frequency, damping, _ = one.modes(q, 3)
        assert 3 < frequency[0] < 20
        assert frequency[-1] < BAND_HZ[1]
        assert np.all((damping > 0.002) & (damping < 0.2))


@pytest.mark.slow
def test_a_case_of_a_robot_drawn_at_random_is_whole_and_the_same_again(tmp_path, monkeypatch):
    monkeypatch.setattr(cases, "POSES", 2)
    monkeypatch.setattr(cases, "PREDICTED", 1)
    one, two = (make_case("sensor_gain", RANDOM, 7, tmp_path / name) for name in "ab")
    assert [c.effect for c in one.concealed] == ["sensor_gain"]
    assert one.held_out == two.held_out
    folders = [tmp_path / name / "recordings" for name in "ab"]
    tables = [(folder / "recordings.csv").read_bytes() for folder in folders]
    assert tables[0] == tables[1]
    files = list((folders[0] / "data").glob("*.uff"))
    assert len(files) == tables[0].count(b"\n") - 1
