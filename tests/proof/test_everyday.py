"""Cases of real cells: imperfections are small, and every effect can have any size.

`pytest -m slow tests/proof/test_everyday.py` draws the other effects.
"""

import json
from dataclasses import replace

import numpy as np
import pytest

from planner.proof import cases
from planner.proof.arms import ARMS, in_a_cell
from planner.proof.cases import SCATTER, make_case
from planner.proof.detectability import without_effect
from planner.proof.fault_injection import InjectedFaults
from planner.proof.imperfections import imperfect
from planner.proof.load import load_truth
from planner.proof.nonlinear import HitPose, respond
from planner.proof.scene import Scene
from planner.proof.table import OUT_OF_LIBRARY_KINDS, TABLE, drawn

STEP_S, N = 1 / 3200, 240
EXACTLY = np.eye(6)  # wrenches of hits exactly along an axis of the tcp, and at it


def scene_of(robot: str, folder, seed: int = 1):
    """A scene with an imperfect robot, and where its robot.toml is."""
    arm, rng = in_a_cell(robot), np.random.default_rng(seed)
    path, plain = arm.write(folder), InjectedFaults(replace(SCATTER, seed=seed))
    truth = load_truth(path, plain.deviation)
    scene = Scene(arm, truth, 1, arm.poses(3), arm.peak_n, plain, rng)
    injected, _ = imperfect(scene)
    return replace(scene, truth=load_truth(path, injected.deviation), injected=injected), path


def drawn_in(scene: Scene, name: str, size: float = 1.0, seed: int = 3):
    """An effect of some size beside what is concealed in a scene."""
    return drawn(name, replace(scene, size=size, rng=np.random.default_rng(seed)))


def heard(scene: Scene, injected: InjectedFaults, path, progress: float = 1.0) -> np.ndarray:
    """(3, 3, n): how three hits move the sensor at first, as speeds in m/s."""
    truth = injected.at(load_truth(path, injected.deviation), progress)
    t = np.arange(N) * STEP_S
    force = scene.peak_n * np.sin(np.pi * np.clip(t / 0.008, 0, 1)) ** 2
    pose = HitPose(truth, scene.poses[0], np.tile(force, (3, 1)), EXACTLY[[0, 1, 2]])
    return STEP_S * np.cumsum(respond([pose], injected.ports, STEP_S)[0], axis=2)


def test_there_are_outsiders_of_many_kinds_and_mixed_damping_is_no_effect():
    assert len(OUT_OF_LIBRARY_KINDS) >= 8
    assert "structural_damping" not in TABLE


@pytest.mark.parametrize("robot", sorted(ARMS))
def test_imperfections_are_everywhere_and_small(robot, tmp_path):
    scene, path = scene_of(robot, tmp_path)
    injected = scene.injected
    assert {port.joint for port in injected.ports} == {f"joint_{n}" for n in range(1, 7)}
    plain = replace(injected.deviation, beams=(), compensators=(), harmonics=(), extra=())
    ours = scene.truth.modes(scene.poses[0], 2)[0]
    without = load_truth(path, plain).modes(scene.poses[0], 2)[0]
    change = np.abs(ours / without - 1)
    assert 0 < np.max(change) < 0.08
    assert np.all(scene.truth.poles(scene.poses[0])[0].real < 0)


CHANNELS = (
    "sensor_rotation", "sensor_gain", "polarity", "channel_delay", "exponential_window",
    "tonal_disturbance",
)  # fmt: skip
QUICK = *CHANNELS, "added_mass", "base_compliance", "friction", "drift", "rattling_part"


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in TABLE]
)
def test_every_effect_does_something_and_goes_with_its_size(name, tmp_path):
    scene, path = scene_of("kr210", tmp_path)
    injected = scene.injected
    if name in CHANNELS:
        small, large = (drawn_in(scene, name, size).injected for size in (0.01, 1.0))
        assert small != injected
        assert small != large or name == "polarity"
        return
    plain = heard(scene, injected, path)
    changes = []
    for size in (0.01, 1.0):
        one = drawn_in(scene, name, size)
        json.dumps(one.parameters)
        changes.append(np.linalg.norm(heard(scene, one.injected, path) - plain))
        left = without_effect(one.injected, injected, one.injected)
        assert np.linalg.norm(heard(scene, left, path) - plain) < 1e-6 * changes[0]
    assert 0 < changes[0] < 0.2 * changes[1]
    assert changes[0] < 0.15 * np.linalg.norm(plain)  # a base's long lever is the most


def test_what_changes_with_time_is_what_gives_or_what_is_carried(tmp_path):
    """A joint that grows softer, or another tool: half-way through both differ from before."""
    scene, path = scene_of("kr210", tmp_path)
    injected = scene.injected
    drifts = [drawn_in(scene, "drift", seed=n) for n in range(12)]
    assert {(d.effect, d.at) for d in drifts} == {("drift", "campaign")}
    tools = [d for d in drifts if d.injected.load is not None]
    assert 0 < len(tools) < len(drifts)
    assert all("load_factor" in d.parameters for d in tools)
    for one in (tools[0], next(d for d in drifts if d.injected.load is None)):
        early, late = (heard(scene, one.injected, path, progress) for progress in (0.0, 1.0))
        assert np.linalg.norm(late - early) > 1e-4 * np.linalg.norm(early)
    [without] = {without_effect(d.injected, injected, d.injected).load for d in tools}
    assert without is None


def test_a_case_says_what_it_should_and_hides_the_rest(tmp_path, monkeypatch):
    monkeypatch.setattr(cases, "POSES", 2)
    monkeypatch.setattr(cases, "PREDICTED", 1)
    made = make_case("friction", "kr210", 2, tmp_path)
    [effect] = made.concealed
    assert effect.effect == "friction"
    assert effect.parameters["law"] in ("Friction", "BoucWen", "Iwan", "LuGre")
    assert 0.03 <= effect.size <= 1
    assert ("drift", "campaign") in made.imperfections
    text = b"".join(p.read_bytes() for p in tmp_path.rglob("*") if p.is_file())
    assert not [w for w in (b"friction", b"rumble", b"nats", b"MuJoCo") if w in text]
