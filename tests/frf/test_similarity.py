"""FRAC and Frobenius similarity: what they see and what they do not."""

import numpy as np
import pytest

from planner.frf.similarity import similarity

RNG = np.random.default_rng(0)
FRFS = RNG.standard_normal((4, 3, 3, 50)) + 1j * RNG.standard_normal((4, 3, 3, 50))


def test_itself_and_its_phase():
    turned = FRFS * np.exp(1j * RNG.uniform(0, 6, FRFS.shape))
    for other in (FRFS, turned):  # both compare magnitudes
        assert similarity(FRFS, other).frac == pytest.approx(1.0)
        assert similarity(FRFS, other).frobenius == pytest.approx(1.0)


def test_frac_does_not_see_a_factor_and_frobenius_does():
    assert similarity(FRFS, 1.3 * FRFS).frac == pytest.approx(1.0)
    assert similarity(FRFS, 1.3 * FRFS).frobenius == pytest.approx(0.7)
    assert similarity(FRFS, 3 * FRFS).frobenius == 0.0


def test_appendix_b_for_one_response():
    a, b = np.zeros((2, 3, 3, 5)), np.zeros((2, 3, 3, 5))
    a[:, 0], b[:, 0] = RNG.uniform(1, 2, (2, 3, 5)), RNG.uniform(1, 2, (2, 3, 5))
    frac = [
        (a[i, 0, d] @ b[i, 0, d]) ** 2 / (a[i, 0, d] @ a[i, 0, d]) / (b[i, 0, d] @ b[i, 0, d])
        for i in range(2)
        for d in range(3)
    ]
    norm = np.linalg.norm
    frobenius = [1 - norm(a[:, 0, d] - b[:, 0, d]) / norm(a[:, 0, d]) for d in range(3)]
    assert similarity(a, b).frac == pytest.approx(np.mean(frac))
    assert similarity(a, b).frobenius == pytest.approx(np.mean(frobenius))


def test_what_was_not_measured_is_left_out():
    partly = FRFS.copy()
    partly[:, :, 1] = np.nan
    partly[2, :, :, 30:] = np.nan
    other = np.where(np.isnan(partly), 99.0, FRFS)
    assert similarity(partly, other).frac == pytest.approx(1.0)
    assert similarity(partly, other).frobenius == pytest.approx(1.0)
    assert np.isnan(similarity(np.full_like(FRFS, np.nan), FRFS).frac)
