"""Sets of FRFs that a fit has left at wrong poles."""

from dataclasses import replace

import numpy as np
import pytest

from planner.modal.fit_data import Data
from planner.modal.residues import unit
from planner.modal.set_poles import fit_sets
from planner.modal.set_search import searched_again

SETS, REFERENCES = 12, 3


@pytest.fixture(scope="module")
def fitted():
    """Two modes 1 % apart that drift by 0.5 %, felt in 12 sets by 3 references; the true poles."""
    rng = np.random.default_rng(4)
    frequency = np.linspace(30, 50, 400)
    poles = 2 * np.pi * np.array([40.0, 40.4]) * (1j - np.array([0.003, 0.004]))
    own = poles * (1 + 0.005 * rng.normal(size=(SETS, 2)))
    part = np.array([[1.0, 0.9], [0.8, -0.7], [-0.3, 1.0]])
    motion = rng.uniform(0.5, 1.5, (SETS, 2)) * rng.choice([-1, 1], (SETS, 2))
    rows, columns = np.repeat(np.arange(SETS), REFERENCES), np.tile(np.arange(REFERENCES), SETS)
    residue = -0.01j * motion[rows] * part[columns]
    data = Data(frequency, np.zeros((rows.size, 1, 400), complex), None, pooled=True)
    response = np.zeros((rows.size, 400), complex)
    for e, row in enumerate(rows):
        up, down = unit(data.lines, own[row]), unit(data.lines, own[row].conj())
        response[e] = residue[e] @ up + residue[e].conj() @ down
    level = 0.01 * np.sqrt(np.mean(np.abs(response) ** 2))
    response += level * (rng.normal(size=response.shape) + 1j * rng.normal(size=response.shape))
    data = replace(data, response=response[:, None])
    sets = tuple(np.flatnonzero(rows == row) for row in range(SETS))
    variance = np.full(response.shape, 2 * level**2)
    return data, sets, variance, fit_sets(data, sets, variance, poles, known=own), (rows, columns)


def test_sets_that_fit_are_left_alone(fitted):
    data, sets, variance, fit, places = fitted
    assert searched_again(data, sets, fit, variance, places) is None


def test_exchanged_and_strayed_poles_are_found_again(fitted):
    data, sets, variance, fit, places = fitted
    wrong = fit.own.copy()
    wrong[3] = fit.own[3, ::-1]  # fits as well as before: only the references tell
    wrong[8, 1] = fit.poles[1] * 1.008
    spoiled = fit_sets(data, sets, variance, fit.poles, rounds=0, known=wrong)
    spoiled = replace(spoiled, spread=fit.spread)
    found = searched_again(data, sets, spoiled, variance, places)
    assert found is not None
    half = np.abs(fit.poles.real)
    assert np.max(np.abs(found - fit.own)[[3, 8]] / half) < 0.1
    others = np.setdiff1d(np.arange(SETS), [3, 8])
    assert np.max(np.abs(found - fit.own)[others] / half) < 0.1


def test_sds_know_how_few_sets_tell_of_their_scatter(fitted):
    """With a spread that is known, the common pole's variance is spread/sets; 12 tell it, so t."""
    fit = fitted[3]
    sd = np.sqrt(np.diag(fit.covariance))[2:]
    plain = np.sqrt(fit.spread[2:] / SETS)
    assert sd == pytest.approx(plain * 2.2 / 1.96, rel=0.05)
