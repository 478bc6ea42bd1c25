"""MDOF fit of FRF matrices that are not symmetric; the truth is a direct solution of M, C, K."""

import numpy as np
import pytest
from scipy import linalg

from planner.errors import InputError, RefusedError
from planner.frf.quantities import convert, convert_variance
from planner.modal.eigenvectors import Eigenvectors
from planner.modal.fit_data import Data
from planner.modal.mdof import _evaluate, _join, fit_mdof

LINES = np.arange(4.0, 70.0, 0.2)
POINTS = [0, 1, 4, 5]  # two points with two directions each


class Structure:
    """M = 1, C and K of a structure with six modes in the band and, `outside`, four above it.

    `skew` 0: reciprocal (K and C symmetric); larger: the more H_xy and H_yx differ.
    """

    def __init__(self, rng: np.random.Generator, skew: float, outside: bool = True):
        n = 10 if outside else 6
        f = 8.0 * np.cumprod(np.append(1.0, rng.uniform(1.15, 1.5, 5)))
        f = np.append(f * min(1.0, 55.0 / f[-1]), [110.0, 140.0, 190.0, 230.0])[:n]
        zeta = np.append(np.exp(rng.uniform(*np.log([0.006, 0.04]), 6)), np.full(4, 0.02))[:n]
        shapes = linalg.qr(rng.normal(size=(n, n)))[0]
        shapes = shapes @ linalg.expm(skew * rng.normal(size=(n, n)))
        back = linalg.inv(shapes)
        w = 2 * np.pi * f
        coupling = 0.3 * rng.normal(size=(n, n)) * (1 - np.eye(n))
        if skew == 0:
            coupling = (coupling + coupling.T) / 2
        rate = np.sqrt(2 * zeta * w)
        damping = rate[:, None] * (np.eye(n) + coupling) * rate
        self.k, self.c = shapes @ np.diag(w**2) @ back, shapes @ damping @ back
        state = np.block([[np.zeros((n, n)), np.eye(n)], [-self.k, -self.c]])
        values, vectors = linalg.eig(state)
        inverse = linalg.inv(vectors)
        chosen = np.flatnonzero((values.imag > 2 * np.pi * 4) & (values.imag < 2 * np.pi * 70))
        chosen = chosen[np.argsort(np.abs(values[chosen]))]
        self.poles = values[chosen]
        residue = vectors[:n, chosen].T[:, :, None] * inverse[chosen, None, n:]
        self.residue = residue[:, POINTS][:, :, POINTS] / 40.0  # as if it weighed 40 kg

    def receptance(self, frequency_hz: np.ndarray) -> np.ndarray:
        """(4, 4, F) in m/N."""
        s = 2j * np.pi * frequency_hz[:, None, None]
        h = np.linalg.inv(s**2 * np.eye(len(self.k)) + s * self.c + self.k)
        return np.moveaxis(h[:, POINTS][:, :, POINTS], 0, -1) / 40.0


def parameters(pole: complex, residue: np.ndarray) -> np.ndarray:
    """Seed 003, eq. 17, of an exact residue φψᵀ with the last element of ψ 1."""
    left, right = residue[0, :-1] / residue[0, -1], residue[:, -1]
    pairs = np.concatenate([left, right])
    pairs = np.stack([pairs.real, pairs.imag], axis=1).ravel()
    return np.append([abs(pole) / (2 * np.pi), -pole.real / abs(pole)], pairs)


def measured(structure: Structure, rng: np.random.Generator, share: float):
    """Accelerance with noise of `share` of each entry's rms, and its variance."""
    h = convert(LINES, structure.receptance(LINES), "receptance", "accelerance")
    variance = np.mean(np.abs(h) ** 2, axis=-1, keepdims=True) * share**2 * np.ones(h.shape)
    noise = rng.normal(size=h.shape) + 1j * rng.normal(size=h.shape)
    return h + noise * np.sqrt(variance / 2), variance


