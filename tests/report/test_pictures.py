"""Pictures hold the numbers that they are given, and their labels can be read."""

from dataclasses import replace
from itertools import combinations, pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.collections import FillBetweenPolyCollection
from matplotlib.colors import LogNorm, to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text
from mpl_toolkits.mplot3d.proj3d import proj_transform

from planner.diagnosis.mismatch import Residuals
from planner.frf.frf import Frf
from planner.modal.estimate_modes import estimate_modes, identification
from planner.modal.mac import mac
from planner.recording.points import Dof
from planner.recording.uff import Geometry
from planner.report.campaign_plots import frf_sheet, left_out_figure
from planner.report.frf_plots import STYLES, ComparedFrfs, Side, _residuals, frf_map
from planner.report.matrix_plots import geometry_figure, shapes_figure
from planner.report.modal_plots import auto_mac_figure, frequency_figure, modal_figures
from planner.report.pictures import Pictures, png, save
from planner.report.plot_marks import ink, mark_band
from planner.report.text import with_sd
from planner.surrogate.leave_one_out import LeaveOneOut
from tests.support.hit_structures import hit_frfs
from tests.support.modal_systems import exact_frf, noisy, random_system
from tests.support.structures import plate

BAND, USABLE = (4.0, 60.0), (5.0, 62.0)
FREQUENCY = np.arange(0.0, 30.0)


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
    return system, frf, found, modal, modal_figures(frf, found, modal)


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
    figures = modal_figures(frf, found, modal)
    assert list(figures) == ["stabilisation", "frf", "coherence", "mac"]
    mac = figures["mac"]
    Pictures(tmp_path).write(lambda: {"mac": mac}, "P001", simulated=simulated)
    assert ("SIMULATED" in mac.get_suptitle()) == simulated
    assert "P001" in mac.get_suptitle()
    assert list(modal_figures(None, found, modal)) == ["stabilisation", "mac"]


@pytest.mark.parametrize("form", ["png", "svg"])
def test_the_same_modes_give_the_same_file(five, tmp_path, form):
    for name in ("first", "second"):
        save(auto_mac_figure(five[3]), tmp_path / f"{name}.{form}")
    assert (tmp_path / f"first.{form}").read_bytes() == (tmp_path / f"second.{form}").read_bytes()


def test_stabilisation_diagram_holds_singular_values_every_pole_and_the_modes(five):
    system, frf, found, modal, figures = five
    left, right = figures["stabilisation"].axes
    first, second = (by_label(left)[f"CMIF {k}"] for k in (1, 2))
    lines = np.isin(frf.frequency_hz, first.get_xdata())
    h = np.moveaxis(frf.accelerance[:, [0, 2]][..., lines], -1, 0)
    assert np.allclose(first.get_ydata(), np.linalg.norm(h, ord=2, axis=(1, 2)))
    whole = second.get_ydata() ** 2 + first.get_ydata() ** 2
    assert np.allclose(whole, np.linalg.norm(h, axis=(1, 2)) ** 2)
    assert "(m/s²/N)" in left.get_ylabel()
    stays, moves = by_label(right)["stable pole"], by_label(right)["unstable pole"]
    drawn = np.concatenate([stays.get_xdata(), moves.get_xdata()])
    poles = np.concatenate([entry.poles for entry in found.diagram.sets])
    assert np.allclose(np.sort(drawn), np.sort(np.abs(poles)) / (2 * np.pi))
    # Poles of the highest order that are called stable lie on true modes.
    top = stays.get_xdata()[stays.get_ydata() == found.diagram.order]
    near = np.min(np.abs(top[:, None] / system.frequency_hz - 1), axis=1)
    assert np.sum(near < 0.01) >= len(system.frequency_hz)
    assert verticals(left) == pytest.approx([mode.frequency_hz for mode in modal.modes])
    for mode, text in zip(modal.modes, left.texts, strict=True):
        hz = with_sd(mode.frequency_hz, mode.frequency_sd_hz, ".3f") + " Hz"
        damping = with_sd(100 * mode.damping_ratio, 100 * mode.damping_sd) + " %"
        for words in (hz, damping, f"physical {100 * mode.probability:.0f} %"):
            assert words in text.get_text()


def test_labels_of_modes_keep_apart():
    _, _, _, modal, figures = analysed(16, pair=None, spacing=0.05)
    assert len(modal.modes) >= 15
    for name in ("stabilisation", "frf"):
        figures[name].draw_without_rendering()
    assert_apart(figures["stabilisation"], figures["stabilisation"].axes[0].texts)
    for axes in titled(figures["frf"]).values():
        assert_apart(figures["frf"], axes.texts)


