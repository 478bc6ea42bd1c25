"""Shapes from residues: rows that err as a whole, columns that are spoiled."""

import numpy as np
import pytest

from planner.modal.rank_one_fit import FREE_GAIN, Entries, fit_shape, row_gain

DAMPED = 300.0
COLUMNS = np.array([0, 7, 15])


def residues(shape, rng, noise=1e-4, gain=0.0, own=0.0):
    """Entries, residues and their variance; rows err by `gain`, single entries by `own`."""
    rows, columns = np.repeat(np.arange(shape.size), 3), np.tile(COLUMNS, shape.size)
    values = shape[rows] * shape[columns]
    values = values * (1 + gain * rng.normal(size=shape.size))[rows]
    values = values * (1 + own * rng.normal(size=values.size))
    both = rng.normal(size=values.size) + 1j * rng.normal(size=values.size)
    variance = np.full(values.size, (noise / (2 * DAMPED)) ** 2)
    residue = (values + noise * both) / (2j * DAMPED)
    return Entries(rows, columns, shape.size), residue, variance


def covered(found, shape):
    sign = np.sign(np.vdot(found.shape, shape).real)
    return np.mean(np.abs((found.shape * sign - shape).real) < 1.96 * found.sd)


@pytest.fixture
def shapes():
    rng = np.random.default_rng(4)
    return [rng.normal(size=40) for _ in range(12)]


def test_noise_alone_is_covered_and_rows_are_not_blamed(shapes):
    rng = np.random.default_rng(5)
    data = [residues(shape, rng) for shape in shapes]
    gain = row_gain([fit_shape(*one, DAMPED, FREE_GAIN) for one in data])
    assert gain < 0.003
    found = [fit_shape(*one, DAMPED, gain) for one in data]
    share = np.mean([covered(one, shape) for one, shape in zip(found, shapes, strict=True)])
    assert 0.9 < share < 0.99


def test_rows_that_err_alike_in_all_modes_are_seen_at_the_references():
    shares = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        shapes = [rng.normal(size=40) for _ in range(6)]
        errors = 0.02 * rng.normal(size=40)
        data = []
        for shape in shapes:
            entries, residue, variance = residues(shape, rng)
            data.append((entries, residue * (1 + errors)[entries.rows], variance))
        gain = row_gain([fit_shape(*one, DAMPED, FREE_GAIN) for one in data])
        found = [fit_shape(*one, DAMPED, gain) for one in data]
        shares.append(np.mean([covered(f, s) for f, s in zip(found, shapes, strict=True)]))
    assert 0.88 < np.mean(shares) <= 1.0


def test_entries_that_err_by_themselves_are_covered(shapes):
    rng = np.random.default_rng(6)
    data = [residues(shape, rng, own=0.02) for shape in shapes]
    found = [fit_shape(*one, DAMPED, 0.0) for one in data]
    share = np.mean([covered(one, shape) for one, shape in zip(found, shapes, strict=True)])
    assert 0.9 < share < 0.99


def test_a_spoiled_column_does_not_spoil_the_shape(shapes):
    """A close mode leaks into the column of a reference near this one's node."""
    rng = np.random.default_rng(7)
    for shape, other in zip(shapes[:6], shapes[6:], strict=True):
        shape = shape.copy()
        shape[COLUMNS] = 0.8, 0.01, 0.5
        entries, residue, variance = residues(shape, rng)
        leak = np.where(entries.columns == COLUMNS[1], 0.02 * other[entries.rows], 0.0)
        found = fit_shape(entries, residue + leak / (2j * DAMPED), variance, DAMPED)
        sign = np.sign(np.vdot(found.shape, shape).real)
        assert np.linalg.norm(found.shape * sign - shape) < 0.01 * np.linalg.norm(shape)
