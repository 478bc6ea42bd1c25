"""Closed forms against what they claim: refits, determinants, differences, brute force, trials."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from planner.design.acquisitions import (
    SUBSETS,
    _wrong,
    goal,
    mixed,
    mutual_information,
    parameter_reduction,
    repeat_gain,
    share_left,
    stability,
    with_margins,
)
from planner.design.cost import Cost, axis_shares, best_axes, shortest_tour
from planner.design.frequency_posterior import FrequencyOutputs, Margins, Target
from planner.design.parameter_sensitivity import FrfNoise, UncertainParameters
from planner.design.propose import ACQUISITIONS, Travel
from planner.design.stopping import forecast, left_out, mean_squares
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Priors
from planner.fit.frequency_uncertainty import log_frequency_slope
from planner.fit.identify import robot_prior
from planner.fit.posterior import RobotBelief
from planner.fit.structure import exported
from planner.measurement.nuisances import EXACT_HITS, Tolerances
from planner.robot.robot import Robot
from planner.surrogate.modal_surrogate import fit_surrogate
from tests.support.robots import BAND_HZ, JOINTS_DEG, make_arm
from tests.support.surrogates import X, observed, over, proposed, with_parameters


@pytest.fixture(scope="module")
def surrogate():
    return fit_surrogate(observed(6, 0))


@pytest.fixture(scope="module")
def open_(tmp_path_factory):
    """An arm's simulation with 12 springs and uncertain inertias."""
    path = make_arm(tmp_path_factory.mktemp("arm"), transverse=True)
    simulation = Simulation(Robot.load(path))
    prior = robot_prior(simulation, Priors(mass=0.05, inertia=0.05, com_m=0.01))
    robot = RobotBelief.stated(prior, Tolerances())
    return UncertainParameters(robot, FrfNoise(0.01, 0.01, 0.5), BAND_HZ)


def some_q(n, seed=0):
    low, high = np.deg2rad(np.transpose(JOINTS_DEG))
    return np.random.default_rng(seed).uniform(low, high, (n, 6))


@pytest.mark.parametrize("name", ACQUISITIONS)
def test_planning_a_pose_leaves_less_to_gain_there(surrogate, name):
    outputs, poses = with_parameters(surrogate, X)
    score = ACQUISITIONS[name](outputs, poses)
    assert score.shape == (len(X),)
    assert np.isfinite(score).all()
    best = poses[[int(np.argmax(score))]]
    after = ACQUISITIONS[name](outputs.planning(best), best)
    assert after[0] < score.max()


def test_parameters_are_refitted_as_foretold(surrogate):
    """Σ' of a linear regression with the measurement's rows added, and its mean variance."""
    outputs, poses = with_parameters(surrogate, X)
    sigma = outputs.covariance_root @ outputs.covariance_root.T
    target = outputs.workspace
    names = "parameter_information", "d_information"
    score, told = (ACQUISITIONS[name](outputs, poses[:5]) for name in names)
    for i in range(5):
        refit = np.linalg.inv(np.linalg.inv(sigma) + poses.information[i].sum(axis=0))
        gain = 0.0
        for k in range(4):
            s = outputs.trust[k] * target.poses.slope[:, k]
            each = np.einsum("up,pr,ur->u", s, sigma - refit, s)
            gain += each @ target.importance[:, k]
        assert score[i] == pytest.approx(gain, rel=1e-6)
        # Six parameters move four modes at twenty poses: the whole determinant counts.
        ratio = np.linalg.slogdet(sigma)[1] - np.linalg.slogdet(refit)[1]
        assert told[i] == pytest.approx(ratio / 2, rel=1e-6)
        planned = outputs.planning(poses[[i]])
        np.testing.assert_allclose(
            planned.covariance_root @ planned.covariance_root.T, refit, atol=1e-9
        )


def test_more_axes_tell_more(surrogate):
    outputs, poses = with_parameters(surrogate, X)
    pose = poses[[3]]
    gain = [parameter_reduction(outputs, pose, outputs.workspace, axes)[0] for axes in SUBSETS]
    for i, a in enumerate(SUBSETS):
        for j, b in enumerate(SUBSETS):
            if set(a) < set(b):
                assert gain[i] < gain[j]