@pytest.mark.parametrize("skew", [0.0, 0.15])
@pytest.mark.parametrize("quantity", ["receptance", "accelerance"])
def test_sixteen_parameters_of_every_mode(skew, quantity):
    structure = Structure(np.random.default_rng(0), skew, outside=False)
    h = convert(LINES, structure.receptance(LINES), "receptance", quantity)
    asymmetry = np.linalg.norm(h - h.swapaxes(0, 1)) / np.linalg.norm(h)
    assert asymmetry < 1e-12 if skew == 0 else asymmetry > 0.2
    found = fit_mdof(LINES, h, quantity)
    assert len(found.modes) == len(structure.poles) == 6
    for mode, pole, residue in zip(found.modes, structure.poles, structure.residue, strict=True):
        assert mode.parameters.size == 16
        assert mode.left[-1] == 1
        np.testing.assert_allclose(mode.parameters, parameters(pole, residue), rtol=1e-6)
        size = np.max(np.abs(residue))
        np.testing.assert_allclose(mode.residue, residue, atol=1e-7 * size)


def test_jacobian_by_finite_differences():
    rng = np.random.default_rng(1)
    structure = Structure(rng, 0.1)
    h, variance = measured(structure, rng, 0.05)
    for symmetric, columns in ((False, 4), (False, 3), (False, 1), (True, 4)):
        data = Data(LINES, h[:, :columns], variance[:, :columns])
        vectors, z = Eigenvectors.of(structure.residue[..., :columns], symmetric)
        x = _join(structure.poles * (1 + 0.002j), z * (1.02 + 0.05j))
        point = _evaluate(data, data.variance, vectors, x)
        scale = 1 / np.sqrt(np.diag(point.hessian))
        for k in rng.choice(x.size, 25, replace=False):
            step = 1e-3 * scale[k] * np.eye(x.size)[k]
            up, down = (_evaluate(data, data.variance, vectors, x + s * step) for s in (1, -1))
            slope = (down.chi2 - up.chi2) / 2e-3 / 2
            expected = point.gradient[k] * scale[k]
            assert slope == pytest.approx(
                expected, abs=1e-4 * np.max(np.abs(point.gradient * scale))
            )


@pytest.mark.parametrize("known", [True, False])
def test_intervals_of_the_parameters_cover_the_truth(known):
    scores, residue_scores, chi2 = [], [], []
    for seed in range(16):
        rng = np.random.default_rng(1000 + seed)
        structure = Structure(rng, 0.1)
        h, variance = measured(structure, rng, rng.uniform(0.01, 0.05))
        found = fit_mdof(LINES, h, "accelerance", variance if known else None)
        assert len(found.modes) == 6
        assert found.converged
        chi2.append(found.chi2 / found.degrees)
        modes = zip(found.modes, structure.poles, structure.residue, strict=True)
        for mode, pole, residue in modes:
            scores.extend((mode.parameters - parameters(pole, residue)) / mode.sd)
            error = mode.residue - residue
            residue_scores.extend((np.stack([error.real, error.imag]) / mode.residue_sd).ravel())
    inside = np.mean(np.abs(scores) < 1.96), np.mean(np.abs(residue_scores) < 1.96)
    print(f"95 % intervals cover {inside[0]:.3f} of parameters, {inside[1]:.3f} of residues")
    assert 0.92 < inside[0] < 0.97
    assert 0.92 < inside[1] < 0.97
    assert np.mean(chi2) == pytest.approx(1.0, abs=0.06)


def test_rank_one_sharpens_what_free_residues_leave_blurred():
    rng = np.random.default_rng(3)
    structure = Structure(rng, 0.1)
    h, variance = measured(structure, rng, 0.05)
    found = fit_mdof(LINES, h, "accelerance", variance)
    free, tied = [], []
    for mode, other, residue in zip(found.modes, found.free.modes, structure.residue, strict=True):
        free.append(np.linalg.norm(other.residue - residue) / np.linalg.norm(residue))
        tied.append(np.linalg.norm(mode.residue - residue) / np.linalg.norm(residue))
    # Seven complex numbers instead of sixteen.
    assert np.mean(tied) < 0.8 * np.mean(free)


