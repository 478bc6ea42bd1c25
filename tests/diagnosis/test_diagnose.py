"""Diagnoses of small cells from the other engine: what they say, and in which form.

`pytest -m slow tests/diagnosis/test_diagnose.py` conceals all effects one after the other, and lets
all rounds look for what nothing describes.
"""

import json
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner import Dataset, Robot, diagnose
from planner.proof.deviation import (
    AttachedMass,
    AttachedResonator,
    BentLink,
    Deviation,
    Feedback,
    StiffnessRipple,
    soft_floor,
)
from planner.proof.fault_injection import Artefact, InjectedFaults, JointDrift
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.proof.measurement_errors import EVERYDAY, LABORATORY, MeasurementErrors
from planner.proof.recordings import write_predict
from tests.support.arm_with_points import NODES, poses, write_arm
from tests.support.outside import call, told
from tests.support.struck_poses import record_by_hand

# Springs, dampers and bodies never are as stated; nobody is to call that a finding.
SCATTER = Deviation(5, stiffness=0.1, damping=0.15, inertia=0.03, com_m=0.003)
POSES, SEED, TCP_NODE = 5, 1, 17
HAMMER = Hammer(peak_n=250.0, noise=0.004)
BASE = {"x": 1.4e6, "y": 1.1e6}  # N·m/rad
SOFT = soft_floor(*BASE.values())
TURNED = Rotation.from_euler("zyx", [15.0, -10.0, 5.0], degrees=True).as_matrix()
GAIN, WINDOW_S, HOSE_HZ, HOSE_KG, MASS_KG = 0.7, 0.5, 21.0, 3.0, 25.0
DRIFT = JointDrift((("", -0.15, "linear"),))


BENT = BentLink("l2", (1.6e6, 2e6), 1.6e6, 3e-4)
HOSE = AttachedResonator("l3", (0.1, 0.1, 0), (0, 0.6, 0.8), HOSE_KG, HOSE_HZ, 0.03)
MASS = AttachedMass("l3", (0.2, 0.15, 0.1), MASS_KG)
RIPPLE = StiffnessRipple("a2", 2, 0.35, 0.2)
BREAKING = Feedback(driven="a2", sensed="a3", gain=2e5)  # reciprocity, as only a controller can
QUIET = {"artefact": Artefact(gain=(1.0, GAIN, 1.0))}
# The effects and their places, how the robot differs from SCATTER, and how it is measured.
CONCEALED: dict[str, tuple[set[tuple[str, str]], dict[str, Any], dict[str, Any]]] = {
    "nothing": (set(), {}, {}),
    "soft base": ({("base_compliance", "base")}, {"extra": SOFT}, {}),
    "bending link": ({("link_flexibility", "link_2")}, {"beams": (BENT,)}, {}),
    "added mass": ({("added_mass", "link_3")}, {"added": (MASS,)}, {}),
    "hose": ({("local_resonator", "link_3")}, {"resonators": (HOSE,)}, {}),
    "turned sensor": (
        {("sensor_rotation", "sensor")}, {}, {"artefact": Artefact(rotation=TURNED)}),
    "polarity": ({("polarity", "sensor_z")}, {}, {"artefact": Artefact(gain=(1.0, 1.0, -1.0))}),
    "gain": ({("sensor_gain", "sensor_y")}, {}, QUIET),
    "base and gain": (
        {("base_compliance", "base"), ("sensor_gain", "sensor_y")}, {"extra": SOFT}, QUIET),
    "window": ({("exponential_window", "sensor")}, {}, {"artefact": Artefact(window_s=WINDOW_S)}),
    "drift": ({("drift", "campaign")}, {}, {"drift": DRIFT}),
    "angle": ({("angle_dependent_stiffness", "joint_2")}, {"harmonics": (RIPPLE,)}, {}),
    "outsider": ({("unknown", "")}, {"feedback": (BREAKING,)}, {}),
}  # fmt: skip


