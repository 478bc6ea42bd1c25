"""A campaign by its commands alone, with a measurement set aside and taken back again."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from planner.proof.load import load_truth
from planner.proof.model import Truth
from planner.surrogate.frequency_models import MODELS
from planner.words import with_sd
from tests.support import outside
from tests.support.outside import call, make_cell, record, refused, said, told
from tests.support.robots import JOINTS_DEG

ASKED = np.array(JOINTS_DEG).T * 0.5 + np.mean(JOINTS_DEG, axis=1) * 0.5  # (2, 6) in degrees


def predicted(cell: Path, table: Path) -> np.ndarray:
    """Frequency and sd (pose, mode, 2) in Hz at the poses asked for."""
    poses = told("predict", cell, table)["poses"]
    assert [p["pose"] for p in poses] == ["H1", "H2"]
    return np.array([[[m["frequency_hz"], m["sd_hz"]] for m in p["modes"]] for p in poses])


def measured(cell: Path) -> list[tuple[str, bool]]:
    """Poses in the order of their measurement, and whether they are set aside."""
    return [(m["pose"], m["withdrawn"]) for m in told("status", cell)["measurements"]]


@dataclass(frozen=True)
class Three:
    """A campaign of three poses, and what it predicted after none, two and three of them."""

    cell: Path
    stated: Path
    truth: Truth
    table: Path
    names: list[str]
    after: dict[int, np.ndarray]


@pytest.fixture(scope="module")
def three(tmp_path_factory) -> Three:
    root = tmp_path_factory.mktemp("three")
    robot, campaign_toml, truth = make_cell(root)
    cell, table = root / "cell", root / "predict.csv"
    joints = ",".join(f"joint_a{i}_deg" for i in range(1, 7))
    rows = [f"H{i},{','.join(map(str, q))}" for i, q in enumerate(ASKED, 1)]
    table.write_text("\n".join([f"pose,{joints}", *rows]) + "\n")
    told("new", cell, "--robot", robot, "--campaign", campaign_toml)
    assert measured(cell) == []
    assert told("status", cell)["springs"] == []
    for command in ("next", "status"):  # of nothing measured nothing is forecast
        screen = " ".join(said(command, cell).split())
        assert "is told once two poses are measured" in screen
        assert "RMSE" not in screen
    after, names = {0: predicted(cell, table)}, []
    for number in range(3):
        proposal, report = outside.measured(truth, cell, root / f"export{number}", number)
        names.append(proposal["pose"])
        assert (report["pose"], len(report["accepted"])) == (names[-1], 9)
        assert report["refused"] == []
        if number:
            after[number + 1] = predicted(cell, table)
    assert measured(cell) == [(name, False) for name in names]
    return Three(cell, robot, truth, table, names, after)


def test_what_the_simulation_learned_of_each_joint_stands_beside_what_was_stated(three, tmp_path):
    springs = told("status", three.cell)["springs"]
    stated = tomllib.loads(three.stated.read_text())["compliance"]
    assert [(s["joint"], s["axis"]) for s in springs] == [(s["joint"], s["axis"]) for s in stated]
    assert [s["stated"] for s in springs] == [s["stiffness"] for s in stated]
    for spring in springs:
        assert spring["unit"] == "N·m/rad"
        assert not spring["identifiable"] or spring["stiffness_sd"] < 0.5 * spring["stiffness"]
    assert any(abs(s["stiffness"] / s["stated"] - 1) > 0.03 for s in springs)  # it learned
    _, said, _ = call("status", three.cell)
    first = springs[0]
    shown = with_sd(first["stiffness"], first["stiffness_sd"])
    assert all(word in said for word in ("stated", "refitted ± sd", "N·m/rad", shown))
    page = tmp_path / "report.html"
    told("report", three.cell, "--out", page)
    assert all(word in page.read_text() for word in ('id="learned"', 'href="#learned"', shown))


def likeness(a: np.ndarray, b: np.ndarray) -> float:
    """Complex correlation of two sets of FRFs, 1 for the same."""
    return float(np.abs(np.vdot(a, b)) / (np.linalg.norm(a) * np.linalg.norm(b)))


def test_frfs_anywhere_are_nearer_to_the_truth_than_the_simulation(three, tmp_path):
    answer = told("predict", three.cell, three.table, "--out", tmp_path / "out.npz")
    with np.load(answer["npz"]) as npz:
        lines, found = npz["frequency_hz"], npz["frf_mean"]
        assert found.shape == npz["frf_sd"].shape == (2, 3, 3, lines.size)
    true, simulated = (
        np.array([one.accelerance(np.deg2rad(q), lines) for q in ASKED])
        for one in (three.truth, load_truth(three.stated))
    )
    assert likeness(found, true) > likeness(simulated, true)


def test_status_forecasts_and_compares_models(three, tmp_path, monkeypatch):
    said = " ".join(call("status", three.cell)[1].split())
    assert "RMSE over the workspace is about" in said
    assert "is told once" not in said
    status = told("status", three.cell, "--plot", tmp_path)
    assert status["simulated"] is True
    left_out = status["leave_one_out"]
    assert left_out["values"] == len(left_out["frequencies"]) > 6
    assert 0.5 < left_out["coverage"]["0.95"] <= 1
    for row in left_out["frequencies"]:
        assert abs(row["measured_hz"] - row["predicted_hz"]) < 8 * row["sd_hz"]
    assert Path(status["plots"][0]).read_bytes().startswith(b"\x89PNG")
    few = {name: model for name, model in MODELS.items() if name != "mfdgp"}  # which takes long
    monkeypatch.setattr("planner.campaign.model_comparison.MODELS", few)
    models = told("status", three.cell, "--models")["models"]
    assert {m["model"] for m in models} == set(few)
    assert [m["model"] for m in models if m["campaign"]] == ["default"]
    density = {m["model"]: m["log_density"] for m in models}
    assert [m["model"] for m in models] == sorted(density, key=lambda name: -density[name])
    assert density["gp"] < density["ar1"]  # three poses tell little without the simulation


def test_a_measurement_is_set_aside_and_taken_back(three):
    """Another test of these poses finds them as they were."""
    cell, names, after = three.cell, three.names, three.after
    true = np.array([three.truth.modes(np.deg2rad(q), 4)[0] for q in ASKED])
    off = [np.sqrt(np.mean((after[n][..., 0] / true - 1) ** 2)) for n in (0, 3)]
    assert off[1] < min(0.01, off[0] / 2)
    assert (after[3][..., 1] < after[0][..., 1]).all()
    told("withdraw", cell, names[-1])
    assert measured(cell) == [(names[0], False), (names[1], False), (names[2], True)]
    np.testing.assert_allclose(predicted(cell, three.table), after[2], rtol=1e-9)
    assert names[-1] in refused("withdraw", cell, names[-1])
    told("undo", cell)
    assert measured(cell) == [(name, False) for name in names]
    np.testing.assert_allclose(predicted(cell, three.table), after[3], rtol=1e-9)
    replayed = told("replay", cell)
    assert replayed["reproduced"]
    assert [s["event"] for s in replayed["steps"]].count("imported") == 3
    assert {"withdrawn", "undone"} <= {s["event"] for s in replayed["steps"]}


def test_a_proposal_keeps_its_name_and_place_until_it_is_measured(tmp_path):
    robot, campaign_toml, truth = make_cell(tmp_path, learns=False)
    cell = tmp_path / "cell"
    told("new", cell, "--robot", robot, "--campaign", campaign_toml)
    told("import", cell, record(truth, tmp_path / "own", "P001", ASKED[0].tolist()))
    # A simulation that does not learn has no refitted springs.
    assert told("status", cell)["springs"] == []
    assert "refitted" not in said("status", cell)
    assert "#learned" not in Path(told("report", cell)["report"]).read_text()

    def sent() -> tuple[str, list[float]]:
        (proposal,) = told("next", cell)["proposals"]
        return proposal["pose"], proposal["joints_deg"]

    second = sent()
    assert second[0] == "P002"  # P001 is a pose of the engineer's own
    told("import", cell, record(truth, tmp_path / "second", *second))
    third = sent()
    late = record(truth, tmp_path / "late", *second, seed=1)
    told("import", cell, *sorted((late / "data").iterdir())[:3], "--pose", second[0])
    assert sent() == third  # where the robot was sent
    told("import", cell, record(truth, tmp_path / "third", *third))
    told("undo", cell)
    assert sent() == third
    assert told("replay", cell)["reproduced"]


def test_what_another_acquisition_would_have_proposed_and_saved(tmp_path):
    robot, campaign_toml, truth = make_cell(tmp_path, learns=False)
    cell, measured = tmp_path / "cell", []
    told("new", cell, "--robot", robot, "--campaign", campaign_toml)
    for number in range(4):
        proposal, _ = outside.measured(truth, cell, tmp_path / f"export{number}", number)
        measured.append(proposal["pose"])
    replayed = told("replay", cell, "--acquisition", "variance")
    assert replayed["reproduced"]
    proposed = [step for step in replayed["steps"] if step["event"] == "proposed"]
    assert proposed
    assert all(len(step["instead"]) == 1 for step in proposed)
    assert all(not step["instead"] for step in replayed["steps"] if step["event"] == "imported")
    runs = replayed["otherwise"]["runs"]
    was, other = runs["campaign"], runs["variance"]
    assert was["poses"] == measured[: len(was["poses"])]
    assert other["poses"][0] == was["poses"][0]
    assert len(set(other["poses"])) == len(was["poses"]) == len(measured) - 2
    assert was["n"] == other["n"]
    assert np.all(np.diff(other["minutes"]) > 0)
    assert "variance would have needed" in replayed["otherwise"]["text"]