def test_a_goal_draws_the_proposal_to_itself(surrogate):
    outputs, poses = over(surrogate, X, 30)
    there = Target.evenly(poses[[77]])
    at_goal = FrequencyOutputs.of(surrogate, outputs.workspace, there)
    best = int(np.argmax(goal(at_goal, poses)))
    assert np.linalg.norm(X[best] - X[77]) < 0.15


def test_mutual_information_is_a_difference_of_entropies(surrogate):
    outputs, poses = over(surrogate, X, 10)
    score = mutual_information(outputs, poses[:12])

    def information(i, k, s):
        """½ log |A| |B| / |A ∪ B| of the noisy values at c and at the rest of the workspace."""
        rest = np.array([j for j in range(10) if j != i])
        both = poses[np.append(rest, i)]
        cov = outputs.covariance(k, both, both)[0][s] + outputs.noise[k] * np.eye(len(rest) + 1)
        whole, parts = np.linalg.slogdet(cov)[1], np.linalg.slogdet(cov[:-1, :-1])[1]
        return 0.5 * (parts + np.log(cov[-1, -1]) - whole)

    samples = range(len(outputs.posteriors[0].theta))
    for i in (0, 4, 9, 11):
        expected = (
            np.mean([[information(i, k, s) for s in samples] for k in range(4)], axis=1)
            @ outputs.weights
        )
        assert score[i] == pytest.approx(expected, rel=1e-6)


def test_repeating_is_a_refit_with_half_the_variance(surrogate):
    outputs, _ = over(surrogate, X, 30)
    variance = np.full((6, 4), 1e-7)
    gain, target = repeat_gain(outputs, variance), outputs.workspace
    for i in (0, 5):
        drop = 0.0
        for k, post in enumerate(outputs.posteriors):
            cross = post.prior(post.x, post.low, target.poses.x, target.poses.low[:, k])
            for s in range(len(post.theta)):
                whiten = post.solved.whiten[s]
                noisy = np.linalg.inv(whiten.T @ whiten)
                less = noisy.copy()
                less[i, i] -= 1e-7 / 2
                white = [np.sum(cross[s] * np.linalg.solve(c, cross[s]), 0) for c in (less, noisy)]
                drop += (white[0] - white[1]) @ target.importance[:, k] / len(post.theta)
        assert gain[i] == pytest.approx(drop, rel=1e-4)


def moved(open_, x):
    """The simulation at x, in the posture in which it sags now: that hardly moves with springs."""
    changed = exported(open_.belief.structure, x)[0]
    changed.elastic = changed.elastic.carried_by(open_.simulation.elasticity.stiffness)
    return changed


def test_slopes_are_the_derivatives_of_ln_f(open_):
    q, belief = some_q(2), open_.belief
    slope = log_frequency_slope(belief, q, open_.simulation.modes(q, 4))
    x, count = belief.x, len(belief.structure.parameters)

    def log_hz(at):
        return np.log(moved(open_, at).modes(q, 4).frequency_hz)

    for i in (0, 3, 11, count, count + 7, belief.physical.stop - 1):
        step = np.zeros(len(x))
        step[i] = 1e-5
        by_difference = (log_hz(x + step) - log_hz(x - step)) / 2e-5
        np.testing.assert_allclose(slope[:, :, i], by_difference, atol=1e-6)


