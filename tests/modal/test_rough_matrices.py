"""Modes of roving-hammer sets of other structures, with hits that miss and drift between sets."""

import numpy as np
import pytest

from planner.modal.matrix_modes import modes_of_matrix
from tests.support.rough_hammer_sets import geometry_of, rough_set, tellable, told


@pytest.mark.parametrize(
    ("seed", "scale", "nuisances", "least"),
    [
        *((seed, 0.03, {"gain": 0.0, "drift": 0.0}, 0.9) for seed in (30, 31, 32)),
        (33, 0.04, {"gain": 0.03, "drift": 0.0}, 0.85),
        (34, 0.03, {"gain": 0.01, "drift": 0.003}, 0.9),
    ],
    ids=["panel", "frame", "pieces", "rows err as a whole", "drift beyond the bandwidth"],
)
def test_modes_and_what_their_intervals_hold(seed, scale, nuisances, least):
    case = rough_set(seed, **nuisances)
    found = modes_of_matrix(case.matrix, case.band_hz, geometry_of(case.structure))
    seen = told(case, found.modes, found.dofs)
    assert None not in seen
    assert len(found.modes) <= case.poles.size  # none is split
    assert min(t.mac for t in seen) > 0.995
    assert max(abs(t.scale) for t in seen) < scale
    assert np.mean([abs(t.frequency_z) < 2.5 for t in seen]) > 0.8
    assert np.mean([abs(t.damping_z) < 2.5 for t in seen]) > 0.8
    assert np.mean([(t.real + t.imag) / 2 for t in seen]) > least
    assert found.checks.faults == ()
    if nuisances["drift"]:
        scatter = [mode.scatter_hz / mode.frequency_hz for mode in found.modes]
        np.testing.assert_allclose(np.median(scatter), nuisances["drift"], rtol=0.5)


def test_without_drift_sets_share_their_poles():
    case = rough_set(35, drift=0.0)
    found = modes_of_matrix(case.matrix, case.band_hz)
    assert np.mean([mode.scatter_hz < mode.frequency_sd_hz * 10 for mode in found.modes]) > 0.8


def test_a_fifth_of_the_matrix_is_missing():
    case = rough_set(37, missing=0.2, drift=0.0005)
    found = modes_of_matrix(case.matrix, case.band_hz)
    seen = told(case, found.modes, found.dofs)
    assert None not in seen
    # A point felt only by references that a mode leaves at rest is not known in that mode.
    known = [t for t, sure in zip(seen, tellable(case), strict=True) if sure]
    assert len(known) >= 3
    assert min(t.mac for t in known) > 0.995
    assert np.mean([(t.real + t.imag) / 2 for t in seen]) > 0.9
