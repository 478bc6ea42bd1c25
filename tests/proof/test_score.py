"""Scores of a proof, on answers and diagnoses written by hand; a refit, on springs and masses."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest

from planner.errors import InputError
from planner.proof import run
from planner.proof.make import deck
from planner.proof.refit import (
    STATED_SD,
    Body,
    DetectionProblem,
    Observed,
    Pose,
    Snapshot,
    Spring,
    detectability,
)
from planner.proof.report import write
from planner.proof.run import Proof
from planner.proof.score import (
    calibration_error,
    figures,
    named_imperfections,
    score,
    share,
)

HELD = {"frac": 0.9, "frobenius": 0.9}
MASS, BASE, OTHER = ("added_mass", "link_3"), ("base_compliance", "base"), ("added_mass", "link_4")
NONE, UNKNOWN, CHANNEL = ("none", None), ("unknown", None), ("polarity", "sensor_x")


def answer(*effects, size=0.1, nats=1e3, imperfections=(), parameters=None):
    said = {"parameters": parameters or {}, "nats": nats, "size": size, "change": 0.5}
    return {
        "robot": "kr210",
        "engine": "arms",
        "effects": [{"effect": e, "at": at, **said} for e, at in effects],
        "imperfections": [{"effect": e, "at": at} for e, at in imperfections],
        "held_out": {},
    }


def told(*places, probability=0.9, parameters=None, sets=()):
    verdict = {"none": "consistent", "unknown": "unexplained"}.get(places[0][0], "explained")
    effects = [{"effect": e, "at": at} for e, at in places]
    return {
        "verdict": verdict,
        "findings": [{**e, "parameters": parameters or {}} for e in effects if e["at"]],
        "candidates": [{"effects": effects, "probability": probability}],
        "sets": [[{"effect": e, "at": at} for e, at in members] for members in sets],
        "held_out": {"refitted": HELD, "explained": HELD},
        "seconds": 1.0,
    }


SLIGHT, BETWEEN = 0.004, 0.01
CASES = [  # concealed, what is left of it, nats, said, whether right, false names
    ([MASS], 0.1, 1e3, [MASS], True, []),
    ([MASS], 0.1, 1e3, [OTHER], False, [OTHER]),
    ([MASS], 0.1, 1e3, [NONE], False, []),
    ([MASS], 0.1, 1e3, [UNKNOWN], False, []),
    ([MASS], 0.1, 10.0, [NONE], True, []),  # the recordings do not tell it
    ([MASS], BETWEEN, 1e3, [NONE], True, []),
    ([MASS], BETWEEN, 1e3, [MASS], True, []),
    ([MASS], SLIGHT, 1e3, [NONE], True, []),
    ([MASS], SLIGHT, 1e3, [BASE], False, [BASE]),
    ([MASS, BASE], 0.1, 1e3, [BASE, MASS], True, []),
    ([MASS, BASE], 0.1, 1e3, [BASE], False, []),
    ([], 0.0, 0.0, [NONE], True, []),
    ([], 0.0, 0.0, [UNKNOWN], False, []),
    ([], 0.0, 0.0, [MASS], False, [MASS]),
    ([UNKNOWN], 0.1, 1e3, [UNKNOWN], True, []),
    ([UNKNOWN], BETWEEN, 1e3, [UNKNOWN], True, []),
    ([UNKNOWN], BETWEEN, 1e3, [NONE], True, []),
    ([UNKNOWN], 0.1, 1e3, [NONE], False, []),
    ([UNKNOWN], SLIGHT, 1e3, [UNKNOWN], False, []),
    ([UNKNOWN], 0.1, 1e3, [MASS], False, [MASS]),
]


@pytest.mark.parametrize(("true", "size", "nats", "said", "right", "false"), CASES)
def test_what_is_right(true, size, nats, said, right, false):
    found = score("a", answer(*true, size=size, nats=nats), told(*said))
    assert (found.right, list(found.false_names)) == (right, false)


def test_a_set_of_two_counts_beside_the_name_and_a_larger_one_does_not():
    two = score("a", answer(MASS), told(OTHER, sets=[[MASS, OTHER]]))
    assert (two.shown[0].named, two.shown[0].in_set, two.false_names) == (False, True, ())
    three = score("a", answer(MASS), told(OTHER, sets=[[MASS, OTHER, BASE]]))
    assert (three.shown[0].in_set, three.false_names) == (False, (OTHER,))
    unsaid = score("a", answer(MASS), told(NONE, sets=[[MASS, OTHER]]))
    assert not unsaid.shown[0].in_set  # a set of which nothing is named tells nobody anything


@pytest.mark.parametrize(
    ("size", "false", "required"),
    [(0.02, [], False), (BETWEEN / 2, [], True), (SLIGHT, [BASE], True)],
)
def test_an_imperfection_is_a_false_name_where_it_is_too_small(size, false, required):
    true, said = answer(imperfections=[BASE, MASS]), told(BASE)
    assert named_imperfections(true, said) == [BASE]
    found = score("a", true, {**said, "imperfections": {"base_compliance@base": size}})
    assert list(found.false_names) == false
    silence = figures([found])["silence_where_required"]
    assert (silence.right, silence.of) == (0, int(required))


def test_figures_count_what_they_say():
    scored = [
        score("a", answer(CHANNEL), {"failed": "it broke"}),
        score("b", answer(CHANNEL), told(MASS, probability=1.0)),
        score("c", answer(CHANNEL), told(CHANNEL, probability=1.0)),
        score("d", answer(UNKNOWN), told(UNKNOWN, probability=0.5)),
        score("e", answer(MASS, BASE), told(MASS, BASE, probability=1.0)),
    ]
    found = figures(scored)
    counts = {name: (of.right, of.of) for name, of in found.items() if hasattr(of, "of")}
    assert counts["artefacts_called_physics"] == (1, 3)
    assert counts["failed"] == (1, 5)
    assert counts["required_named"] == (3, 5)
    assert counts["unknown_where_right"] == (1, 1)
    assert counts["both_of_pairs"] == (1, 1)
    assert found["by"]["group"]["artefact"].right == 1
    assert calibration_error(scored) == pytest.approx((4 * 0.5 + 0.5) / 5)


@pytest.mark.parametrize(("sd", "inside"), [(1.0, 1), (0.5, 0)])
def test_interval_covers(sd, inside):
    found = {"mass": {"value": 11.0, "sd": sd, "unit": "kg"}}
    true = answer(MASS, parameters={"mass": 10.0})
    assert score("a", true, told(MASS, parameters=found)).covered == (inside, 1)


def test_wilsons_interval_is_that_of_the_score_test():
    for right, of in [(0, 12), (9, 12), (12, 12), (170, 200)]:
        found = share([k < right for k in range(of)])
        p = right / of
        for bound in found.interval95:  # where the test of a share just fails at 5 %
            if 0 < bound < 1:
                assert abs(p - bound) == pytest.approx(1.96 * np.sqrt(bound * (1 - bound) / of))
        assert found.interval95[0] - 1e-9 <= p <= found.interval95[1] + 1e-9
    assert share([]).share is None


def test_all_files_of_a_report(tmp_path):
    cases = [score("a", answer(MASS), told(MASS)), score("b", answer(), told(BASE))]
    found = write(tmp_path, "00", cases)
    for name in ("confusion.png", "calibration.png"):
        assert (tmp_path / name).stat().st_size > 5000
    assert "| cases with false names | 1/2 | 50%" in found.text()
    assert [s.name for s in found.keys["misses"]] == ["b"]
    kept = json.loads((tmp_path / "report.json").read_text())
    assert kept["nulls_silent"]["of"] == 1


def test_a_deck_has_every_kind_and_is_the_same_again():
    kinds = deck(100, ["a", "b", "c"], ["x", "y"], 3)
    assert kinds == deck(100, ["a", "b", "c"], ["x", "y"], 3)
    counts = {kind: kinds.count(kind) for kind in set(kinds)}
    assert (counts["null"], counts["pair"], counts["x"] + counts["y"]) == (15, 20, 15)
    assert max(counts[k] for k in "abc") - min(counts[k] for k in "abc") <= 1


def test_cases_are_kept_as_they_come_and_not_done_again(tmp_path, monkeypatch):
    """The answer of a case that was changed after it was sealed is noticed."""
    done = []

    def each(_function, _shared, tasks, _jobs, _scheduler):
        for k, task in enumerate(tasks):
            done.append(task.name)
            text = json.dumps(answer(MASS))
            seal = hashlib.sha256(text.encode()).hexdigest()
            yield k, {"seal": seal, "answer": text, "told": told(MASS)}
            if len(done) == 2:
                raise KeyboardInterrupt

    monkeypatch.setattr(run.processes, "each", each)
    said = []
    proof, tell = Proof(3, 1), lambda what, _share: said.append(what)
    with pytest.raises(KeyboardInterrupt):
        run.results(proof, tmp_path, 1, None, tell)
    found = run.results(proof, tmp_path, 1, None, tell)
    assert done == ["case_001", "case_002", "case_003"]
    assert [s.right for s in found.values()] == [True] * 3
    assert said[-1] == "case_003 explained, right"
    with pytest.raises(InputError, match="holds other cases"):
        run.results(replace(proof, seed=2), tmp_path, 1, None, tell)
    path = tmp_path / "case_002.json"
    path.write_text(path.read_text().replace("link_3", "link_5"))
    with pytest.raises(InputError, match="changed after it was sealed"):
        run.results(proof, tmp_path, 1, None, tell)


S = 2j * np.pi * np.linspace(4, 60, 40)
BODY = Body(10.0, np.zeros(3), 0.2 * np.eye(3))


def question(
    factor: float,
    extra_kg: float = 0.0,
    hose_kg: float = 0.0,
    first: float = 1.0,
    damped: float = 1,
    late_s: float = 0.0,
) -> DetectionProblem:
    """A mass on springs along three axes; what is seen has stiffer ones, the first by a factor of
    its own, or more mass, or comes late."""
    stiffness, damping = np.array([1e5, 2e5, 4e5]), damped * np.array([30.0, 40.0, 60.0])
    turning = np.eye(3) * 1e4

    def snapshot(first: float, factor: float, extra_kg: float, hose_kg: float) -> Snapshot:
        mass = np.diag([10.0 + extra_kg] * 3 + [0.4] * 3)
        rest = np.zeros((6, 6))
        rest[3:, 3:] = turning
        at = S[:, None, None]
        own_stiffness = factor * stiffness * [first, 1.0, 1.0]
        springs = [
            Spring(np.eye(6)[j], np.full(len(S), k + 0j), c, k, STATED_SD)
            for j, (k, c) in enumerate(zip(own_stiffness, damping, strict=True))
        ]
        z = at**2 * mass + rest + at * np.diag([*damping, 20.0, 20.0, 20.0])
        z = z + np.diag([*own_stiffness, 0, 0, 0])
        own = hose_kg * (2 * np.pi * 25) ** 2 * (1 + 0.05j)
        hose = own * S**2 * hose_kg / (own + S**2 * hose_kg) if hose_kg else 0 * S
        z = z + hose[:, None, None] * np.diag([1, 1, 1, 0, 0, 0])
        return Snapshot(z, springs, np.eye(6), np.eye(6), {"link_1": np.eye(6)})

    def frf(robot: Snapshot) -> np.ndarray:
        return (S**2)[:, None, None] * np.linalg.inv(robot.z)[:, :3, :3]

    without = snapshot(1.0, 1.0, 0.0, 0.0)
    seen = frf(snapshot(first, factor, extra_kg, hose_kg)) * np.exp(-S * late_s)[:, None, None]
    observed = Observed(seen, np.full(seen.shape, 1e-10), np.array([4, 4, 4]))
    poses = [Pose(without, np.zeros((1, *seen.shape), complex), [observed])] * 3
    return DetectionProblem(S, poses, [(without, seen)], {"link_1": BODY}, 1.0, 1.0)


@pytest.mark.parametrize(
    ("change", "least", "most"),
    [
        ({"factor": 1.2}, 0.0, 0.003),  # a spring within its tolerance is no effect
        ({"factor": 1.0, "extra_kg": 0.5}, 0.0, 0.003),
        ({"factor": 1.0, "late_s": 1.19e-4}, 0.0, 0.003),
        # A light damper's resonance is passed on the way.
        ({"factor": 1.0, "first": 0.65, "damped": 0.03}, 0.0, 0.003),
        ({"factor": 2.5}, 0.05, 2.0),  # far beyond
        ({"factor": 1.0, "hose_kg": 0.3}, 0.02, 2.0),  # what no spring and no mass can be
    ],
)
def test_a_refit_takes_up_what_tolerances_allow_and_no_more(change, least, most):
    found = detectability(question(**change))
    assert least <= found.size <= most
    assert found.change > 0.02
    assert (found.nats > 20) == (least > 0)
