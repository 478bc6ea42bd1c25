"""Claims can fail: every rule of every study on a case in which it must say no."""

from types import SimpleNamespace

import numpy as np
import pytest

from planner.frf.metrics import agreement
from planner.studies import registry
from planner.studies.claims import HOLDS, IN_KIND, NOT, UNTESTED, judge
from planner.studies.kr10_birk2025 import data, fits, pictures

RULES = [(name, rule) for name in registry.NAMES for rule in registry.load(name).RULES]


def full(bound):
    """A figure just stronger than the paper's."""
    sign = 1 if bound.below is None else -1
    return bound.limit + sign if bound.in_full is None else bound.in_full + 1e-9 * sign


@pytest.mark.parametrize(("name", "rule"), RULES, ids=lambda v: getattr(v, "sentence", v)[:40])
def test_every_rule_says_yes_and_no(name, rule):
    """As strong as the paper's it holds; a seed at a bound, or a spread across it, is a no."""
    good = {b.figure: [full(b)] * 3 for b in (*rule.bounds, *rule.given)}
    assert len(good) == len(rule.figures) > 0

    def judged(**changed):
        (claim,) = judge([rule], good | changed)
        assert claim.reason
        assert len(claim.rows) == len(rule.figures)
        return claim

    assert judged().verdict == HOLDS
    for bound in rule.bounds:
        sign, limit, strong = (1 if bound.below is None else -1), bound.limit, full(bound)
        away = sign * (abs(strong - limit) or 1)
        for no in ([strong, limit, strong], [strong, limit - away, strong],
                   [limit + 0.01 * away, limit + away, limit + 0.02 * away]):  # fmt: skip
            claim = judged(**{bound.figure: no})
            assert claim.verdict == NOT
            assert bound.figure in claim.why_not
            assert not claim.holds
        assert judged(**{bound.figure: [float("nan")] * 3}).verdict == UNTESTED
        assert judged(**{bound.figure: [strong]}).verdict == IN_KIND  # one seed has no spread
        if bound.in_full is not None:
            assert judged(**{bound.figure: [limit + 0.5 * away] * 3}).verdict == IN_KIND
    for bound in rule.given:
        claim = judged(**{bound.figure: [bound.limit] * 3})
        assert claim.verdict == UNTESTED
        assert bound.figure in claim.reason


@pytest.mark.parametrize(
    ("words", "figures", "reason"),
    [
        ("sd grows", {"GP's sd at 120° over that in the training": [11.0]}, "MFDGP"),
        (
            "what the diagnosis adds",
            {"effects that the diagnosis names": [0, 0],
             "R² of the diagnosed simulation over NARGP's": [0.48, 0.5]},
            "effects that the diagnosis names",
        ),
        ("Cuts with another tool", {}, "not computed"),
    ],
)  # fmt: skip
def test_what_cannot_be_judged_here_says_why(words, figures, reason):
    (rule,) = (rule for _, rule in RULES if words in rule.sentence)
    (claim,) = judge([rule], figures)
    assert claim.verdict == UNTESTED
    assert reason in claim.reason


def made_up_birk(off):
    """Hits on three paths and models whose FRFs are off by so much of what was measured."""
    rng = np.random.default_rng(0)
    path = np.repeat(["S1", "S2", "S3"], 4)
    measured = 1 + rng.random((12, 3, 3, 40))
    aside = np.where(np.arange(12) % 4 == 2, 2, 1)[:, None, None, None]  # worse where not fitted

    def model(name):
        simulated = measured + off[name] * aside * (rng.random(measured.shape) - 0.5)
        agreed = agreement(measured, np.abs(simulated))
        stiffness = np.array([3.0, 12.0, 12.0] * 6)
        simulation = SimpleNamespace(elasticity=SimpleNamespace(stiffness=stiffness))
        bounds = np.tile([1.0, 4.0], (2, 1))
        values = np.array([2.0, 4.0 if name == "12P" else 3.0])
        return fits.IdentifiedModel(simulation, agreed, agreed, 1.0, values, bounds)

    hits = data.PathHits(SimpleNamespace(frfs=()), path)
    designs = [fits.Design("", np.arange(9), 16, 80.0), fits.Design("", np.arange(9), 17, 82.0)]
    return pictures.Run(hits, {name: model(name) for name in off}, designs)


def test_figures_of_birk_say_which_model_is_better():
    off = {"12P": 1.2, "24P": 0.6, "24P, ours": 0.2, "12P, global search": 1.4,
           "24P, global search": 0.9}  # fmt: skip
    birk = registry.load("birk2025")
    found = birk.figures(made_up_birk(off))
    other = birk.figures(made_up_birk(off | {"12P": off["24P"], "24P": off["12P"]}))
    for name in ("FRAC gained by 24P, points", "Frobenius gained by 24P, points",
                 "least FRAC gained on a path, points", "Frobenius gained over the search, points",
                 "FRAC that 12P loses more than 24P, points"):  # fmt: skip
        assert found[name] > 0 > other[name]
    assert found["FRAC gained by ours, points"] > 0
    assert found["FRAC ≤ 200 Hz over that ≤ 800 Hz, 12P, points"] == 0
    assert found["12P's parameters at a bound, of 12"] == 1
    assert found["24P's parameters at a bound, of 24"] == 0
    assert found["least ratio of a joint"] == 4
    assert found["parameters determined beyond the paper's nine"] == 1
    assert found["FRAC elsewhere beyond the paper's nine, points"] == 2
