"""Side by side with sdypy-EMA on the same FRFs, whose user is told the true frequencies."""

import contextlib
import io
import warnings

import numpy as np
import pytest

from planner.modal.estimate_modes import estimate_modes
from tests.support.modal_systems import as_frf, exact_frf, noisy, random_system

BAND, LINES = (4.0, 60.0), np.arange(2.0, 80.0, 0.1)


def peer_poles(h: np.ndarray, guesses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies and damping ratios that its user would pick nearest the guesses."""
    from sdypy import EMA

    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        model = EMA.Model(
            h.reshape(9, -1), LINES, lower=LINES[0], upper=LINES[-1], pol_order_high=40,
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
    h = exact_frf(system, LINES)
    frequency, zeta = peer_poles(h, system.frequency_hz)
    model = estimate_modes(as_frf(LINES, h), BAND)
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
        h, variance = noisy(exact_frf(system, LINES), share, rng)
        frequency, zeta = peer_poles(h, system.frequency_hz)
        theirs += good(frequency, zeta, system)
        model = estimate_modes(as_frf(LINES, h, variance), BAND)
        found = np.array([(m.frequency_hz, m.damping_ratio) for m in model.modes])
        ours += good(found[:, 0], found[:, 1], system)
        total += 6
    assert ours >= theirs
    assert ours >= 0.97 * total
