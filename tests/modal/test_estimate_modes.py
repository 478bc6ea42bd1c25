"""Modes of random systems with known poles, found without being told anything; beside a peer.

The peer, sdypy-EMA, has a user who is told the true frequencies.
"""

import contextlib
import io
import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from planner.errors import RefusedError
from planner.modal.estimate_modes import estimate_modes
from planner.modal.mac import mac
from tests.support.modal_systems import (
    System,
    as_frf,
    exact_frf,
    matched,
    noisy,
    random_system,
    scores,
)

LINES = np.arange(2.0, 80.0, 0.2)
BAND = (4.0, 60.0)


def frequencies(model) -> np.ndarray:
    return np.array([mode.frequency_hz for mode in model.modes])


def dampings(model) -> np.ndarray:
    return np.array([mode.damping_ratio for mode in model.modes])


def seen(h: np.ndarray, share: float, rng: np.random.Generator, band=BAND):
    """The modes of FRFs with noise of a share of the rms of each, its variance told."""
    spoiled, variance = noisy(h, share, rng)
    return estimate_modes(as_frf(LINES, spoiled, variance), band)


def check_exact(model, system: System, columns: Sequence[int] = (0, 1, 2)) -> None:
    np.testing.assert_allclose(frequencies(model), system.frequency_hz, rtol=1e-7)
    np.testing.assert_allclose(dampings(model), system.damping_ratio, rtol=1e-6)
    for mode, residue in zip(model.modes, system.residues, strict=True):
        hit, size = list(columns), np.max(np.abs(residue))
        np.testing.assert_allclose(mode.residue[:, hit], residue[:, hit], atol=1e-6 * size)


def lost_and_extra(model, system: System) -> np.ndarray:
    """True modes that were not found, and found ones that are none."""
    found = matched(model.modes, system)
    lost = found.count(None)
    return np.array([lost, len(model.modes) - len(found) + lost])


@pytest.mark.parametrize("columns", [(0,), (0, 2), (0, 1, 2)])
@pytest.mark.parametrize("modes", [1, 4, 9])
def test_clean_data_is_recovered_exactly(columns, modes):
    system = random_system(np.random.default_rng(modes), modes, complexity=0.3)
    model = estimate_modes(as_frf(LINES, exact_frf(system, LINES), columns=columns), BAND)
    check_exact(model, system, columns)
    assert model.fit_error < 1e-6
    for mode, residue in zip(model.modes, system.residues, strict=True):
        missed = [c for c in range(3) if c not in columns]
        assert np.all(np.isnan(mode.residue[:, missed]))
        assert np.all(np.isnan(mode.residue_sd[:, missed]))
        assert mac(mode.shape, np.linalg.svd(residue)[0][:, 0]) > 1 - 1e-6


@pytest.mark.parametrize("rate", [0.5, 3.0])
@pytest.mark.parametrize("columns", [(1,), (0, 1, 2)])
def test_exponential_window_is_corrected_exactly(rate, columns):
    system = random_system(np.random.default_rng(7), 4, damping=(0.003, 0.03), complexity=0.3)
    h = exact_frf(system, LINES, rate)
    model = estimate_modes(as_frf(LINES, h, columns=columns, rate_1_s=rate), BAND)
    check_exact(model, system, columns)


@pytest.mark.parametrize("known", [True, False])
def test_intervals_cover_the_truth(known):
    """95 % intervals of frequency, damping and residues, 1-5 % noise, variance told or not."""
    of_poles, of_residues, wrong = [], [], np.zeros(2)
    for seed in range(20):
        rng = np.random.default_rng(100 + seed)
        system = random_system(rng, int(rng.integers(2, 7)), complexity=0.2)
        h, variance = noisy(exact_frf(system, LINES), rng.uniform(0.01, 0.05), rng)
        model = estimate_modes(as_frf(LINES, h, variance if known else None), BAND)
        wrong += lost_and_extra(model, system)
        poles, residues = scores(model.modes, system)
        of_poles, of_residues = of_poles + poles, of_residues + residues
    assert np.max(wrong) <= 1
    assert 0.90 < np.mean(np.abs(of_poles) < 1.96) < 0.98
    assert 0.90 < np.mean(np.abs(of_residues) < 1.96) < 0.98