def test_measured_frfs_their_band_and_fit_of_every_entry(five):
    system, frf, _, modal, figures = five
    entries = titled(figures["frf"])
    exact = exact_frf(system, frf.frequency_hz)
    assert len(entries) == len(titled(figures["coherence"])) == 6  # y was never hit
    for i, j in ((i, j) for i in range(3) for j in (0, 2)):
        axes = entries[f"response {'xyz'[i]}, hit {'xyz'[j]}"]
        measured, fitted = axes.get_lines()[:2]
        assert np.allclose(measured.get_ydata(), np.abs(frf.accelerance[i, j]))
        shown = np.isin(frf.frequency_hz, fitted.get_xdata())
        true = np.abs(exact[i, j, shown])
        assert np.linalg.norm(fitted.get_ydata() - true) < 0.02 * np.linalg.norm(true)
        assert verticals(axes) == pytest.approx([mode.frequency_hz for mode in modal.modes])
        (shade,) = axes.patches
        assert (shade.get_x(), shade.get_x() + shade.get_width()) == USABLE
    axes = entries["response z, hit x"]
    (band,) = (c for c in axes.collections if isinstance(c, FillBetweenPolyCollection))
    corners, line = band.get_paths()[0].vertices, 100
    size, sd = np.abs(frf.accelerance[2, 0, line]), np.sqrt(frf.variance[2, 0, line] / 2)
    ends = corners[np.isclose(corners[:, 0], frf.frequency_hz[line]), 1]
    assert ends.max() == pytest.approx(size + 2 * sd)
    axes = titled(figures["coherence"])["response y, hit z (3 averaged)"]
    assert np.array_equal(axes.get_lines()[0].get_ydata(), frf.coherence[1, 2])


def test_phase_is_drawn_without_strokes_across_the_cut(five):
    _, frf, _, _, figures = five
    axes = figures["frf"].axes
    phase = axes[axes.index(titled(figures["frf"])["response x, hit x"]) + 2]
    assert phase.get_ylabel() == "phase (°)"
    angle = np.asarray(phase.get_lines()[0].get_ydata())
    kept = np.isfinite(angle)
    assert np.allclose(angle[kept], np.angle(frf.accelerance[0, 0], deg=True))
    assert np.nanmax(np.abs(np.diff(angle))) <= 180


def test_what_is_unknown_is_not_drawn():
    _, _, _, _, figures = analysed(3, hits=(1, 0, 0), pair=None, known=False)
    axes = titled(figures["coherence"])["response x, hit x (1 averaged)"]
    assert any("two hits" in text.get_text() for text in axes.texts)
    legend = [text.get_text() for text in figures["frf"].legends[0].get_texts()]
    assert set(legend) == {"measured", "fit", "coherent, in the usable band", "mode"}


def test_an_frf_is_shaded_where_it_is_coherent(five):
    frf = five[1]
    low, high = frf.usable_band_hz
    begins, hole = low + 0.3 * (high - low), low + np.array([0.4, 0.6]) * (high - low)
    coherence = frf.coherence.copy()
    coherence[0, 0, frf.frequency_hz < begins] = 0.2
    coherence[1, 0], coherence[2, 0] = 0.1, 0.95
    coherence[2, 0, (frf.frequency_hz > hole[0]) & (frf.frequency_hz < hole[1])] = 0.3
    expected = [(begins, high)], [], [(low, hole[0]), (hole[1], high)]
    for response, spans in enumerate(expected):
        panel = Figure().subplots()
        mark_band(panel, replace(frf, coherence=coherence), response, 0)
        drawn = [(p.get_x(), p.get_x() + p.get_width()) for p in panel.patches]
        assert np.allclose(drawn, spans, atol=4 * frf.frequency_hz[1])


def test_mac_matrix_and_the_values_in_its_cells(five):
    _, _, _, modal, figures = five
    axes = figures["mac"].axes[0]
    image, count = np.asarray(axes.images[0].get_array()), len(modal.modes)
    for i, k in np.ndindex(count, count):
        value = mac(modal.modes[i].shape, modal.modes[k].shape)
        assert image[i, k] == pytest.approx(value)
        assert axes.texts[i * count + k].get_text() == f"{value:.2f}"
    assert axes.get_yticklabels()[0].get_text() == f"1: {modal.modes[0].frequency_hz:.2f} Hz"
    figures["mac"].draw_without_rendering()
    assert_apart(figures["mac"], axes.texts)


MODES = "mode 1", "mode 2", "mode 3", "mode 5"