def test_information_is_that_of_the_frf_line_by_line(open_):
    """Against finite differences of the simulated FRF on every line that would be recorded."""
    q = some_q(1, 3)
    lines = np.arange(BAND_HZ[0], BAND_HZ[1], open_.noise.step_hz)
    open_ = replace(open_, belief=replace(open_.belief, tolerances=EXACT_HITS))
    x, count = open_.belief.x, len(open_.belief.structure.parameters)
    h = open_.simulation.accelerance(q, lines)[0]
    sd = np.hypot(open_.noise.relative * np.abs(h), open_.noise.floor)
    rows, chosen = [], (0, 1, 2, 12, count + 3)
    for i in chosen:
        values = []
        for sign in (1, -1):
            at = x.copy()
            at[i] += sign * 1e-5
            values.append(moved(open_, at).accelerance(q, lines)[0])
        rows.append(np.sqrt(2) * (values[0] - values[1]) / 2e-5 / sd)
    found = open_.information(q)[0]
    for axis in range(3):
        j = np.array([row[:, axis].ravel() for row in rows])
        expected = (j @ j.conj().T).real
        got = found[axis][np.ix_(chosen, chosen)]
        scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
        # Few lines around each resonance stand for all: right to a few percent in what is told
        # of most, to 40 % in what is told of one whose mode lies beside the band.
        off = np.abs(got - expected) / scale
        assert off.max() < 0.45
        assert np.median(off) < 0.025


def test_hits_that_err_and_springs_that_scatter_from_visit_to_visit_tell_less(open_):
    """No more than one visit's springs tell of them, however small the noise."""
    q, belief = some_q(1, 3), open_.belief
    kinds = EXACT_HITS, replace(EXACT_HITS, visit_stiffness=0.004), belief.tolerances
    told = [
        replace(open_, belief=replace(belief, tolerances=one)).information(q)[0].sum(axis=0)
        for one in kinds
    ]
    for more, less in itertools.pairwise(told):
        assert np.linalg.eigvalsh(more - less).min() > -1e-8 * np.abs(more).max()
    spring = 2
    assert told[0][spring, spring] > 1 / 0.004**2 > told[1][spring, spring]


def test_forecast_speaks_of_its_own_samples(surrogate):
    outputs, poses = over(surrogate, X, 64)
    squares = mean_squares(outputs)
    total = np.sum([outputs.variance(k, poses[:64]) / 64 / 4 for k in range(4)])
    assert np.mean(squares) >= 0.8 * total  # and the doubt about hyperparameters besides
    best = poses[[int(np.argmax(mixed(outputs, poses)))]]
    found = forecast(outputs, best, 1.0, 0.95)
    assert 0 < found.rmse_percent < found.bound_percent
    assert found.gain_percent > 0
    assert "One more pose should bring the RMSE to about" in found.text
    assert forecast(outputs, None, 1e3, 0.95).reached == 1
    assert forecast(outputs, None, 1e-9, 0.95).reached == 0


def test_left_out_residuals_are_those_of_refits(surrogate):
    """Leave one out by solving without it, at the hyperparameters held."""
    outputs, squares = surrogate.primary.most_probable.outputs, []
    for post in outputs:
        for i in range(len(post.x)):
            means, variances = [], []
            for s in range(len(post.theta)):
                whiten = post.solved.whiten[s]
                noisy = np.linalg.inv(whiten.T @ whiten)
                y = noisy @ post.solved.weights[s]
                rest = np.arange(len(post.x)) != i
                pull = np.linalg.solve(noisy[np.ix_(rest, rest)], noisy[rest, i])
                means.append(y[i] - pull @ y[rest])
                variances.append(noisy[i, i] - pull @ noisy[rest, i])
            squares.append(np.mean(means) ** 2 / (np.mean(variances) + np.var(means)))
    poses, size = left_out(outputs)
    assert poses == 6
    assert size == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-6)


def test_the_best_gain_per_minute_is_near_and_tours_are_short(surrogate):
    q = np.random.default_rng(5).uniform(-1, 1, (len(X), 6))
    slow = Cost(np.full(6, 1e-3), per_pose=0.0, per_hit=1e-6)
    for cost in (slow, replace(slow, speed_rad_s=np.full(6, 1e-2))):
        (pick,) = proposed("integrated_variance", surrogate, X, 1, travel=Travel(cost, q, q[0]))
        assert pick.index == 0  # where it stands: no minutes
    order, legs = shortest_tour(slow, q[:8], q[100])
    given = sum(slow.travel(q[i + 1 : i + 2], q[i])[0] for i in range(7))
    given += slow.travel(q[:1], q[100])[0]
    assert sorted(order.tolist()) == list(range(8))
    assert legs.sum() < given


