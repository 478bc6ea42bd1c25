"""What the papers' studies are made of: data, splits, the command's answers to bad input."""

import numpy as np
import pytest

from planner.effects.parameters import Priors
from planner.errors import InputError
from planner.studies import (
    birk2025,
    birk2025_data,
    birk2025_design,
    busch2020_data,
    busch2022_data,
    lei2023,
    lei2023_data,
    lei2023_hits,
    registry,
    seyedhosseini2025,
    seyedhosseini2025_data,
)
from planner.studies.busch2022_frf import saltelli
from planner.studies.report import PaperClaim, Report, Table, check_folder, write
from planner.truth.arms import KR210
from planner.truth.load import load_truth


@pytest.fixture(scope="module")
def truth():
    return lei2023_data.true_robot(1)


@pytest.fixture(scope="module")
def swept():
    return busch2020_data.sweep(1)


def test_the_sweep_has_the_papers_points(swept):
    assert swept.simulated.size == 12_801
    assert swept.amplitude.size == 2_622
    seen = swept
    assert seen.angles_deg.max() == 105
    assert busch2020_data.BEYOND_DEG.min() > 105
    assert np.array_equal(seen.every(3).angles_deg, seen.angles_deg[::3])


def test_the_swept_robot_has_a_resonance_that_its_simulation_lacks(swept):
    """In the band, across the arm: two simulated, three true ones (and in-plane ones in both)."""
    seen, truth = swept, busch2020_data.true_robot(1)
    for angle in (70.0, 105.0, 120.0):
        simulated = seen.modes(np.array([angle]), 6)
        f, _, residue = truth.modes(busch2020_data.poses(np.array([angle]))[0], 6)
        across = {
            "simulated": (simulated.frequency_hz[0], simulated.residue[0]),
            "true": (f, residue),
        }
        count = {}
        for name, (hz, r) in across.items():
            size = np.abs(r[:, busch2020_data.ACROSS, busch2020_data.ACROSS]) / hz
            count[name] = np.count_nonzero((hz < 30) & (size > 0.003 * size.max()))
        assert count == {"simulated": 2, "true": 3}


def test_parameters_of_the_plane_are_reciprocal(truth):
    """L is R over its reference entry, for the robot has no feedback; frequencies rise."""
    q, x = lei2023_data.postures(truth)
    assert x.shape == (112, 3)
    few = q[::40]
    parameters = lei2023_data.parameters(truth, few)
    for posture, rows in zip(few, parameters, strict=True):
        poles = truth.poles(posture)[0]
        order = [k for k in np.argsort(np.abs(poles)) if poles[k].imag > 1e-6][: lei2023_data.MODES]
        for k, row in zip(order, rows, strict=True):
            left = row[lei2023_data.LEFT].reshape(3, 2) @ [1, 1j]
            right = row[lei2023_data.RIGHT].reshape(4, 2) @ [1, 1j]
            assert np.isclose(row[0], np.abs(poles[k]) / (2 * np.pi))
            # Reciprocity: L is R over its own reference entry.
            candidates = [np.insert(left, i, 1.0) for i in range(4)]
            off = [np.linalg.norm(right / right[i] - c) for i, c in enumerate(candidates)]
            assert min(off) < 1e-6 * np.linalg.norm(right / right[np.argmin(off)])


def test_hits_tell_the_parameters_of_the_plane(truth):
    """f within a percent, the largest entry of R within a tenth, wherever a mode is found."""
    q, x = lei2023_data.postures(truth)
    few = slice(0, 36, 6)
    told = lei2023_hits.measured(truth, q[few], x[few], 1, lambda text, share: None)
    true = lei2023_data.parameters(truth, q[few], told.reference)
    low = slice(0, 4)
    assert np.isfinite(told.values[:, low, 0]).mean() > 0.9
    off = told.values[:, low, 0] / true[:, low, 0] - 1
    assert np.nanmedian(np.abs(off)) < 0.01
    size = np.linalg.norm(true[:, low, lei2023_data.RIGHT], axis=2)
    off = np.linalg.norm((told.values - true)[:, low, lei2023_data.RIGHT], axis=2) / size
    assert np.nanmedian(off) < 0.3