def test_close_modes_are_told_apart():
    """Pairs 1 to 2 % apart with differing shapes, 1-3 % damping, 2 % noise."""
    found = total = 0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        system = random_system(rng, 4, damping=(0.01, 0.03), pair=rng.uniform(0.01, 0.02))
        model = seen(exact_frf(system, LINES), 0.02, rng)
        for i, mode in enumerate(matched(model.modes, system)):
            total += 1
            if mode is not None and abs(mode.frequency_hz / system.frequency_hz[i] - 1) < 0.003:
                found += abs(mode.damping_ratio / system.damping_ratio[i] - 1) < 0.1
        assert len(model.modes) == 4
    assert found >= 0.97 * total


def test_modes_outside_the_band_do_not_become_modes_in_it():
    inside = random_system(np.random.default_rng(3), 3, (10.0, 40.0), damping=(0.01, 0.03))
    outside = System(
        np.array([3.0, 62.0, 150.0]),
        np.full(3, 0.02),
        np.concatenate([inside.residues[:1]] * 3) * np.array([5.0, 3.0, 10.0])[:, None, None],
    )
    whole = System(
        *(
            np.concatenate([getattr(inside, n), getattr(outside, n)])
            for n in ("frequency_hz", "damping_ratio", "residues")
        )
    )
    model = seen(exact_frf(whole, LINES), 0.01, np.random.default_rng(4), (8.0, 50.0))
    assert len(model.modes) == 3
    np.testing.assert_allclose(frequencies(model), inside.frequency_hz, rtol=2e-3)
    np.testing.assert_allclose(dampings(model), inside.damping_ratio, rtol=0.1)


def test_scatter_between_lines_unlike_the_stated_variance_enlarges_the_sd():
    rng = np.random.default_rng(5)
    system = random_system(rng, 3, damping=(0.01, 0.03))
    h, variance = noisy(exact_frf(system, LINES), 0.05, rng)
    honest = estimate_modes(as_frf(LINES, h, variance), BAND)
    boasting = estimate_modes(as_frf(LINES, h, variance / 100), BAND)
    assert len(boasting.modes) == 3
    for a, b in zip(honest.modes, boasting.modes, strict=True):
        assert b.frequency_sd_hz == pytest.approx(a.frequency_sd_hz, rel=0.5)
    assert any("enlarged" in remark for remark in boasting.remarks)


def test_sds_do_not_hang_on_the_band():
    """Lines cut off to check the model may be all that hold a mode near the band's edge."""
    for seed in range(2):
        rng = np.random.default_rng(seed)
        system = random_system(rng, 5, (8.0, 60.0), damping=(0.01, 0.04))
        h, variance = noisy(exact_frf(system, LINES), 0.003, rng)
        first, last = system.frequency_hz[[0, -1]]
        lows, highs = first * rng.uniform(0.5, 0.9, 8), last * rng.uniform(1.1, 1.25, 8)
        bands = zip(lows, highs, strict=True)
        models = [estimate_modes(as_frf(LINES, h, variance), band) for band in bands]
        lowest = [m.modes[int(np.argmin(np.abs(frequencies(m) - first)))] for m in models]
        sds = [mode.frequency_sd_hz for mode in lowest]
        assert np.max(sds) < 2 * np.min(sds)


def truncated(system: System, tail_s: float) -> np.ndarray:
    """Accelerance from records of an impulse that end `tail_s` after it, mode by mode."""
    s = 2j * np.pi * LINES
    out = np.zeros((3, 3, LINES.size), complex)
    for pole, r in zip(system.poles, system.residues, strict=True):
        for p, c in ((pole, r), (pole.conj(), r.conj())):
            # Decay p²c·e^{pt} cut off at tail_s; the impulse part s + p is not affected.
            part = p**2 * (1 - np.exp((p - s) * tail_s)) / (s - p) + s + p
            out += c[..., None] * part
    return out


@pytest.mark.parametrize("tail_s", [0.9, 2.0])
def test_records_that_end_early_are_exact(tail_s):
    system = random_system(np.random.default_rng(9), 4, damping=(0.003, 0.02), complexity=0.2)
    frf = replace(as_frf(LINES, truncated(system, tail_s)), tail_s=tail_s)
    check_exact(estimate_modes(frf, BAND), system)


def test_hit_directions_that_disagree_do_not_split_a_mode():
    """Frequencies 0.3 % higher in the z column: as many modes as there are, each in between."""
    wrong = np.zeros(2)
    for seed in range(5):
        rng = np.random.default_rng(50 + seed)
        system = random_system(rng, 4, damping=(0.005, 0.03), complexity=0.1)
        moved = System(system.frequency_hz * 1.003, system.damping_ratio, system.residues)
        h = exact_frf(system, LINES)
        h[:, 2] = exact_frf(moved, LINES)[:, 2]
        wrong += lost_and_extra(seen(h, 0.005, rng), system)
    assert np.max(wrong) <= 1