def small_case(
    folder: Path, name: str, errors: MeasurementErrors = LABORATORY
) -> tuple[Path, Path, Path]:
    """An arm of four joints with one of CONCEALED, hit once along each axis at a few poses.

    robot.toml, the folder of recordings, and a table of a pose whose FRFs may be asked for.
    """
    tcp = f'[[point]]\nname = "tcp"\nnode = {TCP_NODE}\n'
    robot_toml, q = write_arm(folder / "robot", tcp), poses(POSES + 1, SEED)
    own = np.random.default_rng(SEED)
    _, change, measured = CONCEALED[name]
    injected = InjectedFaults(replace(SCATTER, **change), chain=errors.chain(own), **measured)
    truth, folder = load_truth(robot_toml, injected.deviation), folder / "recordings"
    hit = [(f"P{i}", row) for i, row in enumerate(np.rad2deg(q[:POSES]), 1)]
    record_by_hand(folder, truth, injected, errors, hit, ("+x", "+y", "+z"), HAMMER, own,
                   noise=np.random.default_rng(SEED), nodes=NODES | {"tcp": TCP_NODE})  # fmt: skip
    unused = [("H1", q[POSES])]
    return robot_toml, folder, write_predict(folder, truth.joint_names, unused)


# The others have tests of their own; a gain is concealed beside a soft base, too.
NAMES = [n for n in CONCEALED if n not in ("nothing", "outsider", "soft base", "gain", "window")]
QUICK = ("drift",)  # of the campaign; of the robot "soft base", of its sensor "window" are below


def diagnosed(case: tuple[Path, ...], *options: object) -> dict[str, Any]:
    """The answer of a command that ends with exit code 0, in the form that was promised."""
    robot, recordings, _ = case
    answer = told("diagnose", recordings, "--robot", robot, *options)
    assert set(answer) >= {
        "verdict", "findings", "candidates", "sets", "where", "fit", "held_out", "npz", "shares",
        "remarks", "refused", "simulated", "next", "next_sensor", "robot", "plots", "seconds",
    }  # fmt: skip
    for finding in answer["findings"]:
        assert set(finding) == {
            "effect", "at", "probability", "change_percent", "parameters", "text",
        }  # fmt: skip
        for parameter in finding["parameters"].values():
            assert set(parameter) == {"value", "sd", "unit"}
        assert len(finding["text"].split()) > 8
    assert all(set(c) == {"effect", "at", "probability", "effects"} for c in answer["candidates"])
    shares = [c["probability"] for c in answer["candidates"]]
    assert shares == sorted(shares, reverse=True)
    assert sum(shares) == pytest.approx(1.0)
    assert ("unknown", None) in [(c["effect"], c["at"]) for c in answer["candidates"]]
    where = answer["where"]
    assert all(low < high for low, high in where["bands_hz"])
    assert set(where["poses"]) <= {f"P{i + 1}" for i in range(POSES)}
    assert set(where["directions"]) <= set("xyz")
    assert set(answer["shares"]) == {"stated", "refitted", "explained", "left"}
    for agreement in (answer["fit"], answer["held_out"]):
        for stage in ("nominal", "refitted", "explained"):
            assert set(agreement[stage]) == {"frac", "frobenius"}
    assert len(answer["held_out"]["poses"]) == 1
    return answer


def places(answer: dict[str, Any]) -> set[tuple[str, str]]:
    """What was found, and where."""
    return {(f["effect"], f["at"]) for f in answer["findings"]}


@pytest.mark.parametrize(
    "errors", [pytest.param(LABORATORY, marks=pytest.mark.slow), EVERYDAY], ids=["exact", "usual"]
)
def test_where_nothing_is_concealed_nothing_is_found(tmp_path, errors):
    answer = diagnosed(small_case(tmp_path, "nothing", errors))
    assert answer["verdict"] == "consistent"
    assert answer["findings"] == []
    assert answer["candidates"][0]["effect"] == "none"
    assert answer["held_out"]["refitted"]["frac"] > 0.99
    assert answer["npz"] is None
    assert answer["next"] is None


