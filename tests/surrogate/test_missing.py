"""What is not known is said to be unknown; FRFs with uncertainty."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np

from planner.frf import synthesis
from planner.surrogate.frf_bands import LARGEST_DAMPING, frf_moments, log_normal
from planner.surrogate.importance import normal_points
from planner.surrogate.modal_surrogate import fit_surrogate
from tests.support.surrogates import observed, simulated, true_hz

X = np.random.default_rng(4).random((20, 2))


def without(low, pose, mode):
    """The same simulation without one mode at a pose (or at all: slice)."""
    f = low.frequency_hz.copy()
    f[pose, mode] = np.nan
    return replace(low, frequency_hz=f)


def test_where_the_simulation_lacks_a_mode_the_prediction_is_wide():
    s = fit_surrogate(observed(5, 0))
    full, holed = s.predict(X, simulated(X)), s.predict(X, without(simulated(X), 3, 2))
    off = abs(holed.frequency_hz[3, 2] - true_hz(X, 1.12)[3, 2])
    assert off < 1.96 * holed.frequency_sd_hz[3, 2]
    assert holed.frequency_sd_hz[3, 2] > 10 * full.frequency_sd_hz[3, 2]
    rest = np.ones((20, 4), bool)
    rest[3, 2] = False
    np.testing.assert_array_equal(holed.frequency_sd_hz[rest], full.frequency_sd_hz[rest])
    np.testing.assert_array_equal(holed.frequency_hz[rest], full.frequency_hz[rest])


def test_before_any_measurement_a_mode_nobody_simulates_is_unknown():
    p = fit_surrogate(observed(0, 0)).predict(X, without(simulated(X), slice(None), 3))
    relative = p.frequency_sd_hz / p.frequency_hz
    assert (relative[:, 3] > 1).all()
    assert (relative[:, :3] < 0.5).all()


def test_one_gap_in_the_simulation_does_not_switch_it_off():
    """One pose without a simulated mode 3: as accurate as without the gap, and no surer."""
    errors, sds = [], []
    for seed in range(1):
        seen = observed(6, seed)
        unseen = seen.frequency_hz.copy()
        unseen[1, 2] = np.nan
        gap = replace(seen, simulated=without(seen.simulated, 1, 2))
        row = []
        for case in (seen, gap, replace(gap, frequency_hz=unseen)):
            s = fit_surrogate(case)
            assert s.primary.most_probable.uses_low[:4].all()
            p = s.predict(X, simulated(X))
            off = (p.frequency_hz / true_hz(X, 1.12) - 1)[:, 2]
            sd = (p.frequency_sd_hz / p.frequency_hz)[:, 2]
            row.append((np.sqrt(np.mean(off**2)), np.mean(sd)))
        errors.append([error for error, _ in row])
        sds.append([sd for _, sd in row])
    full, gap, unseen = np.median(errors, axis=0)
    assert max(gap, unseen) < 1.6 * full
    full, gap, unseen = np.mean(sds, axis=0)
    assert min(gap, unseen) > full


def test_a_mode_that_is_mostly_not_simulated_is_learned_from_the_hits_alone():
    seen = observed(8, 0)
    s = fit_surrogate(replace(seen, simulated=without(seen.simulated, slice(0, 6), 2)))
    assert s.primary.most_probable.uses_low[:4].tolist() == [True, True, False, True]
    p = s.predict(X, simulated(X))
    assert (
        np.mean(np.abs(p.frequency_hz - true_hz(X, 1.12))[:, 2] < 2 * p.frequency_sd_hz[:, 2]) > 0.8
    )


def test_a_measurement_without_sd_still_counts():
    seen = observed(6, 0)
    p = fit_surrogate(replace(seen, frequency_sd_hz=np.full((6, 4), np.nan))).predict(
        X, simulated(X)
    )
    before = fit_surrogate(observed(0, 0)).predict(X, simulated(X))
    assert (p.frequency_sd_hz < 0.5 * before.frequency_sd_hz).all()
    np.testing.assert_allclose(p.frequency_hz, true_hz(X, 1.12), rtol=0.05)


def test_a_mode_fitted_with_no_damping_keeps_its_frequency():
    seen = observed(6, 0)
    zeta = seen.damping_ratio.copy()
    zeta[2, 1], zeta[3, 1] = 0.0, -0.01
    p = fit_surrogate(replace(seen, damping_ratio=zeta)).predict(X, simulated(X))
    same = fit_surrogate(seen).predict(X, simulated(X))
    np.testing.assert_array_equal(p.frequency_hz, same.frequency_hz)
    assert (p.damping_ratio > 0.01).all()


def test_residues_of_an_axis_that_was_not_hit_are_the_simulations():
    """np.nan put into complex numbers is nan + 0j: no imaginary part was measured to be 0."""
    seen = observed(6, 0)
    residue = seen.residue.copy()
    residue[..., 2] = np.nan
    p = fit_surrogate(replace(seen, residue=residue)).predict(X, simulated(X))
    np.testing.assert_allclose(p.residue[..., 2], simulated(X).residue[..., 2], atol=1e-12)


def test_a_cache_that_cannot_be_kept_is_no_trouble(tmp_path):
    (tmp_path / "planner").write_text("")  # a file where the folder should be
    code = (
        "from planner import jax_setup; "
        "jax_setup.KEEP['jax_persistent_cache_min_compile_time_secs'] = 0; "
        "print(jax_setup.compiled()(lambda a: a + 1.0)(1.0), jax_setup._folder())"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env={**os.environ, "XDG_CACHE_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    assert done.stdout.split() == ["2.0", "None"]


LINES = np.linspace(4, 50, 20)


def sampled(p, samples=10_000):
    """Mean and sd (q, 3, 3, F) by scrambled Sobol points, as in Busch et al. 2022, section 3.4."""
    q, k = p.frequency_hz.shape
    normal = normal_points(samples, 20 * k, 0)
    zr = normal[:, 2 * k :].reshape(samples, k, 3, 3, 2)
    means, sds = [], []
    for i in range(q):
        f = log_normal(p.frequency_hz[i], p.frequency_sd_hz[i], normal[:, :k])
        zeta = log_normal(p.damping_ratio[i], p.damping_sd[i], normal[:, k : 2 * k])
        residue = p.residue[i] + p.residue_sd[i] * (zr[..., 0] + 1j * zr[..., 1])
        poles = synthesis.pole(f, np.minimum(zeta, LARGEST_DAMPING))
        lines = [synthesis.accelerance(LINES[[j]], poles, residue) for j in range(len(LINES))]
        h = np.concatenate(lines, axis=-1)
        means.append(h.mean(axis=0))
        sds.append(h.std(axis=0))
    return np.array(means), np.array(sds)


def test_moments_are_those_of_ten_thousand_samples():
    x = np.random.default_rng(0).random((2, 2))
    p = fit_surrogate(observed(5, 0)).predict(x, simulated(x))
    p = replace(p, frequency_sd_hz=0.05 * p.frequency_hz)
    (mean, sd), (many, many_sd) = frf_moments(p, LINES), sampled(p)
    size = np.sqrt(np.mean(np.abs(many) ** 2, axis=-1, keepdims=True))
    off = np.abs(sd / many_sd - 1)
    assert np.max(np.abs(mean - many) / size) < 0.002
    assert np.median(off) < 0.002
    assert np.max(off) < 0.02
