"""Laws whose swings stay bounded while their derivatives do not: no fit fails there."""

from types import SimpleNamespace

import numpy as np

from planner.diagnosis.laws import fit_in_time
from planner.diagnosis.laws.law_at_joints import LawMisfit
from planner.inference.least_squares import Damping, begin

LAW = SimpleNamespace(ports=(0,), coordinates=np.zeros(2), limits=lambda plain: None)


def overflowing(*given):
    """As the products of derivatives of 1e200."""
    slopes = np.full((2, 3), 1e200)
    return slopes.sum(axis=1), slopes @ slopes.T


def test_where_derivatives_overflow_a_law_cannot_be(monkeypatch):
    monkeypatch.setattr(fit_in_time, "_gradient_and_normal", overflowing)
    at = fit_in_time._with_normal(None, LawMisfit(LAW, 1.0, 1.0), None, None)
    assert at.value == np.inf
    assert at.law is LAW


def test_a_fit_that_begins_there_ends_there_with_its_value(monkeypatch):
    problem = SimpleNamespace(start=lambda law, rule: begin(np.zeros(2), LawMisfit(law), rule))
    monkeypatch.setattr(fit_in_time, "misfits", lambda _, laws: [LawMisfit(LAW, 1.0, 1.0)])
    monkeypatch.setattr(fit_in_time, "_sloped", lambda _, at: LawMisfit(at.law))
    found = fit_in_time.descended(problem, LAW, 5, 1e-3, Damping())
    assert found.value == 1.0
