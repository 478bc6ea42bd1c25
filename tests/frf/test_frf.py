"""FRFs of hits against the exact FRF, their own variance and pyFRF; unequal hits weighted.

FRFs of files are used only with units, one grid and directions; conversions of quantities.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.errors import InputError, RefusedError
from planner.frf.estimator import estimate
from planner.frf.matrix import from_records, labelled_frfs, matrix_of
from planner.frf.synthesis import DERIVATIVE, convert
from planner.milling import cutter_frf, tip_files
from planner.milling.tool import Point, Tool
from planner.recording.records import End, FrfRecord, Hit
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
    assert 0.7 < np.mean(ratio) < 1.5


@pytest.mark.parametrize("rumble", [0.0, 0.5, 3.0])
def test_variance_of_a_hit_holds_where_the_floor_rumbles(rumble):
    """A slow sway, and what it leaves in the offset that is subtracted, are no white noise."""
    rng, ratios = np.random.default_rng(7), []
    for _ in range(6):
        hits = []
        for hit in hits_of(rng, 0.05, 2, record_s=3.0):
            t = np.arange(hit.acceleration_m_s2.shape[1]) / hit.sampling_rate_hz
            sway = np.sin(2 * np.pi * 4.3 * t + rng.uniform(0, 7, (3, 1)))
            slow = rumble * np.std(hit.acceleration_m_s2[:, -64:]) * sway
            hits.append(replace(hit, acceleration_m_s2=hit.acceleration_m_s2 + slow))
        frf = estimate(tuple(hits), BAND, "one_hit", 5.5 / 3.0)
        s = 2j * np.pi * frf.frequency_hz + frf.exponential_rate_1_s
        exact = exact_accelerance(s / (2j * np.pi))
        error = np.abs(frf.accelerance - exact) ** 2 / frf.variance
        low = (frf.frequency_hz > 5) & (frf.frequency_hz < 12)
        ratios.append([error[..., low].mean(), error[..., (frf.frequency_hz > 20)].mean()])
    low, high = np.mean(ratios, axis=0)
    assert 0.4 < low < 2.5
    assert 0.5 < high < 2.0


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
    assert own <= 1.1 * other


def test_mixed_rates_are_refused():
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


def unequal_hits(rng, noise=0.02):
    """Hits of 0.4, 1 and 2.5 times a middling force on a mass-less mixing of the force."""
    t = np.arange(1024) / 400.0
    found = []
    for axis in "xyz":
        for level in (0.4, 1.0, 2.5):
            phase = np.clip((t - 0.06) / 0.02, 0, 1)
            force = 100 * level * np.sin(np.pi * phase) ** 2
            ring = np.exp(-6 * t) * np.sin(2 * np.pi * 15 * t)
            response = np.convolve(force, ring)[:1024] / 400.0
            clean = np.outer([1.0, 0.5, 2.0], response)
            size = noise * np.sqrt(np.mean(clean**2, axis=1).max())
            noisy = clean + size * rng.standard_normal(clean.shape)
            found.append(Hit(Path("x"), f"+{axis}", 400.0, force, noisy))
    return tuple(found)


def misfit(make, seeds=12):
    """Mean |δH|² over its stated variance, 1 where that is honest, and the true error."""
    clean = make(unequal_hits(np.random.default_rng(0), 0.0))
    ratios, errors = [], []
    for seed in range(seeds):
        frf = make(unequal_hits(np.random.default_rng(seed + 1)))
        used = (frf.frequency_hz > 4) & (frf.frequency_hz < 60)
        error = np.abs(frf.accelerance - clean.accelerance)[..., used] ** 2
        ratios.append(np.mean(error / frf.variance[..., used]))
        errors.append(np.mean(error))
    return np.mean(ratios), np.mean(errors)


def test_variance_is_honest_and_error_smaller_than_that_of_h1():
    ratio, error = misfit(lambda h: estimate(h, BAND, "weighted", 2.0))
    plain_ratio, plain_error = misfit(lambda h: estimate(h, BAND, exponential_rate_1_s=2.0))
    assert 0.8 < ratio < 1.25
    assert plain_ratio > ratio
    assert error < 0.8 * plain_error


LINES = np.arange(0.0, 100.0, 2.0)
TOOL = Tool("rod", (0.0, 0.0, 1.0), (), (Point("1", 0.0), Point("5", 0.02)))


def record(name: str, lines: np.ndarray = LINES, **changes) -> FrfRecord:
    """x and y, hit and felt at node 1."""
    places = tuple((End("1", i), End("1", j)) for i in (1, -2) for j in (1, 2))
    return replace(
        FrfRecord(
            Path(name), lines, np.ones((4, len(lines)), complex), places,
            "accelerance", "m/s^2/N", np.ones((4, len(lines))),
        ), **changes,
    )  # fmt: skip


def placed(response_node: str, response: int, hit: int) -> FrfRecord:
    """The second FRF is at another place."""
    first, _, *others = record("").places
    place = (End(response_node, response), End("1", hit))
    return record("b.uff", places=(first, place, *others))


SHIFTED = record("b.uff", LINES + 0.5)


@pytest.mark.parametrize(
    ("second", "words"),
    [
        (SHIFTED, "b.uff has other frequency lines than a.uff; export one grid."),
        (record("b.uff", LINES[1:]), "export one grid"),
        (record("a.uff", LINES + 0.5), "a.uff mixes frequency lines; export one grid."),
        (record("b.uff", unit=""), "b.uff: it is not stated .* label them."),
        (record("b.uff", quantity="unknown"), "b.uff: it is not stated .* label them."),
        (placed("1", 0, 1), "b.uff: FRF 2 does not .* label them."),
        (placed("1", 1, 4), "b.uff: FRF 2 does not .* label them."),
    ],
)
def test_what_is_not_as_it_must_be_is_refused(second, words):
    for refusal in (InputError, RefusedError):
        with pytest.raises(refusal, match=words):
            labelled_frfs((record("a.uff"), second), "receptance", refusal)


def test_every_use_refuses_another_grid_of_the_same_length(tmp_path, monkeypatch):
    records = record("a.uff"), SHIFTED
    for made_of in (from_records, matrix_of):
        with pytest.raises(RefusedError, match="export one grid"):
            made_of(records)
    path = tmp_path / "a.uff"
    path.touch()
    for module in (tip_files, cutter_frf):
        monkeypatch.setattr(module, "read_frfs", lambda *_: records)
    with pytest.raises(InputError, match="export one grid"):
        tip_files.read_tip(path, TOOL, None, 0.0)
    with pytest.raises(InputError, match="export one grid"):
        cutter_frf.read_frf(path, None)


def test_lines_as_headers_round_them_are_the_same():
    lines, frfs = labelled_frfs(
        (record("a.uff"), record("b.uff", LINES * (1 + 1e-5))), "receptance", InputError
    )
    assert lines == pytest.approx(LINES[1:])
    assert [one[:2] for one in frfs[1:3]] == [(("1", 0), ("1", 1)), (("1", 1), ("1", 0))]
    assert frfs[2][2] == pytest.approx(1 / (2 * np.pi * lines) ** 2)


def test_what_other_nodes_and_rotations_have_is_left_out_where_nodes_are_named():
    others = placed("7", 1, 1), placed("1", 5, 1)
    _, frfs = labelled_frfs(others, "receptance", InputError, frozenset(("1", "5")))
    assert [felt for felt, *_ in frfs] == [("1", 0), ("1", 1), ("1", 1)] * 2


KINDS = st.sampled_from(sorted(DERIVATIVE))


def test_oscillator_of_known_mass_damping_and_stiffness():
    f = np.linspace(1.0, 60.0, 200)
    w, m, c, k = 2 * np.pi * f, 40.0, 300.0, 6e5
    receptance = 1 / (k - m * w**2 + 1j * c * w)
    # Force over motion instead, written out: dynamic mass and impedance.
    accelerance = 1 / (m + c / (1j * w) - k / w**2)
    mobility = 1 / (1j * w * m + c + k / (1j * w))
    np.testing.assert_allclose(convert(f, receptance, "receptance", "mobility"), mobility)
    np.testing.assert_allclose(convert(f, mobility, "mobility", "accelerance"), accelerance)
    np.testing.assert_allclose(convert(f, accelerance, "accelerance", "receptance"), receptance)


@settings(max_examples=30, deadline=None)
@given(KINDS, KINDS, KINDS, st.integers(0, 2**31))
def test_conversions_compose(a, b, c, seed):
    rng = np.random.default_rng(seed)
    f = np.sort(rng.uniform(0.5, 2000.0, 9))
    h = rng.normal(size=(2, 3, 9)) + 1j * rng.normal(size=(2, 3, 9))
    direct = convert(f, h, a, c)
    np.testing.assert_allclose(convert(f, convert(f, h, a, b), b, c), direct, rtol=1e-12)
    np.testing.assert_allclose(convert(f, direct, c, a), h, rtol=1e-12)


def test_what_cannot_be_converted_is_said():
    f, h = np.array([0.0, 1.0]), np.ones(2, complex)
    assert convert(f, h, "receptance", "accelerance")[0] == 0
    with pytest.raises(InputError, match="0 Hz of accelerance"):
        convert(f, h, "accelerance", "mobility")
    with pytest.raises(InputError, match="'compliance' is not known"):
        convert(f, h, "compliance", "mobility")
