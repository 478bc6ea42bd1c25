"""Models as published beside public ones of the same model on the same data.

NARGP beside emukit's: same kernels, noise and data. At emukit's hyperparameters both must say the
same. Each finds hyperparameters by its own climb: ours must never end lower, and where both end on
the same peak, predict the same; where ours ends higher, emukit's is not the greatest likelihood.
`pytest -m slow -s tests/benchmarks/test_published_peers.py` prints the tables; the peers run in the
interpreter that PEERS_PYTHON names. PEERS_SEEDS (10) says how many designs per problem.
"""

import os
from pathlib import Path

import numpy as np
import pytest

from planner.demo import shipped
from planner.dynamics.simulation import Simulation
from planner.proof.deviation import Deviation
from planner.proof.load import load_truth
from planner.robot.robot import Robot
from planner.surrogate.kernels import perdikaris
from planner.surrogate.models.likelihood_gp import (
    NARGP,
    Normalisation,
    Samples,
    at_hyperparameters,
    fit_likelihood,
    fit_nargp,
)
from tests.support import peers
from tests.support.fusion_problems import PROBLEMS, Design, Problem, design

SEEDS = int(os.environ.get("PEERS_SEEDS", "10"))
NOISE = 1e-3  # sd over the cheap values' sd: the variance of 1e-6 that emukit's is given
EXPENSIVE = 15
LOW_STARTS, STARTS = 5, 30  # of the levels' climbs; of 30 each is rough at first
SAME_PEAK = 0.15  # difference of log-likelihoods of two climbs that say the same
# Of some hundred: 25 points on a line with next to no noise leave a nearly singular matrix.
LIKELIHOODS = 0.03
DRAWN = 0.02  # what emukit's 2,000 draws of the cheap level leave of an RMSE of 0.3 %

pytestmark = [pytest.mark.slow, pytest.mark.timeout(0), peers.peers_needed]


def kr240(mode: int) -> Problem:
    """A frequency of the KR240 over joints 2 and 3: MuJoCo's, and the nominal simulation's."""
    robot_toml = shipped("kr240_plane") / "robot" / "robot.toml"
    truth = load_truth(robot_toml, Deviation(5, 0.15, 0.1, 0.05, 0.005))
    simulation = Simulation(Robot.load(robot_toml))

    def joints(x):
        q = np.tile(np.deg2rad([0.0, -105.0, 95.0, 0.0, -40.0, 0.0]), (len(x), 1))
        q[:, 1] += np.deg2rad(50) * x[:, 0]
        q[:, 2] += np.deg2rad(50) * x[:, 1]
        return q

    return Problem(
        2,
        lambda x: np.array([truth.modes(q, mode + 1)[0][mode] for q in joints(x)]),
        lambda x: simulation.modes(joints(x), mode + 1).frequency_hz[:, mode],
    )


def scaled(d: Design) -> Design:
    """Both levels in the cheap one's unit."""
    units = Normalisation.of(d.y_low)
    low, high, test = ((y - units.centre) / units.scale for y in (d.y_low, d.y_high, d.y_test))
    return Design(d.x_low, low, d.x_high, high, d.x_test, test)


def own_nargp(d: Design, theta_low=None, theta_high=None) -> tuple[NARGP, float]:
    """The model and its levels' log-likelihoods' sum; at given hyperparameters, or its own."""
    same = Normalisation(0.0, 1.0)
    cheap, measured = Samples.of(d.x_low, d.y_low), Samples.of(d.x_high, d.y_high)
    if theta_low is None or theta_high is None:
        # Its noise is held, as in emukit, whose intermediate levels have a variance of 1e-4.
        low = fit_likelihood(cheap, "rbf", NOISE, starts=LOW_STARTS)
        model = fit_nargp(measured, low, same, noise=NOISE, units=same, starts=STARTS)
    else:
        low = at_hyperparameters(cheap, "rbf", theta_low, same)
        below = np.column_stack([d.x_high, low.predict(d.x_high)[0]])
        wide = Samples.of(below, d.y_high)
        kernel = perdikaris(d.x_high.shape[1])
        model = NARGP(low, at_hyperparameters(wide, kernel, theta_high, same), same)
    return model, low.log_likelihood + model.high.log_likelihood


def ask(designs: dict[str, Design], folder: Path, name: str):
    """What the public implementations say, from `folder` where they have said it already."""
    answers = folder / f"published{name}.npz"
    if not answers.exists():
        jobs, fresh = folder / f"jobs{name}.npz", folder / f"new{name}.npz"
        np.savez(jobs, **{f"{k}/{p}": v for k, d in designs.items() for p, v in vars(d).items()})
        peers.ask("published_peers.py", jobs, fresh)
        fresh.rename(answers)
    return np.load(answers)


def rmse(mean: np.ndarray, d: Design) -> float:
    """Over the output's sd."""
    return float(np.sqrt(np.mean((mean - d.y_test) ** 2)) / d.y_test.std())


def test_nargp_is_as_good_as_emukits(tmp_path):
    problems = {name: PROBLEMS[name] for name in ("forrester", "branin", "currin")}
    problems |= {f"KR240 mode {k + 1}": kr240(k) for k in range(2)}
    folder = Path(os.environ.get("FUSION_ANSWERS") or tmp_path)
    rows: dict[str, list] = {}
    for seed in range(SEEDS):
        designs = {
            f"{p}/{seed}": scaled(design(problem, EXPENSIVE, seed))
            for p, problem in problems.items()
        }
        told = ask(designs, folder, f"nargp{seed}")
        for key, d in designs.items():
            model, value = own_nargp(d)
            same, same_value = own_nargp(d, told[f"{key}/theta_low"], told[f"{key}/theta_high"])
            rows.setdefault(key.split("/")[0], []).append(
                (
                    rmse(told[f"{key}/mean"], d),
                    rmse(same.predict(d.x_test)[0], d),
                    rmse(model.predict(d.x_test)[0], d),
                    same_value - told[f"{key}/log_likelihood"].sum(),
                    value - same_value,
                )
            )
    print(f"\n{EXPENSIVE} expensive points, medians of {SEEDS} designs; RMSE over the output's sd")
    for name, each in rows.items():
        peer, same, own, differs, gain = np.transpose(each)
        print(
            f"{name:14s} emukit {np.median(peer):.5f}  at its hyperparameters {np.median(same):.5f}"
            f" (largest difference {100 * np.max(np.abs(same / peer - 1)):.2f} %)"
            f"  own {np.median(own):.5f}  likelihoods differ by {np.abs(differs).max():.4f}, own "
            f"climb gains {np.array2string(np.round(gain, 1))}, RMSE off by "
            f"{np.array2string(np.round(100 * (own / peer - 1), 2))} %"
        )
    for name, each in rows.items():
        peer, same, own, differs, gain = np.transpose(each)
        assert np.all(np.abs(differs) < LIKELIHOODS), name
        assert np.median(np.abs(same / peer - 1)) < 0.01, name
        assert np.all(np.abs(same / peer - 1) < DRAWN), name
        assert np.all(gain > -SAME_PEAK), name
        assert abs(np.median(own / peer - 1)) < 0.01, name
        assert np.median(np.abs(own / peer - 1)[np.abs(gain) < SAME_PEAK]) < 0.01, name
