"""What a verdict's findings are."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from planner.diagnosis.verdict import NamedEffect, Verdict
from planner.effects.resonator import LinkResonator
from planner.fit.explanations import RARE, gone, probabilities
from planner.fit.fitted import StructureFit


def test_two_hoses_on_one_link_are_two_findings():
    nothing = cast("StructureFit", None)  # no fit is asked
    hoses = [
        NamedEffect(LinkResonator(at, ()), 50.0, change, 1.0, counts)
        for at, change, counts in (
            ("link_4", 0.12, True),
            ("link_4#2", 0.05, True),
            ("link_2", 0.001, False),
        )
    ]
    found = Verdict("explained", tuple(hoses), (), (), nothing)
    assert [e.change for e in found.findings] == [0.12, 0.05]
    assert {e.place for e in found.findings} == {("local_resonator", "link_4")}
    assert Verdict("unexplained", tuple(hoses), (), (), nothing).findings == ()


def test_a_second_hose_is_as_rare_on_the_same_link_as_on_another():
    def fit(evidence: float, *places: str) -> Any:
        prior = SimpleNamespace(built=())
        effects = tuple(LinkResonator(at, ()) for at in places)
        return SimpleNamespace(
            structure=SimpleNamespace(effects=effects, prior=prior), evidence=evidence
        )

    same, apart, alone = (
        fit(100.0, "link_4", "link_4#2"),
        fit(100.0, "link_4", "link_2"),
        fit(100.0),
    )
    weights = list(probabilities([same, apart, alone]).values())
    assert weights[0] == pytest.approx(weights[1])
    assert weights[2] / weights[0] == pytest.approx(np.exp(2 * RARE))


def test_the_hose_that_is_gone_is_told_by_its_numbers_and_not_by_its_label():
    def fit(**frequencies: float) -> Any:
        effects = tuple(LinkResonator(at.replace("_second", "#2"), ()) for at in frequencies)
        own = tuple(slice(i, i + 1) for i in range(len(effects)))
        structure = SimpleNamespace(effects=effects, own=own, prior=SimpleNamespace(built=()))
        x, known = np.array(list(frequencies.values())), np.eye(len(effects))
        return SimpleNamespace(structure=structure, at=SimpleNamespace(x=x, covariance=known))

    both = fit(link_5=20.0, link_5_second=30.0)
    first, second = both.structure.effects
    # What was left has moved to where the first was, or has not.
    assert gone(fit(link_5_second=20.1), both) == [second]
    assert gone(fit(link_5_second=29.9), both) == [first]
