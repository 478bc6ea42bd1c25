"""FRF estimation against the exact FRF, its own variance, and pyFRF."""

import numpy as np
import pytest

from planner.errors import RefusedError
from planner.frf.estimator import estimate
from planner.frf.exported import from_records
from planner.modal.estimate_modes import estimate_modes
from planner.recording.records import End, FrfRecord
from tests.support.simulated_hits import RATE_HZ, exact_accelerance, make_hit

BAND = (4.0, 60.0)


def hits_of(rng, noise, repeats=4, axes=("+x", "-y", "+z"), record_s=6.0):
    return tuple(
        make_hit(rng, axis, noise=noise, record_s=record_s) for axis in axes for _ in range(repeats)
    )


@pytest.mark.parametrize("estimator", ["h1", "h2", "hv"])
def test_noise_free_records_give_the_exact_frf(estimator):
    frf = estimate(hits_of(np.random.default_rng(0), 0.0), BAND, estimator)
    inside = (frf.frequency_hz > 4) & (frf.frequency_hz < 60)
    exact = exact_accelerance(frf.frequency_hz)
    error = np.abs(frf.accelerance - exact)[..., inside].max() / np.abs(exact).max()
    assert error < 5e-3
    assert frf.hits == (4, 4, 4)
    assert np.nanmin(frf.coherence) >= 0
    assert np.nanmax(frf.coherence) <= 1


@pytest.mark.parametrize("repeats", [1, 4])
def test_stated_variance_is_the_scatter(repeats):
    rng = np.random.default_rng(1)
    ratio = []
    for _ in range(12):
        frf = estimate(hits_of(rng, 0.05, repeats, ("+x",)), BAND)
        inside = (frf.frequency_hz > 4) & (frf.frequency_hz < 60)
        error = frf.accelerance[:, 0] - exact_accelerance(frf.frequency_hz)[:, 0]
        ratio.append(np.mean(np.abs(error[:, inside]) ** 2 / frf.variance[:, 0, inside]))
    print(f"scatter over stated variance: {np.mean(ratio):.2f}")
    assert 0.7 < np.mean(ratio) < 1.5


def test_pyfrf_agrees():
    from pyFRF import FRF

    rng = np.random.default_rng(2)
    hits = hits_of(rng, 0.03, 4, ("+x",), record_s=4.0)
    n = min(h.force_n.size for h in hits)
    peer = FRF(sampling_freq=int(RATE_HZ), exc=np.array([h.force_n[None, :n] for h in hits]),
               resp=np.array([h.acceleration_m_s2[:, :n] for h in hits]), exc_type="f",
               resp_type="a", window="none")  # fmt: skip
    frequency = peer.get_f_axis()
    theirs = peer.get_H1()[:, 0] * (2j * np.pi * frequency) ** 2  # it gives receptance
    ours = estimate(hits, BAND)
    inside = (ours.frequency_hz > 5) & (ours.frequency_hz < 58)
    at = np.abs(np.interp(ours.frequency_hz[inside], frequency, np.abs(theirs[0])))
    mine = np.abs(ours.accelerance[0, 0, inside])
    # The peer keeps the force's noise between pulses; beside resonances it shows.
    assert np.median(np.abs(at - mine)) < 0.02 * mine.max()
    # Which of the two is nearer to the truth?
    exact = exact_accelerance(ours.frequency_hz[inside])[0, 0]
    own = np.linalg.norm(ours.accelerance[0, 0, inside] - exact)
    other = np.linalg.norm(
        np.interp(ours.frequency_hz[inside], frequency, theirs[0].real)
        + 1j * np.interp(ours.frequency_hz[inside], frequency, theirs[0].imag) - exact
    )  # fmt: skip
    print(f"error {own / np.linalg.norm(exact):.3f}, pyFRF {other / np.linalg.norm(exact):.3f}")
    assert own <= 1.1 * other


def test_mixed_rates_are_refused():
    from dataclasses import replace

    rng = np.random.default_rng(3)
    hits = (make_hit(rng), replace(make_hit(rng), sampling_rate_hz=1000.0))
    with pytest.raises(RefusedError, match="sampling rates"):
        estimate(hits, BAND)


def test_exported_receptance_becomes_accelerance():
    f = np.linspace(0, 80, 161)
    with np.errstate(divide="ignore", invalid="ignore"):
        receptance = exact_accelerance(f) / (2j * np.pi * f) ** 2
    receptance[..., 0] = 0
    pairs = [(i, j) for i in range(3) for j in range(3)]
    record = FrfRecord(
        make_hit(np.random.default_rng(0)).source, f, np.array([receptance[p] for p in pairs]),
        tuple((End("", i + 1), End("", -(j + 1))) for i, j in pairs), "receptance", "m/N",
        np.full((9, f.size), np.nan),
    )  # fmt: skip
    frf = from_records((record,))
    np.testing.assert_allclose(frf.accelerance, -exact_accelerance(frf.frequency_hz), rtol=1e-10)


@pytest.mark.parametrize("record_s", [6.0, 1.5])
def test_damping_is_right_with_and_without_an_exponential_window(record_s):
    """Also where the record ends long before the decay does."""
    hits = hits_of(np.random.default_rng(5), 0.01, 3, record_s=record_s)
    for rate in (0.0, 3.0):
        frf = estimate(hits, BAND, exponential_rate_1_s=rate)
        assert frf.exponential_rate_1_s == rate
        modes = estimate_modes(frf, BAND).modes
        assert [m.frequency_hz for m in modes] == pytest.approx([11.0, 27.0], rel=2e-3)
        assert [m.damping_ratio for m in modes] == pytest.approx([0.025, 0.025], rel=0.05)