def test_missing_parameters_are_filled_from_neighbours():
    x = np.linspace(0, 1, 9)[:, None]
    y = np.column_stack([np.arange(9.0), np.arange(9.0)])
    y[4, 1] = np.nan
    filled = lei2023._filled(x, y)
    assert filled[4, 1] == 4.0  # the mean of 2, 3, 5, 6
    assert np.array_equal(np.delete(filled, 4, 0), np.delete(y, 4, 0))


def test_splits_are_nested_spread_and_complete():
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 7)), axis=-1).reshape(-1, 2)
    train, test = busch2022_data.split(grid, 3)
    assert sorted([*train, *test]) == list(range(35))
    assert len(train) == len(set(train)) == 15
    assert np.array_equal(train, busch2022_data.split(grid, 3)[0])
    assert not np.array_equal(train, busch2022_data.split(grid, 4)[0])
    # From every pose a trained one is near.
    apart = np.linalg.norm(grid[:, None] - grid[train][None], axis=2).min(axis=1)
    assert apart.max() < 0.5


def test_modes_of_a_posture_give_its_frf_back(tmp_path):
    """Six true modes nearly are the truth's FRF in their band."""
    truth = load_truth(KR210.write(tmp_path, 3))
    q = np.deg2rad([0.0, -80.0, 90.0, 0.0, 70.0, 180.0])
    whole = seyedhosseini2025_data.parameters(*truth.modes(q, seyedhosseini2025_data.MODES))
    predicted = seyedhosseini2025._synthesised(whole[None])[0]
    true = truth.accelerance(q, seyedhosseini2025.LINES_HZ)[np.arange(3), np.arange(3)]
    assert np.linalg.norm(predicted - true) < 0.1 * np.linalg.norm(true)


def test_a_report_is_written_as_tables_and_pictures(tmp_path):
    from planner.studies.drawing import new

    figure = new((3, 2), "empty")
    table = Table("t", "T", ("a", "b"), (("x", 1.5),))
    made = Report("busch2022", "data", (table,), (PaperClaim("p", "h", True),), {"f": figure})
    files = write(made, tmp_path)
    assert [f.rsplit("/", 1)[1] for f in files] == ["t.csv", "busch2022_claims.csv", "f.png"]
    assert (tmp_path / "t.csv").read_text().split() == ["a,b", "x,1.5"]
    assert made.table("t") is table
    assert write(made, None) == []


def test_bad_input_is_one_sentence(tmp_path):
    with pytest.raises(InputError, match=r"no study seed-9; choose one of busch2022"):
        registry.find("seed-9")
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(InputError, match="name another folder"):
        check_folder(file)
    with pytest.raises(InputError, match="name another folder"):
        check_folder(file / "below")


def test_the_most_informative_points_come_first():
    """Of D-optimal points the first few tell more than as many neighbours on one path."""
    simulation = birk2025._simulation("12P")
    truth = birk2025_data.true_robot()
    q, path = birk2025_data.poses(truth, 6)
    assert list(path[:6]) == ["S1"] * 6
    informative = birk2025_design.Informative.of(simulation, Priors(), (), q, 1.0, (5.0, 200.0))
    chosen = informative.best(4)
    assert len(set(chosen.tolist())) == 4
    assert informative.determined(chosen) >= informative.determined(np.arange(4))
    covariance, told = informative.covariance, informative.information.sum(axis=1)

    def gain(rows):
        return np.linalg.slogdet(np.eye(len(covariance)) + covariance @ told[rows].sum(axis=0))[1]

    assert all(gain([chosen[0]]) >= gain([i]) for i in range(len(q)))
    assert gain(chosen) > gain([0, 1, 2, 3])


def test_the_truth_of_birk_is_of_another_class():
    truth = birk2025_data.true_robot()
    assert len(truth.deviation.beams) == 3
    assert len(birk2025_data.gears(truth)) == 6
    stated = birk2025._simulation("24P").elasticity.stiffness
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
        assert registry.find(f"seed-00{i}") is registry.find(name)