def test_a_reciprocal_structure_gives_the_symmetric_fit():
    rng = np.random.default_rng(4)
    structure = Structure(rng, 0.0)
    h, variance = measured(structure, rng, 0.03)
    loose = fit_mdof(LINES, h, "accelerance", variance)
    tied = fit_mdof(LINES, h, "accelerance", variance, symmetric=True)
    assert tied.degrees - loose.degrees == 6 * (16 - 10)
    # χ² rises by one for each of the 36 constraints, if they hold.
    rise = tied.chi2 - loose.chi2
    assert 10 < rise < 75
    for mode, other, pole, residue in zip(
        tied.modes, loose.modes, structure.poles, structure.residue, strict=True
    ):
        np.testing.assert_allclose(mode.residue, mode.residue.T, rtol=1e-9)
        assert np.linalg.matrix_rank(mode.covariance / np.outer(mode.sd, mode.sd), 1e-6) == 10
        assert np.all(mode.sd < 1.03 * other.sd)
        assert np.all(np.abs(mode.parameters - other.parameters) < 5 * other.sd)
        assert np.all(np.abs(mode.parameters - parameters(pole, residue)) < 5 * mode.sd)
    skewed = Structure(np.random.default_rng(5), 0.1)
    h, variance = measured(skewed, rng, 0.03)
    loose = fit_mdof(LINES, h, "accelerance", variance)
    tied = fit_mdof(LINES, h, "accelerance", variance, symmetric=True)
    assert tied.chi2 - loose.chi2 > 1000  # and where it does not, it shows


def test_the_reference_changes_nothing_but_the_scale():
    rng = np.random.default_rng(6)
    structure = Structure(rng, 0.1)
    h, variance = measured(structure, rng, 0.02)
    h, variance = h[:3, :2], variance[:3, :2]
    last, first = (
        fit_mdof(LINES, convert(LINES, h, "accelerance", "mobility"), "mobility",
                 convert_variance(LINES, variance, "accelerance", "mobility"), reference=r)
        for r in (-1, 0)
    )  # fmt: skip
    for a, b in zip(last.modes, first.modes, strict=True):
        assert (a.left[1], b.left[0]) == (1, 1)
        assert a.parameters.size == 2 + 2 + 6
        np.testing.assert_allclose(a.residue, b.residue, rtol=1e-8)
        np.testing.assert_allclose(a.residue_sd, b.residue_sd, rtol=1e-6)


def test_records_under_a_window_that_end_early():
    """Transforms of the impulse responses, windowed and cut, of two rows and all columns."""
    rng = np.random.default_rng(8)
    structure = Structure(rng, 0.1, outside=False)
    rate, tail_s = 1.5, 1.2
    s = 2j * np.pi * LINES + rate
    h = np.zeros((4, 4, LINES.size), complex)
    for pole, residue in zip(structure.poles, structure.residue, strict=True):
        for p, r in ((pole, residue), (pole.conj(), residue.conj())):
            cut = p**2 * (1 - np.exp((p - s) * tail_s)) / (s - p) + s + p
            h += r[..., None] * cut
    found = fit_mdof(LINES, h[:2], rate_1_s=rate, tail_s=tail_s)
    for mode, pole, residue in zip(found.modes, structure.poles, structure.residue, strict=True):
        np.testing.assert_allclose(mode.parameters, parameters(pole, residue[:2]), rtol=1e-5)


def test_bad_matrices_are_refused_in_words():
    h = np.ones((2, 3, LINES.size), complex)
    with pytest.raises(InputError, match="as many outputs as inputs"):
        fit_mdof(LINES, h, symmetric=True)
    with pytest.raises(InputError, match="no input 3"):
        fit_mdof(LINES, h, reference=3)
    with pytest.raises(InputError, match="outputs × inputs × lines"):
        fit_mdof(LINES, h[0])
    with pytest.raises(InputError, match="missing values"):
        fit_mdof(LINES, np.full_like(h, np.nan))
    with pytest.raises(InputError, match="evenly spaced"):
        fit_mdof(LINES[:5], h[..., :5])
    with pytest.raises(InputError, match="variance"):
        fit_mdof(LINES, h, variance=np.zeros(h.shape))
    with pytest.raises(InputError, match="not known"):
        fit_mdof(LINES, h, "compliance")
    rng = np.random.default_rng(7)
    noise = rng.normal(size=h.shape) + 1j * rng.normal(size=h.shape)
    with pytest.raises(RefusedError, match="No mode"):
        fit_mdof(LINES, noise, variance=np.full(h.shape, 2.0))
