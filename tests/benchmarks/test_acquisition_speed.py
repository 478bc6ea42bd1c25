"""Integrated variance beside emukit's on the same posterior, and at full size.

`PEERS_PYTHON=… pytest -m slow -s tests/benchmarks/test_acquisition_speed.py` prints the times.
"""

from pathlib import Path

import numpy as np
import pytest

from planner.design.acquisitions import reduction
from planner.design.frequency_posterior import FrequencyOutputs, Poses, Target
from planner.surrogate.gp import Posterior
from planner.surrogate.kernels import matern52
from tests.support.peers import ask, peers_needed
from tests.support.timing import spent

LONG = pytest.mark.timeout(1200)
D, N, NOISE = 4, 15, 1e-4
JITTER = 1e-8  # that GPy adds to the diagonal of the training covariance
LENGTHS = np.array([0.5, 0.8, 1.1, 0.6])


def posteriors(outputs: int) -> tuple[Posterior, ...]:
    """GPs with a Matérn kernel and no linear terms, one hyperparameter sample, N points."""
    rng = np.random.default_rng(0)
    x = rng.random((N, D))
    lengths = LENGTHS * np.linspace(1, 1.5, outputs)[:, None]
    theta = np.column_stack([np.zeros(outputs), np.full(outputs, -50.0), np.log(lengths)])
    zero, variance = np.zeros(N), np.full(N, NOISE)
    return tuple(
        Posterior(np.arange(N), x, zero, variance, zero, one[None], np.zeros(1), 0.0, 0.0,
                  "matern52", 0.0, JITTER)
        for one in theta
    )  # fmt: skip


def problem(outputs: int, points: int, candidates: int):
    rng = np.random.default_rng(1)
    at, x = rng.random((points, D)), rng.random((candidates, D))
    target = Target.evenly(Poses.plain(at, np.zeros((points, outputs))))
    seen = FrequencyOutputs(
        posteriors(outputs), target, target, np.full(outputs, NOISE), target.poses[:0],
        np.ones(outputs), np.zeros((0, 0)),
    )  # fmt: skip
    return seen, Poses.plain(x, np.zeros((candidates, outputs)))


def timed(call):
    call()
    return spent(call)


def test_a_small_problem_by_the_formula():
    seen, poses = problem(1, 7, 5)
    x, at, some = seen.posteriors[0].x, seen.workspace.poses.x, poses.x

    def k(a, b):
        return matern52(np, a / LENGTHS, b / LENGTHS)

    inverse = np.linalg.inv(k(x, x) + (NOISE + JITTER) * np.eye(N))
    left = k(some, at) - k(some, x) @ inverse @ k(x, at)
    own = np.diagonal(k(some, some) - k(some, x) @ inverse @ k(x, some))
    expected = np.mean(left**2, axis=1) / (own + NOISE)
    np.testing.assert_allclose(reduction(seen, poses, seen.workspace), expected, rtol=1e-5)


@pytest.mark.slow
@LONG
@peers_needed
def test_beside_emukit(tmp_path: Path):
    seen, poses = problem(1, 1000, 10_000)
    post = seen.posteriors[0]
    y = np.random.default_rng(2).standard_normal(N)
    np.savez(
        tmp_path / "job.npz", x=post.x, y=y, variance=1.0, lengths=LENGTHS, noise=NOISE,
        candidates=poses.x, points=seen.workspace.poses.x,
    )  # fmt: skip
    ask("acquisition_peers.py", tmp_path / "job.npz", tmp_path / "answer.npz")
    answer = np.load(tmp_path / "answer.npz")
    score, wall, own = timed(lambda: reduction(seen, poses, seen.workspace))
    theirs, theirs_own = float(answer["seconds"]), float(answer["processor"])
    worst = np.max(np.abs(score / answer["scores"] - 1))
    print(
        f"\n10^4 candidates × 10^3 points × 1 output: ours {wall:.3f} s (processor {own:.3f}), "
        f"emukit {theirs:.1f} s ({theirs_own:.1f}): {theirs / wall:.0f} × faster, "
        f"{theirs_own / own:.0f} × less processor time; scores differ by {worst:.1e} at most"
    )
    assert worst < 1e-6
    assert theirs_own >= 100 * own


@pytest.mark.slow
@LONG
def test_full_size():
    seen, poses = problem(8, 2000, 100_000)
    runs = [timed(lambda: reduction(seen, poses, seen.workspace)) for _ in range(3)]
    walls = sorted(wall for _, wall, _ in runs)
    print(
        f"\n10^5 × 2·10^3 × 8 outputs: {walls[0]:.2f} s at best, {walls[1]:.2f} s in the middle of "
        f"three, processor {min(own for *_, own in runs):.2f} s"
    )
    assert all(np.isfinite(score).all() for score, *_ in runs)
    assert walls[0] <= 3.0
