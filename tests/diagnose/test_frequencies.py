"""Natural frequencies alone: which value of a model is not what is stated."""

import numpy as np

from planner.diagnosis.effects.effect import Quantity
from tests.support.frequency_changes import Change, explain

PLACES = np.linspace(0.2, 0.8, 7)
NUISANCE = Quantity("stiffness of all", "1", 0.0, 0.02, logarithmic=True)
CHANGES = (
    Change("added_mass", "link_1", Quantity("mass", "kg", 0.0, 0.5)),
    Change("support", "base", Quantity("support", "1", 0.0, 0.5, logarithmic=True), 1.0),
    Change("tilt", "base", Quantity("tilt", "1", 0.0, 0.5)),
)


def model(values):
    """Two frequencies of a mass on a spring whose stiffness depends on the place."""
    k = values["stiffness of all"] * (1 + 3 * PLACES**2 * values["support"])
    m = 2.0 + values["mass"]
    return np.stack([np.sqrt(k / m), np.sqrt((4 + values["tilt"] * PLACES) * k / m)], axis=1)


def measured(seed=0, sd=1e-3, **values):
    stated = {"stiffness of all": 1.01, "support": 1.0, "mass": 0.0, "tilt": 0.0}
    hertz = model(stated | values)
    rng = np.random.default_rng(seed)
    return hertz * (1 + sd * rng.standard_normal(hertz.shape)), sd * hertz


def told(explained):
    best = explained.explanations[0]
    return [(c.effect, c.at) for c in best.changes], best


def test_nothing_is_found_where_nothing_is_hidden():
    quiet = 0
    for seed in range(10):
        explained = explain(*measured(seed), model, (NUISANCE,), CHANGES)
        total = sum(e.probability for e in explained.explanations) + explained.unknown
        assert abs(total - 1) < 1e-9
        quiet += explained.verdict == "consistent"
    assert quiet >= 9


def test_one_change_and_two():
    explained = explain(*measured(1, support=1.3), model, (NUISANCE,), CHANGES)
    names, best = told(explained)
    assert names == [("support", "base")]
    assert explained.verdict == "explained"
    value, sd, _ = best.values["support"]
    assert abs(value - 1.3) < 3 * sd
    names, _ = told(explain(*measured(2, mass=0.3, tilt=0.5), model, (NUISANCE,), CHANGES))
    assert names == [("added_mass", "link_1"), ("tilt", "base")]


def test_what_no_change_describes_is_unknown():
    hertz, sd = measured(3)
    hertz = hertz * (1 + 0.1 * np.sin(40 * PLACES))[:, None]
    assert explain(hertz, sd, model, (NUISANCE,), CHANGES).verdict == "unexplained"


def test_missing_frequencies_are_left_out():
    hertz, sd = measured(4, support=1.3)
    hertz[2, 1] = hertz[5, 0] = np.nan
    assert told(explain(hertz, sd, model, (NUISANCE,), CHANGES))[0] == [("support", "base")]