def test_what_is_not_allowed_is_not_proposed(surrogate):
    allowed = X[:, 0] < 0.3
    for name in ("integrated_variance", "maximin_lhs"):
        picks = proposed(name, surrogate, X, 5, allowed=allowed)
        assert all(allowed[p.index] for p in picks)


def test_axes_are_saved_where_one_shows_every_mode(surrogate):
    outputs, poses = over(surrogate, X, 30)
    cost = Cost(np.ones(6), per_pose=1.0, per_hit=0.25, hits_per_axis=4)
    along_x = np.tile([0.8, 0.1, 0.1], (4, 1))
    hidden = along_x.copy()
    hidden[2] = [0.01, 0.5, 0.49]  # mode 3 does not show along x
    assert best_axes(outputs, poses[[60]], along_x, cost, 0.0) == (0,)
    assert best_axes(outputs, poses[[60]], hidden, cost, 0.0) in ((1,), (2,))
    free = Cost(np.ones(6), per_pose=1.0, per_hit=1e-9)
    assert best_axes(outputs, poses[[60]], along_x, free, 0.0) == (0, 1, 2)


def test_shares_of_the_axes_add_up():
    rng = np.random.default_rng(3)
    residue = rng.standard_normal((5, 2, 3, 3)) + 1j * rng.standard_normal((5, 2, 3, 3))
    residue[1, 1] = np.nan
    np.testing.assert_allclose(axis_shares(residue).sum(axis=2), 1.0)


PATH = np.array([100, 105, 110])


def asked(surrogate, margin, sd=0.1, parameters=True):
    """Outputs with margins at three of the candidates, which hang on two labels."""
    outputs, poses = with_parameters(surrogate, X) if parameters else over(surrogate, X, 20)
    slope = np.tile([2.0, -1.0, 0.0, 0.0], (3, 1))
    there = Margins(poses[PATH], np.array(margin), np.full(3, sd), slope, np.zeros(3))
    return with_margins(outputs, there), poses


def test_what_is_foretold_of_a_pose_is_what_planning_it_leaves(surrogate):
    outputs, poses = asked(surrogate, [0.1, -0.1, 0.0])
    assert share_left(outputs) == pytest.approx(np.ones(3))
    foretold = share_left(outputs, poses)
    for i in (3, 50, 105):
        planned = share_left(outputs.planning(poses[[i]]))
        assert planned == pytest.approx(foretold[i], rel=1e-6)
        assert np.all(planned < 1)


def test_wrong_answers_are_those_of_trials(surrogate):
    """Draw what is measured, answer by the new mean, and count against what is true."""
    outputs, _ = asked(surrogate, [0.05, -0.12, 0.3])
    margins, left = outputs.margins, np.array([0.3, 0.6, 0.9])
    assert margins is not None
    rng = np.random.default_rng(1)
    mean = margins.margin + margins.sd * np.sqrt(1 - left) * rng.standard_normal((200_000, 3))
    true = mean + margins.sd * np.sqrt(left) * rng.standard_normal(mean.shape)
    wrong = np.mean((mean > 0) != (true > 0), axis=0)
    assert _wrong(margins, left) == pytest.approx(wrong, abs=0.01)  # by 15 nodes, over a kink
    nothing = _wrong(margins, np.ones(3))
    assert nothing == pytest.approx(norm.cdf(-np.abs(margins.margin) / margins.sd))


def test_it_measures_where_the_answer_is_open(surrogate):
    """Where poses tell little of each other: the one whose margin is about zero."""
    for pose in range(3):
        margin = np.where(np.arange(3) == pose, 0.01, 2.0)
        outputs, poses = asked(surrogate, margin, parameters=False)
        score = stability(outputs, poses[PATH])
        assert np.argmax(score) == pose
        assert np.all(score >= 0)


def test_more_measurements_do_not_make_more_mistakes(surrogate):
    outputs, poses = asked(surrogate, [0.05, -0.05, 0.1])
    first = stability(outputs, poses)
    after = stability(outputs.planning(poses[[int(np.argmax(first))]]), poses)
    assert np.all(first > -1e-9)
    assert after.max() < first.max()
    without = replace(outputs, margins=None)
    assert np.all(stability(without, poses) > 0)
