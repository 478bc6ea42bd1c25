"""Metrics against the sums of Birk et al. 2025, appendix B, their laws, and their edges."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from planner.frf import metrics

SHAPE = (3, 3, 3, 24)  # pose, response, hit, line
PART = st.floats(-1e60, 1e60, allow_nan=False).map(lambda x: x if abs(x) > 1e-60 else 0.0)


def frfs(lines: int = 6):
    return hnp.arrays(complex, (2, lines), elements=st.builds(complex, PART, PART))


def random_frf(seed: int, shape: tuple[int, ...] = SHAPE) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def test_figures_are_the_sums_of_the_paper():
    """Written out with loops, as appendix B has them, for one direction d."""
    measured, simulated = random_frf(0, (4, 7)), random_frf(1, (4, 7))
    fracs, error, size = [], 0.0, 0.0
    for i in range(4):
        v, w = [abs(x) for x in measured[i]], [abs(x) for x in simulated[i]]
        dot = sum(a * b for a, b in zip(v, w, strict=True))
        fracs.append(dot**2 / (sum(a * a for a in v) * sum(b * b for b in w)))
        error += sum((a - b) ** 2 for a, b in zip(v, w, strict=True))
        size += sum(a * a for a in v)
    similarity = max(0.0, 1 - (error / size) ** 0.5)
    assert 0 < similarity < 1
    np.testing.assert_allclose(metrics.frac(measured, simulated), fracs, rtol=1e-12)
    assert metrics.agreement(measured, simulated).global_frac == pytest.approx(np.mean(fracs))
    assert metrics.agreement(measured, simulated).frobenius == pytest.approx(similarity)


@settings(max_examples=30, deadline=None)
@given(frfs(), frfs())
def test_bounds_and_symmetry(a, b):
    for figure in (metrics.frac, metrics.complex_frac):
        value = figure(a, b)
        assert np.all((value >= 0) & (value <= 1))
        np.testing.assert_allclose(figure(b, a), value, rtol=1e-9, atol=1e-12)
    # Cauchy and Schwarz: disregarding the phase can only bring two FRFs nearer.
    assert np.all(metrics.frac(a, b) >= metrics.complex_frac(a, b) - 1e-12)
    similarity = metrics.agreement(a, b).frobenius
    assert 0 <= similarity <= 1


@settings(max_examples=30, deadline=None)
@given(frfs(), frfs(), st.floats(1e-3, 1e3), st.floats(0, 6.3), st.permutations(range(6)))
def test_what_does_not_count(a, b, scale, angle, order):
    """A complex factor for FRAC, the phase of each line for magnitudes, the order of lines."""
    factor = scale * np.exp(1j * angle)
    for figure in (metrics.frac, metrics.complex_frac):
        value = figure(a, b)
        np.testing.assert_allclose(figure(a, factor * b), value, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(figure(a[:, order], b[:, order]), value, rtol=1e-9, atol=1e-12)
    turned = b * np.exp(1j * angle * np.arange(6))
    np.testing.assert_allclose(metrics.frac(a, turned), metrics.frac(a, b), rtol=1e-9, atol=1e-12)
    similarity = metrics.agreement(a, b).frobenius
    for pair in ((a, turned), (factor * a, factor * b), (a[::-1], b[::-1])):
        assert metrics.agreement(*pair).frobenius == pytest.approx(similarity, abs=1e-9)


@settings(max_examples=30, deadline=None)
@given(frfs(), st.floats(0.0, 3.0))
def test_frobenius_similarity_knows_the_amplitude(a, scale):
    assume(np.any(a != 0))
    expected = max(0.0, 1 - abs(1 - scale))
    assert metrics.agreement(a, scale * a).frobenius == pytest.approx(expected, abs=1e-12)


def test_zero_frfs():
    zero, other = np.zeros((2, 5), complex), random_frf(2, (2, 5))
    for figure in (metrics.frac, metrics.complex_frac):
        assert figure(zero, zero).tolist() == [1, 1]
        assert figure(zero, other).tolist() == figure(other, zero).tolist() == [0, 0]
    assert metrics.agreement(zero, zero).frobenius == 1
    assert metrics.agreement(zero, other).frobenius == 0
    assert metrics.agreement(other, zero).frobenius == 0


def test_columns_never_hit_are_left_out():
    measured, simulated = random_frf(3), random_frf(4)
    measured[:, :, 1] = np.nan  # nobody hit along y
    measured[0, :, 2] = np.nan  # nor along z at the first pose
    whole = metrics.agreement(measured, simulated)
    with_phase = metrics.mean_known(metrics.complex_frac(measured, simulated), axis=0)
    for values in (whole.global_frac, with_phase, whole.frobenius):
        assert np.isnan(values[:, 1]).all()
        assert np.isfinite(values[:, [0, 2]]).all()
    later = metrics.agreement(measured[1:], simulated[1:])
    np.testing.assert_allclose(whole.global_frac[:, 2], later.global_frac[:, 2])
    np.testing.assert_allclose(whole.frobenius[:, 2], later.frobenius[:, 2])
    mean = metrics.direct_mean(whole.frobenius)
    assert mean == pytest.approx((whole.frobenius[0, 0] + whole.frobenius[2, 2]) / 2)
    nothing = metrics.agreement(measured[:0], simulated[:0])
    assert np.isnan(metrics.direct_mean(nothing.global_frac))
    assert np.isnan(nothing.frobenius).all()


def test_agreement_of_a_path_on_some_lines():
    measured, simulated = random_frf(5), random_frf(6)
    path = metrics.agreement(measured[..., 5:11], simulated[..., 5:11])[np.array([0, 2])]
    assert path.frac.shape == (2, 3, 3)
    lines, poses = slice(5, 11), [0, 2]
    for i in range(3):
        for j in range(3):
            pair = measured[poses, i, j, lines], simulated[poses, i, j, lines]
            assert path.global_frac[i, j] == pytest.approx(metrics.agreement(*pair).global_frac)
            assert path.frobenius[i, j] == pytest.approx(metrics.agreement(*pair).frobenius)
    assert path.frobenius.max() < 1


def test_poses_with_lines_of_their_own_are_stacked():
    measured, simulated = random_frf(9), random_frf(10)
    whole = metrics.agreement(measured, simulated)
    parts = [metrics.agreement(measured[i : i + 1], simulated[i : i + 1]) for i in range(3)]
    stacked = metrics.Agreement.joined(parts)
    np.testing.assert_array_equal(stacked.frac, whole.frac)
    np.testing.assert_array_equal(stacked.frobenius, whole.frobenius)
    finer = np.repeat(measured[2:], 2, axis=-1), np.repeat(simulated[2:], 2, axis=-1)
    joined = metrics.Agreement.joined([*parts[:2], metrics.agreement(*finer)])
    np.testing.assert_allclose(joined.global_frac, whole.global_frac)


def test_what_cannot_be_compared():
    measured, simulated = random_frf(7), random_frf(8)
    with pytest.raises(ValueError, match="no frequency line"):
        metrics.agreement(measured[..., :0], simulated[..., :0])
    simulated[0, 0, 0, 0] = np.nan
    with pytest.raises(ValueError, match="no number"):
        metrics.agreement(measured, simulated)