def test_ripple_makes_no_likely_modes():
    """A 3 % ripple over the FRFs (cable, double hit) that no modal model explains."""
    likely = 0
    for seed in range(3):
        rng = np.random.default_rng(80 + seed)
        system = random_system(rng, 4, damping=(0.005, 0.03))
        h, variance = noisy(exact_frf(system, LINES), 0.005, rng)
        ripple = 1 + 0.03 * np.sin(LINES * rng.uniform(0.3, 2.0) + rng.uniform(0, 6))
        model = estimate_modes(as_frf(LINES, h * ripple, variance), BAND)
        assert None not in matched(model.modes, system)
        likely += sum(m.probability > 0.5 for m in model.modes) - 4
    assert likely <= 1


def test_noise_alone_is_refused():
    for seed in range(6):
        rng = np.random.default_rng(seed)
        h = rng.normal(size=(3, 3, LINES.size)) + 1j * rng.normal(size=(3, 3, LINES.size))
        with pytest.raises(RefusedError, match="No mode"):
            estimate_modes(as_frf(LINES, h, np.full(h.shape, 2.0)), BAND)


def test_too_few_lines_are_refused():
    system = random_system(np.random.default_rng(0), 2)
    h = exact_frf(system, LINES)
    with pytest.raises(RefusedError, match="usable frequency lines"):
        estimate_modes(as_frf(LINES[::10], h[..., ::10]), (20.0, 22.0))
    with pytest.raises(RefusedError, match="usable frequency lines"):
        estimate_modes(as_frf(LINES, h, columns=()), BAND)
    with pytest.raises(RefusedError, match="usable frequency lines"):
        estimate_modes(as_frf(LINES, 0 * h), BAND)


FINE = np.arange(2.0, 80.0, 0.1)


def peer_poles(h: np.ndarray, guesses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies and damping ratios that its user would pick nearest the guesses."""
    from sdypy import EMA

    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        model = EMA.Model(
            h.reshape(9, -1), FINE, lower=FINE[0], upper=FINE[-1], pol_order_high=40,
            frf_form="accelerance",
        )  # fmt: skip
        model.get_poles(show_progress=False)
        model.select_closest_poles(list(guesses), f_window=2)
    return np.asarray(model.nat_freq), np.asarray(model.nat_xi)


def good(frequency: np.ndarray, zeta: np.ndarray, system) -> int:
    """True modes with a found one within 0.3 % in frequency and 10 % in damping."""
    near = np.abs(frequency[None] / system.frequency_hz[:, None] - 1) < 0.003
    near &= np.abs(zeta[None] / system.damping_ratio[:, None] - 1) < 0.1
    return int(np.sum(np.any(near, axis=1)))


def test_clean_poles_agree_with_the_peer():
    system = random_system(np.random.default_rng(0), 4, damping=(0.01, 0.03), spacing=0.3)
    h = exact_frf(system, FINE)
    frequency, zeta = peer_poles(h, system.frequency_hz)
    model = estimate_modes(as_frf(FINE, h), BAND)
    ours = np.array([(m.frequency_hz, m.damping_ratio) for m in model.modes])
    order = np.argsort(frequency)
    np.testing.assert_allclose(frequency[order], ours[:, 0], rtol=1e-3)
    np.testing.assert_allclose(zeta[order], ours[:, 1], rtol=5e-2)


@pytest.mark.parametrize("share", [0.01, 0.05])
def test_no_fewer_true_poles_than_the_peer_with_a_user(share):
    ours = theirs = total = 0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        system = random_system(rng, 6, damping=(0.005, 0.05), pair=0.02 if seed % 2 else None)
        h, variance = noisy(exact_frf(system, FINE), share, rng)
        frequency, zeta = peer_poles(h, system.frequency_hz)
        theirs += good(frequency, zeta, system)
        model = estimate_modes(as_frf(FINE, h, variance), BAND)
        found = np.array([(m.frequency_hz, m.damping_ratio) for m in model.modes])
        ours += good(found[:, 0], found[:, 1], system)
        total += 6
    assert ours >= theirs
    assert ours >= 0.97 * total