def test_campbell_diagram_has_gaps_error_bars_and_dashes():
    frequency = np.array([[10.0, 20.0], [11.0, np.nan], [12.0, 21.0]])
    sd = np.array([[0.1, 0.2], [0.1, np.nan], [0.3, np.nan]])
    axes = frequency_figure(["A", "B", "C"], MODES[:2], frequency, sd, frequency * 1.1).axes[0]
    one, two = (c.lines[0] for c in axes.containers)
    assert one.get_ydata().tolist() == [10.0, 11.0, 12.0]
    assert np.isnan(two.get_ydata()[1])
    bars = axes.containers[0].lines[2][0].get_segments()
    assert [np.ptp(bar[:, 1]) for bar in bars] == pytest.approx([0.4, 0.4, 1.2])
    dashed = [line for line in axes.get_lines() if line.get_linestyle() == "--"]
    assert dashed[0].get_ydata() == pytest.approx([11.0, 12.1, 13.2])


def test_campbell_diagram_labels_close_modes_apart():
    names = tuple(f"P{k:03d}" for k in range(20))
    frequency = np.linspace([10.0, 10.01, 10.02, 30.0], [9.0, 9.01, 9.02, 25.0], 20)
    figure = frequency_figure(names, MODES, frequency, np.full(frequency.shape, 0.01))
    axes = figure.axes[0]
    assert [label.get_text() for label in axes.get_xticklabels()] == list(names)
    figure.draw_without_rendering()
    assert [label.get_text() for label in axes.texts] == list(MODES)
    assert_apart(figure, axes.texts)


def map_panels(figure):
    """Values (F, n) and cells' corners of each panel of a map, by title."""
    meshes = {axes.get_title(): axes.collections[0] for axes in figure.axes if axes.get_title()}
    return {k: (m.get_array(), m.get_coordinates(), m.get_clim()) for k, m in meshes.items()}


def test_a_map_holds_levels_in_the_right_cells_and_their_difference():
    measured = np.random.default_rng(0).uniform(0.1, 1, (5, 30)) * np.exp(1j)
    measured[2] = np.nan
    measured[1, 4] = 0.0
    figure = frf_map("ABCDE", measured, 2 * np.nan_to_num(measured), FREQUENCY, "H xx")
    shown = map_panels(figure)
    assert list(shown) == ["measured", "simulated", "simulated − measured"]
    levels, corners, limits = shown["measured"]
    assert limits == shown["simulated"][2]  # one scale of colours
    np.testing.assert_allclose(levels[:, 3], 20 * np.log10(np.abs(measured[3])))
    np.testing.assert_allclose(corners[0, :, 0], [0.5, 1.5, 2.5, 3.5, 4.5, 5.5])
    np.testing.assert_allclose(corners[:, 0, 1], np.arange(31) - 0.5)
    assert levels.mask[:, 2].all()  # NaN stays blank
    assert levels.mask.sum() == 30
    np.testing.assert_allclose(shown["simulated − measured"][0][:, 3], 20 * np.log10(2))
    assert png(figure)[:4] == b"\x89PNG"
    assert list(map_panels(frf_map("A", *np.ones((2, 1, 30)), FREQUENCY, ""))) == list(shown)


@pytest.mark.parametrize(("known", "rows"), [(True, 3), (False, 2)])
def test_a_poses_frfs_without_coherence_and_grey_above_the_modes(known, rows):
    hz, mean = np.linspace(5.0, 50.0, 40), np.ones((3, 3, 40)) * (1 + 1j)
    coherence = np.full((3, 3, 40), 0.9 if known else np.nan)
    frf = Frf(hz, mean, 0.1 * np.abs(mean), coherence, (1, 1, 1), (5.0, 50.0))
    figure = frf_sheet(hz, mean, 0.1 * np.abs(mean), frf, np.array([10.0, 20.0, np.nan]))
    assert len(figure.axes) == 3 * rows
    for panel in figure.axes:
        (grey,) = [patch for patch in panel.patches if patch.get_facecolor()[:3] == (0.92,) * 3]
        assert (grey.get_x(), grey.get_x() + grey.get_width()) == (20.0, 50.0)


def test_a_pose_that_surprises_is_named_with_mode_and_error():
    score = np.random.default_rng(0).uniform(-1, 1, (12, 2))
    score[4, 1] = 6.0
    found = LeaveOneOut(0.01 * score, np.full((12, 2), 0.01), np.full((12, 2), 0.5))
    figure = left_out_figure(found, tuple(f"P{i}" for i in range(12)), "Title")
    texts = [t.get_text() for panel in figure.axes for t in panel.texts]
    assert texts == ["P4, mode 2: +6.0 %"]
    assert figure.axes[0].get_legend().get_texts()[-1].get_text() == "24 values"
    nothing = np.array([[np.nan, 0.4, np.nan]])
    left_out_figure(LeaveOneOut(nothing, nothing, nothing), ("P1",)).canvas.draw()


