"""What the papers' studies are made of: data, splits, the command's answers to bad input.

`pytest -m slow tests/studies/test_study_parts.py` looks at the sweep of Busch et al. 2020.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from planner.effects.parameters import parametrise
from planner.errors import InputError
from planner.frf import synthesis
from planner.frf.frf import Frf
from planner.modal.modes import Mode
from planner.progress import no_progress
from planner.studies import registry
from planner.studies.irb6660_lei2023 import data as lei
from planner.studies.irb6660_lei2023 import scores
from planner.studies.kr10_birk2025 import data as birk
from planner.studies.kr10_birk2025 import fits
from planner.studies.kr210_seyedhosseini2025.four_steps import check
from planner.studies.kr240_busch2020 import data as busch2020
from planner.studies.kr240_busch2022 import data as busch2022
from planner.studies.kr240_busch2022.pictures import saltelli
from planner.studies.run import run_study

HZ = np.arange(4.0, 40.0, 0.25)


@pytest.fixture(scope="module")
def truth():
    return lei.true_robot(1)


@pytest.mark.slow
def test_the_sweep_has_the_papers_points():
    seen = busch2020.sweep(1)
    assert seen.simulated.size == 12_801
    assert seen.amplitude.size == 2_622
    assert seen.angles_deg.max() == 105
    assert busch2020.BEYOND_DEG.min() > 105
    assert np.array_equal(seen.every(3).angles_deg, seen.angles_deg[::3])


def test_parameters_of_the_plane_are_reciprocal(truth):
    """L is R over its reference entry, for the robot has no feedback; frequencies rise."""
    q, x = lei.postures(truth)
    assert x.shape == (112, 3)
    few = q[::40]
    parameters = lei.parameters(truth, few)
    for posture, rows in zip(few, parameters, strict=True):
        poles = truth.poles(posture)[0]
        order = [k for k in np.argsort(np.abs(poles)) if poles[k].imag > 1e-6][: lei.MODES]
        for k, row in zip(order, rows, strict=True):
            left = row[lei.LEFT].reshape(3, 2) @ [1, 1j]
            right = row[lei.RIGHT].reshape(4, 2) @ [1, 1j]
            assert np.isclose(row[0], np.abs(poles[k]) / (2 * np.pi))
            # Reciprocity: L is R over its own reference entry.
            candidates = [np.insert(left, i, 1.0) for i in range(4)]
            off = [np.linalg.norm(right / right[i] - c) for i, c in enumerate(candidates)]
            assert min(off) < 1e-6 * np.linalg.norm(right / right[np.argmin(off)])


def test_hits_tell_the_parameters_of_the_plane(truth):
    """f within a percent, the largest entry of R within a tenth, wherever a mode is found."""
    q, x = lei.postures(truth)
    few = slice(0, 36, 6)
    told = lei.measured(truth, q[few], x[few], 1, lambda text, share: None)
    true = lei.parameters(truth, q[few], told.reference)
    low = slice(0, 4)
    assert np.isfinite(told.values[:, low, 0]).mean() > 0.9
    off = told.values[:, low, 0] / true[:, low, 0] - 1
    assert np.nanmedian(np.abs(off)) < 0.01
    size = np.linalg.norm(true[:, low, lei.RIGHT], axis=2)
    off = np.linalg.norm((told.values - true)[:, low, lei.RIGHT], axis=2) / size
    assert np.nanmedian(off) < 0.3


def test_missing_parameters_are_filled_from_neighbours():
    x = np.linspace(0, 1, 9)[:, None]
    y = np.column_stack([np.arange(9.0), np.arange(9.0)])
    y[4, 1] = np.nan
    filled = registry.load("lei2023")._filled(x, y)
    assert filled[4, 1] == 4.0  # the mean of 2, 3, 5, 6
    assert np.array_equal(np.delete(filled, 4, 0), np.delete(y, 4, 0))


def test_splits_are_nested_spread_and_complete():
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 7)), axis=-1).reshape(-1, 2)
    train, test = busch2022.split(grid, 3)
    assert sorted([*train, *test]) == list(range(35))
    assert len(train) == len(set(train)) == 15
    assert np.array_equal(train, busch2022.split(grid, 3)[0])
    assert not np.array_equal(train, busch2022.split(grid, 4)[0])
    # From every pose a trained one is near.
    apart = np.linalg.norm(grid[:, None] - grid[train][None], axis=2).min(axis=1)
    assert apart.max() < 0.5


def test_bad_input_is_one_sentence(tmp_path, monkeypatch):
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(InputError, match="name another folder"):
        run_study("birk2025", file / "below", True, no_progress)
    monkeypatch.setattr(registry, "NEEDED", "no_such_module")
    with pytest.raises(InputError, match=r"pip install 'planner\[truth\]'"):
        registry.named("birk2025")


def test_the_truth_of_birk_is_of_another_class():
    truth = birk.true_robot(11)
    assert len(truth.deviation.beams) == 3
    assert len(birk.gears(truth)) == 6
    stated = fits.stated("24P").elasticity.stiffness
    own = np.array([spring.stiffness for spring in truth.springs[: len(stated)]])
    assert np.std(np.log(own / stated)) > 0.1


def test_saltellis_points_are_two_halves_of_one_sequence():
    points = saltelli(3, 1000)
    assert points.shape == (1000, 3)
    assert points.min() > 0
    assert points.max() < 1
    # Far more even than random numbers: their mean errs by 1/√12,000 = 0.009.
    np.testing.assert_allclose(points.mean(axis=0), 0.5, atol=0.003)
    assert abs(np.corrcoef(points[:500, 0], points[500:, 0])[0, 1]) < 0.1


def test_studies_are_found_by_their_former_names_too():
    for i, name in enumerate(registry.NAMES):
        assert registry.named(f"seed-00{i}") == name


@pytest.mark.parametrize("reference", [0, 1, 2, 3])
def test_nine_modes_make_70_models_that_hold_each_parameter_once(reference):
    found = scores.groups(np.arange(9), np.full(9, reference))
    assert len(found) == 70  # section 5.2 of the paper
    assert max(len(group) for group in found) == 3
    np.testing.assert_array_equal(np.sort(np.concatenate(found)), np.arange(144))


def test_others_that_are_known_at_a_tested_posture_tell_what_it_is():
    rng = np.random.default_rng(0)
    x = rng.random((40, 2))
    rough = rng.standard_normal(40)  # follows no pose: only the other task can tell it
    y = np.column_stack([rough, -2 * rough]) + 0.05 * rng.standard_normal((40, 2))
    train = np.arange(40) < 30
    nothing, others = scores.predict(x, y, train, [np.array([0, 1])])
    off = [np.sqrt(np.mean((told - y[~train]) ** 2, axis=0)) for told in (nothing, others)]
    assert np.all(off[0] > 0.5 * y.std(axis=0))
    assert np.all(off[1] < 0.15 * y.std(axis=0))


@pytest.mark.parametrize(("name", "count"), [("12P", 12), ("24P", 24)])
def test_every_parameter_has_the_bounds_of_tables_1_and_2(name, count):
    simulation = fits.stated(name)
    priors = fits.paper_priors(simulation)
    assert len(parametrise(simulation, priors).parameters) == len(priors.bounds) == count
    low, high = priors.bounds["stiffness of joint_5 about y"]
    np.testing.assert_allclose(np.deg2rad([low, high]), [30, 1000])
    if count == 24:
        low, high = priors.bounds["stiffness of joint_3 across"]
        np.testing.assert_allclose(np.deg2rad([low, high]), [1250, 40000])


@pytest.mark.parametrize("begun", [True, False])
def test_no_fit_leaves_the_bounds_wherever_the_truth_is(begun):
    """A robot whose springs are far too soft for the tables, and a start that is beyond them."""
    stated = fits.stated("12P")
    priors = fits.paper_priors(stated)
    soft = replace(stated.elasticity, stiffness=stated.elasticity.stiffness / 100)
    hz = np.arange(5.0, 200.0, 5.0)
    q = np.deg2rad([[0.0, -70.0, 110.0, 0.0, 50.0, 0.0]])
    struck = SimpleNamespace(
        frequency_hz=hz, accelerance=stated.changed(soft).accelerance(q, hz)[0]
    )
    starts = [np.full(12, 1e-9)] if begun else []
    values = fits.within_bounds(stated, priors, [struck], q, starts, 1)
    low, high = np.array(list(priors.bounds.values())).T
    assert np.all((values >= low * (1 - 1e-9)) & (values <= high * (1 + 1e-9)))


def test_the_best_points_tell_most_and_one_direction_tells_less():
    """Two parameters, five points: each of two tells of one parameter, the others of nothing."""
    told = np.zeros((5, 3, 2, 2))
    told[1, 0, 0, 0], told[3, 1, 1, 1] = 100.0, 400.0
    informative = fits.Informative(np.eye(2), told)
    np.testing.assert_array_equal(informative.best(2), [3, 1])
    assert informative.determined(np.array([1, 3])) == 2
    assert informative.determined(np.array([1, 3]), [0]) == 1
    assert informative.determined(np.array([0, 2])) == 0


def mode(f, probability=1.0):
    residue = 1e-3j * np.diag([1.0, 0.7, 0.4]) * -1
    sd = np.full((3, 3), 1e-6)
    return Mode(f, 0.01, 0.02, 0.001, residue, sd, np.array([1.0, 0, 0]), probability)


def frf(*modes):
    poles = synthesis.pole(np.array([m.frequency_hz for m in modes]), np.full(len(modes), 0.02))
    h = synthesis.accelerance(HZ, poles, np.array([m.residue for m in modes]))
    ones = np.ones((3, 3, len(HZ)))
    return Frf(HZ, h, 1e-9 * ones, 0.99 * ones, (1, 1, 1), (4.0, 40.0))


@pytest.fixture
def postures():
    """Two modes over nine postures."""
    modes = [[mode(10 + 0.1 * i), mode(25 - 0.2 * i)] for i in range(9)]
    return [frf(*row) for row in modes], modes


def test_good_modes_pass_all_steps(postures):
    frfs, modes = postures
    done = check(frfs, modes, [()] * 9)
    assert not done.doubted.any()
    assert not done.recovered.any()
    assert min(done.passed.values()) == 1.0
    assert all(m is n for row, old in zip(done.modes, modes, strict=True)
               for m, n in zip(row, old, strict=True))  # fmt: skip


def test_a_mode_far_from_its_neighbours_is_dropped(postures):
    frfs, modes = postures
    modes[4][1] = mode(31.0)
    done = check(frfs, modes, [()] * 9)
    assert done.modes[4][1] is None
    assert done.doubted.sum() == 1


def test_a_missing_peak_is_recovered_from_what_was_held_for_doubtful(postures):
    frfs, modes = postures
    true, modes[3][0] = modes[3][0], None
    spare: list[tuple[Mode, ...]] = [()] * 9
    spare[3] = (mode(10.35, 0.2), mode(18.0, 0.4))
    done = check(frfs, modes, spare)
    assert done.recovered[3, 0]
    found = done.modes[3][0]
    assert found is not None
    assert found.frequency_hz == pytest.approx(true.frequency_hz, rel=0.01)


def test_a_pole_without_peak_or_phase_is_dropped(postures):
    frfs, modes = postures
    frfs[5] = frf(modes[5][0])  # the second mode does not show there
    quiet = replace(frfs[5], coherence=np.full((3, 3, len(HZ)), 0.2))
    frfs[5] = quiet
    done = check(frfs, modes, [()] * 9)
    assert done.modes[5][1] is None
    assert done.modes[5][0] is modes[5][0]  # it has its peak