TRUE = {
    "soft base": {f"stiffness of base about {a}": k for a, k in BASE.items()},
    "window": {"time_constant": WINDOW_S},
    "base and gain": {
        **{f"stiffness of base about {a}": k for a, k in BASE.items()},
        "gain": GAIN,
    },
    "added mass": {"mass": MASS_KG},
    "hose": {"frequency": HOSE_HZ, "mass": HOSE_KG},
}


def assert_named_and_sized(answer: dict[str, Any], name: str) -> None:
    there = CONCEALED[name][0]
    assert answer["verdict"] == "explained"
    assert places(answer) == there
    leader = {(e["effect"], e["at"]) for e in answer["candidates"][0]["effects"]}
    assert leader == there
    assert answer["held_out"]["explained"]["frac"] > 0.99
    assert answer["shares"]["left"] < answer["shares"]["refitted"]
    found = {n: v for f in answer["findings"] for n, v in f["parameters"].items()}
    for parameter, true in TRUE.get(name, {}).items():
        value = found[parameter]
        assert value["value"] == pytest.approx(true, abs=4 * value["sd"], rel=0.05)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in NAMES]
)
def test_what_is_concealed_is_named_and_sized(tmp_path, name):
    assert_named_and_sized(diagnosed(small_case(tmp_path, name)), name)


def test_what_no_effect_describes_is_unexplained(tmp_path):
    answer = diagnosed(small_case(tmp_path, "outsider"))
    assert answer["verdict"] == "unexplained"
    assert answer["candidates"][0]["effect"] == "unknown"
    assert answer["findings"] == []
    assert answer["where"]["bands_hz"]


@pytest.mark.slow
def test_the_robot_that_is_written_is_read_back_and_predicts(tmp_path):
    case, out = small_case(tmp_path, "soft base", EVERYDAY), tmp_path / "found"
    robot, recordings, table = case
    answer = diagnosed(case, "--predict", table, "--out", out)
    assert_named_and_sized(answer, "soft base")
    with np.load(answer["npz"]) as file:
        lines, mean = file["frequency_hz"], file["frf_mean"]
        assert mean.shape == file["frf_sd"].shape == (1, 3, 3, lines.size)
        q = np.deg2rad(file["joints_deg"])[0]
    deviation = replace(SCATTER, extra=SOFT)
    true = load_truth(robot, deviation).accelerance(q, lines)
    assert np.linalg.norm(mean[0] - true) < 0.05 * np.linalg.norm(true)
    assert all(Path(plot).is_file() for plot in answer["plots"])
    assert json.loads((out / "diagnosis.json").read_text())["verdict"] == "explained"
    assert told("check", answer["robot"])["ok"]
    again = told("diagnose", recordings, "--robot", answer["robot"])
    assert again["verdict"] == "consistent"
    assert again["fit"]["nominal"]["frac"] == pytest.approx(answer["written"]["frac"], abs=1e-3)
    assert answer["written"]["frac"] > 0.99
    code, _, err = call("diagnose", recordings, "--robot", answer["robot"], "--out", out)
    assert code == 2
    assert "holds the robot that was given" in err


def test_the_function_says_what_the_command_says(tmp_path):
    case = small_case(tmp_path, "window")
    robot = Robot.load(case[0])
    dataset = Dataset.read(case[1], robot, robot.config.band_hz)
    found = diagnose(dataset, robot, offered={"there": dataset.q[0] + 0.1})
    answer = diagnosed(case)
    assert_named_and_sized(answer, "window")
    mine = json.loads(json.dumps(found.to_json()))
    assert mine | {"seconds": 0} == answer | {"seconds": 0}
    mean, sd = found.predict(dataset.q[:2], np.array([5.0, 10.0, 15.0]))
    assert mean.shape == sd.shape == (2, 3, 3, 3)
    assert np.iscomplexobj(mean)
    assert (sd > 0).all()
    light = pickle.loads(pickle.dumps(replace(found, diagnosis=None)))
    assert light.to_json() == found.to_json()
    assert "diagnosis" not in found.to_json()