@pytest.mark.parametrize("picture", ["residuals", "frf"])
def test_curves_that_agree_are_all_seen(picture):
    """By the colours on the picture: none is covered by one that is drawn later."""
    lines, curve = np.linspace(4.0, 60.0, 100), 10 ** np.linspace(-3.0, 1.0, 100)
    place = Residuals(np.linspace(4, 60, 9), np.full(8, 3.0), np.full(3, 2.0), np.ones((3, 3)))
    if picture == "residuals":  # pose names are no formulas
        figure, colours = _residuals(place, place, ["A$1$", "B", "C"]), ("tab:orange", "tab:red")
        images = [image for axes in figure.axes for image in axes.images]
        assert images[0].norm is images[1].norm
        assert isinstance(images[0].norm, LogNorm)
    else:
        same = np.broadcast_to(curve, (1, 3, 3, 100))
        scales = dict(zip(STYLES, (0.3, 1.0, 1.0), strict=True))
        sides = tuple(Side(n, n, STYLES[n], scale * same) for n, scale in scales.items())
        figure = ComparedFrfs(("A",), lines[None], same, sides).overlay(0)
        colours = "0.25", "tab:blue", "tab:orange", "tab:red"
    for legend in (*figure.legends, *(panel.get_legend() for panel in figure.axes)):
        if legend is not None:
            legend.set_visible(False)
    figure.canvas.draw()
    seen = np.asarray(figure.canvas.buffer_rgba())[..., :3].astype(int)
    for colour in colours:
        wanted = np.round(255 * np.array(to_rgb(colour)))
        assert np.sum(np.max(np.abs(seen - wanted), axis=-1) <= 12) > 100, colour


@pytest.mark.parametrize("colour", [(1, 1, 0), (0.99, 0.91, 0.14), (0.1, 0.2, 0.5), (0.5,) * 3])
def test_words_on_colours_are_read(colour):
    """Contrast as WCAG 2 defines it: at least 4.5 with the ink that is chosen."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour]
    light = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    contrast = 1.05 / (light + 0.05) if ink(colour) == "white" else (light + 0.05) / 0.05
    assert contrast >= 4.5


@pytest.mark.parametrize(("turn", "lines"), [((0, 1, 2), True), ((2, 0, 1), False)])
def test_points_of_flat_structures_are_inside_and_to_scale(turn, lines):
    structure = plate(4, 3)
    matrix = hit_frfs(structure, [0], np.arange(5, 50.0), np.random.default_rng(1))
    place = np.array(list(structure.position_m.values()))[:, turn]
    traces = tuple((str(a), str(b)) for a, b in structure.lines) if lines else ()
    geometry = Geometry(tuple(map(str, structure.position_m)), place, traces)
    figure = geometry_figure(matrix, geometry)
    figure.canvas.draw()
    (panel,) = figure.axes
    limits = np.array([panel.get_xlim(), panel.get_ylim(), panel.get_zlim()])
    assert np.all(limits[:, 0] <= place.min(axis=0))
    assert np.all(limits[:, 1] >= place.max(axis=0))
    scale = np.diff(limits)[:, 0] / panel._box_aspect
    assert scale == pytest.approx(scale[0], rel=1e-6)
    for axis in (panel.xaxis, panel.yaxis, panel.zaxis):
        box = axis.get_tightbbox()
        assert min(box.x0, box.y0) >= 0
        assert box.x1 <= figure.bbox.x1
        assert box.y1 <= figure.bbox.y1


def test_a_tool_far_out_is_inside_every_shape():
    arm = [[0, 0, 0], [0, 0, 0.5], [0.3, 0, 0.8], [1.3, 0.3, 1.6], [2.2, 0.6, 1.5], [2.6, 0.7, 0.6]]
    names = tuple("123456")
    geometry = Geometry(names, np.array(arm), tuple(pairwise(names)))
    dofs = tuple(Dof(name, axis) for name in names for axis in "xyz")
    shapes = np.random.default_rng(2).normal(size=(3, 18)) + 0j
    modes = [SimpleNamespace(shape=shape, frequency_hz=10.0) for shape in shapes]
    figure = shapes_figure(SimpleNamespace(modes=modes, dofs=dofs), geometry)
    figure.canvas.draw()
    for panel in figure.axes:
        (dots,) = [c for c in panel.collections if hasattr(c, "_offsets3d")]
        x, y, _ = proj_transform(*map(np.asarray, dots._offsets3d), panel.get_proj())
        place = (panel.transData - panel.transAxes).transform(np.column_stack([x, y]))
        assert np.all((place > 0) & (place < 1))
        assert np.max(np.abs(place - 0.5)) > 0.3  # and not small
