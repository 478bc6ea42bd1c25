"""How long a person waits, with a peer in the same run: pytest -m slow tests/benchmarks -s"""

import numpy as np
import pytest

from planner.campaign.cell import Cell
from planner.campaign.config import load_campaign_config
from planner.dataset.measure import measure
from planner.dataset.screened_files import Source
from planner.dataset.store import Store
from planner.demo import Pool, shipped
from planner.dynamics.gradient import Inertias, laplace, motion_slopes, moved, response
from planner.dynamics.simulation import Elasticity, Simulation
from planner.modal.modes import Mode
from planner.modal.tracking import Guide, track
from planner.robot.robot import Robot
from planner.robot.virtual_joints import inertia_basis
from planner.surrogate.modal_surrogate import fit_surrogate
from planner.truth.arms import KR10
from planner.truth.deviation import Deviation
from planner.truth.hits import Hammer, record_poses
from planner.truth.load import load_truth
from tests.support.direct_solution import direct_accelerance
from tests.support.surrogates import observed, simulated
from tests.support.timing import seconds

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def cell():
    folder = shipped("kr240_plane")
    return Cell.load(
        folder / "robot" / "robot.toml", load_campaign_config(folder / "campaign.toml")
    )


def test_frf_against_a_direct_solution(cell):
    q, lines = cell.candidates.q[:1], np.linspace(4, 60, 800)
    simulation, m = cell.simulation, cell.simulation.elastic.matrices(q)
    ours = seconds(lambda: simulation.accelerance(q, lines))
    matrices = m.mass[0], simulation.damping, simulation.stiffness, m.hit[0], m.sensor[0]
    direct = seconds(lambda: direct_accelerance(*matrices, lines), 3)
    print(
        f"\nFRF 3 × 3 × 800 lines, 18 elastic rotations: {1e3 * ours:.2f} ms, "
        f"direct solution {1e3 * direct:.1f} ms, ratio {direct / ours:.0f}"
    )
    assert ours < direct


def test_files_to_modes(cell):
    folder = shipped("kr240_plane") / "recordings"
    rows = Pool.load(folder, cell.robot.joint_names).rows["A34"]
    sources = tuple(Source(r.file, r.file.name, r.hit) for r in rows)
    found, anew = [], Store(None)
    spent = seconds(lambda: found.append(measure(sources, (4.0, 60.0), store=anew).modal))
    print(f"\n12 hits from files to modes: {spent:.2f} s")
    assert all(modal is not None and len(modal.modes) >= 4 for modal in found)


def test_files_to_labelled_modes(cell, tmp_path):
    """Twelve new hits of 2 s at 1 kHz, labelled beside ten poses measured before."""
    truth = load_truth(cell.robot.path, Deviation(3, stiffness=0.1, damping=0.1, inertia=0.04))
    poses = [(f"P{i}", q) for i, q in enumerate(cell.candidates.q[::45][:11])]
    hammer = Hammer(sampling_rate_hz=1000.0, record_s=2.0)
    record_poses(truth, poses, tmp_path, hammer=hammer)
    q = np.array([q for _, q in poses])
    simulated = cell.frozen.simulate(q, 2)
    guide = Guide(simulated.frequency_hz, simulated.shape)
    files = [sorted((tmp_path / "data").glob(f"{name}_*.uff")) for name, _ in poses]

    def modes_of(number: int) -> tuple[Mode, ...]:
        sources = tuple(Source(file, file.name) for file in files[number])
        found = measure(sources, (4.0, 60.0)).modal
        assert found is not None
        return found.modes

    earlier = [modes_of(number) for number in range(10)]

    def act() -> None:
        tracks = track([*earlier, modes_of(10)], guide, cell.features(q), ordered=True)
        assert sum(mode is not None for mode in tracks.modes[10][:4]) == 4

    print(f"\n12 hits of 2 s at 1 kHz from files to labelled modes: {seconds(act):.2f} s")


@pytest.mark.filterwarnings("ignore")  # the peer's optimiser meets its bounds
def test_refit_against_scikit_learn():
    """80 outputs, hyperparameters averaged, against one point estimate of each of 4 outputs."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

    seen = observed(12, 0)
    query = np.random.default_rng(0).random((500, 2))
    ours = seconds(lambda: fit_surrogate(seen).predict(query, simulated(query)))

    def peer():
        for k in range(4):
            kernel = ConstantKernel(0.01) * Matern([1.0, 1.0], nu=2.5) + WhiteKernel(1e-6)
            model = GaussianProcessRegressor(kernel, n_restarts_optimizer=5, normalize_y=True)
            model.fit(seen.x, np.log(seen.frequency_hz[:, k])).predict(query, return_std=True)

    theirs = seconds(peer, 3)
    print(
        f"\nrefit and prediction at 500 points: {ours:.2f} s for 80 outputs, scikit-learn with 5 "
        f"restarts {theirs:.2f} s for 4, ratio per output {theirs / 4 / (ours / 80):.0f}"
    )
    assert ours / 80 < theirs / 4


def test_gradient_against_differences(tmp_path):
    """9 poses, 127 lines, 36 parameters."""
    simulation = Simulation(Robot.load(KR10.write(tmp_path, 3)))
    q, s = KR10.poses(9), laplace(np.tile(np.linspace(5, 200, 127), (9, 1)))
    m, springs = simulation.elastic.matrices(q), simulation.elasticity
    basis = np.tile(inertia_basis(), (6, 1, 1, 1))
    inertias = Inertias(simulation.elastic.body_jacobians(q), basis)

    def differences():
        before = response(m, springs, s)
        for kind in range(2):
            for j in range(18):
                values = [springs.stiffness.copy(), springs.damping.copy()]
                values[kind][j] *= 1 + 1e-6
                _ = response(m, Elasticity(*values, springs.loss_factor), s) - before

    def slopes(*inertias):
        motion = moved(m, springs, s)
        return motion.accelerance, motion_slopes(motion, springs, *inertias)

    ours = seconds(slopes, 15)
    whole = seconds(lambda: slopes(inertias), 15)
    peer = seconds(differences, 3)
    assert slopes()[1].shape == (9, 36, 3, 3, 127)
    print(
        f"\nFRFs and 36 derivatives, 9 poses × 127 lines: {1e3 * ours:.1f} ms (with 60 of inertias "
        f"{1e3 * whole:.1f} ms), forward differences {1e3 * peer:.0f} ms, ratio {peer / ours:.0f}"
    )
    assert ours < peer / 5
