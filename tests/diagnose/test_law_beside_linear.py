"""A joint's law beside a linear explanation, and beside each part of it."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from planner.diagnosis import law_beside_linear
from planner.diagnosis.effects.added_mass import AddedMass
from planner.diagnosis.finding import Finding
from planner.diagnosis.law_beside_linear import beside
from planner.diagnosis.linear_diagnosis import Candidate, Diagnosis

ANYTHING = cast(Any, None)
MASS, FALSE = AddedMass("link_4"), AddedMass("link_2")
CRUDE = Finding("nonlinear_stiffness", "joint_2", 900.0, misfit=18.0)


def fitted(per_value: float) -> Any:
    simulation = SimpleNamespace(simulation=None)
    misfit = SimpleNamespace(counts=np.array([100]), setting=simulation)
    return SimpleNamespace(per_value=per_value, misfit=misfit)


def looked_for(monkeypatch, laws: dict[tuple, float | None], crude: Finding = CRUDE):
    """What is told beside masses at link_4 and link_2, which fit the averages best together.

    `laws`: χ² per value of the law beside each explanation; None where no robot has it.
    """
    parts = {(MASS, FALSE): 1.0, (MASS,): 3.0, (FALSE,): 5.0}
    candidates = tuple(
        Candidate(effects, 0.9 / 3**i, fitted(misfit))
        for i, (effects, misfit) in enumerate(parts.items())
    )
    found = Diagnosis(
        "explained", candidates, fitted(30.0), cast(Any, candidates[0].fit), 1.0, 0.0, ANYTHING
    )

    def screened(recorded, simulation, **_):
        return (Finding("nonlinear_stiffness", "joint_2", 900.0, misfit=simulation),)

    monkeypatch.setattr(law_beside_linear, "possible_simulation", lambda _, c: laws.get(c.effects))
    monkeypatch.setattr(law_beside_linear.force_levels, "screen", screened)
    return beside(ANYTHING, (crude,), found)


@pytest.mark.parametrize(
    ("laws", "named"),
    [
        ({(MASS, FALSE): 0.8, (MASS,): 0.9, (FALSE,): 9.0}, (MASS,)),  # one stood for the law
        ({(MASS, FALSE): 0.8, (MASS,): 4.0, (FALSE,): 9.0}, (MASS, FALSE)),  # both are there
        ({(MASS, FALSE): None, (MASS,): 0.9, (FALSE,): 9.0}, (MASS,)),  # no robot has both
    ],
)
def test_the_fewest_effects_beside_which_the_law_fits_are_told(monkeypatch, laws, named):
    both = looked_for(monkeypatch, laws)
    assert both is not None
    findings, found = both
    assert [(f.effect, f.at) for f in findings] == [("nonlinear_stiffness", "joint_2")]
    assert found.candidates[0].effects == named
    assert found.best is found.candidates[0].fit


@pytest.mark.parametrize("misfit", [None, 15.0])
def test_where_the_law_fits_beside_none_of_them_nothing_is_told(monkeypatch, misfit):
    laws = dict.fromkeys([(MASS, FALSE), (MASS,), (FALSE,)], misfit)
    assert looked_for(monkeypatch, laws) is None


def test_nothing_is_told_beside_levels_of_which_no_law_has_a_misfit(monkeypatch):
    laws = dict.fromkeys([(MASS, FALSE), (MASS,), (FALSE,)], None)
    unexplained = Finding("friction", "joint_2", 900.0)
    assert looked_for(monkeypatch, laws, unexplained) is None
