"""The pictures of a modal analysis hold its data, and their labels can be read."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.collections import FillBetweenPolyCollection
from matplotlib.figure import Figure
from matplotlib.text import Text

from planner.frf.frf import Frf
from planner.modal.estimate_modes import estimate_modes, identification
from planner.modal.mac import mac
from planner.report.modal_plots import auto_mac_figure, frequency_figure, modal_figures
from planner.report.pictures import Pictures, save
from planner.report.plot_marks import mark_band, spread
from planner.report.text import with_sd
from tests.support.modal_systems import exact_frf, noisy, random_system

BAND = (4.0, 60.0)
USABLE = (5.0, 62.0)


def analysed(modes=5, hits=(4, 0, 3), pair=0.01, spacing=0.1, seed=5, known=True):
    """A system, its FRF with noise, what was identified from it, and all pictures."""
    rng = np.random.default_rng(seed)
    system = random_system(rng, modes, damping=(0.005, 0.02), spacing=spacing, pair=pair)
    lines = np.arange(1, 321) * 0.25
    h, variance = noisy(exact_frf(system, lines), 0.01, rng)
    missing = np.array(hits) == 0
    h[:, missing], variance[:, missing] = np.nan, np.nan
    coherence = np.where(np.isfinite(variance), rng.uniform(0.9, 1.0, variance.shape), np.nan)
    if not known:
        variance, coherence = variance * np.nan, coherence * np.nan
    frf = Frf(lines, h, variance, coherence, hits, USABLE)
    found, modal = identification(frf, BAND), estimate_modes(frf, BAND)
    assert found is not None
    return system, frf, found, modal, modal_figures(frf, found, modal, "P001")


@pytest.fixture(scope="module")
def five():
    return analysed()


def titled(figure):
    return {axes.get_title(loc="left"): axes for axes in figure.axes if axes.get_title(loc="left")}


def by_label(axes):
    return {line.get_label(): line for line in axes.get_lines()}


def verticals(axes):
    """Frequencies of the vertical lines."""
    xs = [line.get_xdata() for line in axes.get_lines() if len(line.get_xdata()) == 2]
    return [float(x[0]) for x in xs if x[0] == x[1]]


def assert_apart(figure, texts):
    """No label covers another one, and all lie inside the (drawn) figure."""
    renderer = figure.canvas.get_renderer()
    # An annotation's own extent would include its leader.
    boxes = [Text.get_window_extent(text, renderer) for text in texts]
    for (one, a), (other, b) in combinations(zip(texts, boxes, strict=True), 2):
        overlap = min(a.x1, b.x1) - max(a.x0, b.x0), min(a.y1, b.y1) - max(a.y0, b.y0)
        assert min(overlap) <= 0, f"{one.get_text()!r} covers {other.get_text()!r}"
    width, height = figure.canvas.get_width_height()
    assert all(b.x0 >= 0 and b.y0 >= 0 and b.x1 <= width and b.y1 <= height for b in boxes)


@pytest.mark.parametrize("simulated", [True, False])
def test_every_picture_says_what_it_shows_and_what_is_simulated(five, simulated, tmp_path):
    _, frf, found, modal, _ = five
    figures = modal_figures(frf, found, modal, "P001")
    assert list(figures) == ["stabilisation", "frf", "coherence", "mac"]
    Pictures(tmp_path).write(figures, "P001", simulated=simulated)
    for figure in figures.values():
        assert ("SIMULATED" in figure.get_suptitle()) == simulated
        assert "P001" in figure.get_suptitle()
    assert list(modal_figures(None, found, modal, "P001")) == ["stabilisation", "mac"]


def test_cmif_is_the_spectrum_of_singular_values(five):
    _, frf, _, _, figures = five
    left, _ = figures["stabilisation"].axes
    first = by_label(left)["CMIF 1"]
    lines = np.isin(frf.frequency_hz, first.get_xdata())
    h = np.moveaxis(frf.accelerance[:, [0, 2]][..., lines], -1, 0)
    assert np.allclose(first.get_ydata(), np.linalg.norm(h, ord=2, axis=(1, 2)))
    square = by_label(left)["CMIF 2"].get_ydata() ** 2 + first.get_ydata() ** 2
    assert np.allclose(square, np.linalg.norm(h, axis=(1, 2)) ** 2)
    assert left.get_yscale() == "log"
    assert "(m/s²/N)" in left.get_ylabel()


def test_stabilisation_diagram_holds_every_pole_and_marks_the_modes(five):
    system, _, found, modal, figures = five
    left, right = figures["stabilisation"].axes
    stays, moves = by_label(right)["stable pole"], by_label(right)["unstable pole"]
    drawn = np.concatenate([stays.get_xdata(), moves.get_xdata()])
    poles = np.concatenate([entry.poles for entry in found.diagram.sets])
    assert np.allclose(np.sort(drawn), np.sort(np.abs(poles)) / (2 * np.pi))
    # Poles of the highest order that are called stable lie on true modes.
    top = stays.get_xdata()[stays.get_ydata() == found.order]
    near = np.min(np.abs(top[:, None] / system.frequency_hz - 1), axis=1)
    assert len(top) >= len(system.frequency_hz)
    assert np.sum(near < 0.01) >= len(system.frequency_hz)
    assert verticals(left) == pytest.approx([mode.frequency_hz for mode in modal.modes])
    for mode, text in zip(modal.modes, left.texts, strict=True):
        for words in (
            with_sd(mode.frequency_hz, mode.frequency_sd_hz, ".3f") + " Hz",
            with_sd(100 * mode.damping_ratio, 100 * mode.damping_sd) + " %",
            f"physical {100 * mode.probability:.0f} %",
        ):
            assert words in text.get_text()


@pytest.mark.parametrize(
    ("modes", "pair", "spacing"), [(5, 0.01, 0.1), (9, 0.01, 0.1), (16, None, 0.05)]
)
def test_labels_of_modes_keep_apart(modes, pair, spacing):
    _, _, _, modal, figures = analysed(modes, pair=pair, spacing=spacing)
    assert len(modal.modes) >= modes - 1
    left, _ = figures["stabilisation"].axes
    for name in ("stabilisation", "frf"):
        figures[name].draw_without_rendering()
    assert_apart(figures["stabilisation"], left.texts)
    for axes in titled(figures["frf"]).values():
        assert_apart(figures["frf"], axes.texts)


def test_fit_and_measured_frfs_of_every_entry(five):
    system, frf, _, modal, figures = five
    entries = titled(figures["frf"])
    assert len(entries) == 6  # y was never hit
    exact = exact_frf(system, frf.frequency_hz)
    for i, j in np.ndindex(3, 3):
        axes = entries.get(f"response {'xyz'[i]}, hit {'xyz'[j]}")
        assert (axes is None) == (j == 1)
        if axes is None:
            continue
        measured, fitted = axes.get_lines()[:2]
        assert np.allclose(measured.get_ydata(), np.abs(frf.accelerance[i, j]))
        shown = np.isin(frf.frequency_hz, fitted.get_xdata())
        true = np.abs(exact[i, j, shown])
        assert np.linalg.norm(fitted.get_ydata() - true) < 0.02 * np.linalg.norm(true)
        assert verticals(axes) == pytest.approx([mode.frequency_hz for mode in modal.modes])
        (shade,) = axes.patches
        assert (shade.get_x(), shade.get_x() + shade.get_width()) == USABLE


def test_band_around_a_measured_frf_is_two_standard_deviations(five):
    _, frf, _, _, figures = five
    axes = titled(figures["frf"])["response z, hit x"]
    (band,) = (c for c in axes.collections if isinstance(c, FillBetweenPolyCollection))
    corners = band.get_paths()[0].vertices
    size, sd = np.abs(frf.accelerance[2, 0]), np.sqrt(frf.variance[2, 0] / 2)
    for line in (100, 200):
        ends = corners[np.isclose(corners[:, 0], frf.frequency_hz[line]), 1]
        assert ends.max() == pytest.approx(size[line] + 2 * sd[line])
        floor = axes.get_ylim()[0] / 10
        assert ends.min() == pytest.approx(max(size[line] - 2 * sd[line], floor))


def test_phase_is_measured_and_fitted_without_strokes_across_the_cut(five):
    _, frf, _, _, figures = five
    axes = figures["frf"].axes
    phase = axes[axes.index(titled(figures["frf"])["response x, hit x"]) + 2]
    assert phase.get_ylabel() == "phase (°)"
    measured = phase.get_lines()[0]
    angle = np.asarray(measured.get_ydata())
    kept = np.isfinite(angle)
    assert np.allclose(angle[kept], np.angle(frf.accelerance[0, 0], deg=True))
    assert np.nanmax(np.abs(np.diff(angle))) <= 180


def test_coherence_of_every_entry(five):
    _, frf, _, _, figures = five
    entries = titled(figures["coherence"])
    assert len(entries) == 6
    axes = entries["response y, hit z (3 averaged)"]
    assert np.array_equal(axes.get_lines()[0].get_ydata(), frf.coherence[1, 2])


def test_what_is_unknown_is_not_drawn():
    _, _, _, _, figures = analysed(3, hits=(1, 0, 0), pair=None, known=False)
    axes = titled(figures["coherence"])["response x, hit x (1 averaged)"]
    assert any("two hits" in text.get_text() for text in axes.texts)
    legend = [text.get_text() for text in figures["frf"].legends[0].get_texts()]
    assert "± 2 sd" not in legend
    assert {"measured", "fit", "coherent, in the usable band", "mode"} <= set(legend)


def test_mac_matrix_and_the_values_in_its_cells(five):
    _, _, _, modal, figures = five
    axes = figures["mac"].axes[0]
    image = np.asarray(axes.images[0].get_array())
    count = len(modal.modes)
    for i, k in np.ndindex(count, count):
        value = mac(modal.modes[i].shape, modal.modes[k].shape)
        assert image[i, k] == pytest.approx(value)
        assert axes.texts[i * count + k].get_text() == f"{value:.2f}"
    names = [label.get_text() for label in axes.get_yticklabels()]
    assert names[0] == f"1: {modal.modes[0].frequency_hz:.2f} Hz"
    figures["mac"].draw_without_rendering()
    assert_apart(figures["mac"], axes.texts)


def test_campbell_diagram_has_gaps_error_bars_and_dashes():
    frequency = np.array([[10.0, 20.0], [11.0, np.nan], [12.0, 21.0]])
    sd = np.array([[0.1, 0.2], [0.1, np.nan], [0.3, np.nan]])
    figure = frequency_figure(["A", "B", "C"], frequency, sd, frequency * 1.1)
    axes = figure.axes[0]
    one, two = (c.lines[0] for c in axes.containers)
    assert one.get_ydata().tolist() == [10.0, 11.0, 12.0]
    assert np.isnan(two.get_ydata()[1])
    bars = axes.containers[0].lines[2][0].get_segments()
    assert [np.ptp(bar[:, 1]) for bar in bars] == pytest.approx([0.4, 0.4, 1.2])
    dashed = [line for line in axes.get_lines() if line.get_linestyle() == "--"]
    assert dashed[0].get_ydata() == pytest.approx([11.0, 12.1, 13.2])
    assert [text.get_text() for text in axes.texts] == ["mode 1", "mode 2"]


def test_campbell_diagram_over_named_poses_labels_close_modes_apart():
    names = tuple(f"P{k:03d}" for k in range(20))
    frequency = np.linspace([10.0, 10.01, 10.02, 30.0], [9.0, 9.01, 9.02, 25.0], 20)
    figure = frequency_figure(names, frequency, np.full(frequency.shape, 0.01))
    axes = figure.axes[0]
    assert [label.get_text() for label in axes.get_xticklabels()] == list(names)
    assert len(axes.texts) == 4
    figure.draw_without_rendering()
    assert_apart(figure, axes.texts)


@given(
    st.lists(st.floats(0, 10), max_size=12),
    st.floats(0.01, 0.8),
)
def test_spread_keeps_order_gap_and_ends(positions, gap):
    x = np.sort(np.array(positions))
    moved = spread(x, gap, 0.0, 10.0)
    assert np.all(np.diff(moved) >= gap * (1 - 1e-9))
    assert moved.size == 0 or (moved[0] >= 0 and moved[-1] <= 10 + 1e-9)
    apart = np.all(np.diff(x) >= gap)
    if apart:
        assert np.allclose(moved, x)


def test_spread_moves_as_little_as_possible():
    assert spread(np.array([1.0, 1.0, 5.0]), 1.0, 0.0, 10.0).tolist() == [0.5, 1.5, 5.0]


@pytest.mark.parametrize("form", ["png", "svg"])
def test_the_same_modes_give_the_same_file(five, tmp_path, form):
    for name in ("first", "second"):
        save(auto_mac_figure(five[3], "MAC"), tmp_path / f"{name}.{form}")
    assert (tmp_path / f"first.{form}").read_bytes() == (tmp_path / f"second.{form}").read_bytes()


def test_an_frf_is_shaded_where_it_is_coherent(five):
    frf = five[1]
    low, high = frf.usable_band_hz
    begins = low + 0.3 * (high - low)
    coherence = frf.coherence.copy()
    coherence[0, 0, frf.frequency_hz < begins] = 0.2
    coherence[1, 0] = 0.1
    hole = low + np.array([0.4, 0.6]) * (high - low)
    coherence[2, 0] = 0.95
    coherence[2, 0, (frf.frequency_hz > hole[0]) & (frf.frequency_hz < hole[1])] = 0.3
    partly = replace(frf, coherence=coherence)
    spans = []
    for response in range(3):
        panel = Figure().subplots()
        mark_band(panel, partly, response, 0)
        spans.append([(p.get_x(), p.get_x() + p.get_width()) for p in panel.patches])
    step = frf.frequency_hz[1]
    assert abs(spans[0][0][0] - begins) <= 4 * step
    assert spans[0][0][1] == high
    assert spans[1] == []
    assert np.allclose(spans[2], [(low, hole[0]), (hole[1], high)], atol=4 * step)
