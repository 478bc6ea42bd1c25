"""Modes of a made-up simulation over two joints, and measured ones that deviate from it.

Candidates of an acquisition over it, and what a refit leaves there.
"""

import numpy as np

from planner.design.cost import Cost
from planner.design.frequency_posterior import FrequencyOutputs, Poses, Target
from planner.design.propose import Travel, propose
from planner.dynamics.vibration import SimulatedModes
from planner.surrogate.modal_surrogate import ModalObservations

X = np.random.default_rng(4).random((120, 2))


def simulated(x, k=4):
    f = np.stack(
        [(8 + 9 * i) * (1 + 0.2 * x[:, 0] * (-1) ** i + 0.1 * x[:, 1]) for i in range(k)], 1
    )
    return SimulatedModes(f, np.full(f.shape, 0.02), np.full((*f.shape, 3, 3), -1e-6j))


def observed(n, seed, scale=1.12, k=4):
    rng = np.random.default_rng(seed)
    x = rng.random((n, 2))
    low = simulated(x, k)
    truth = true_hz(x, scale, k)
    f = truth * (1 + 1e-3 * rng.standard_normal(truth.shape))
    zeta = 0.03 * np.exp(0.1 * rng.standard_normal(f.shape))
    return ModalObservations(
        x, f, 1e-3 * f, zeta, 0.05 * zeta, 1.3 * low.residue, np.full((n, k, 3, 3), 1e-8), low
    )


def true_hz(x, scale=1.12, k=4):
    bend = 1 + 0.03 * np.sin(4 * x[:, :1] + 2 * x[:, 1:2])
    return simulated(x, k).frequency_hz * scale * bend


def over(surrogate, x, workspace):
    """Outputs over the first poses of x (n, 2), and all of them as poses."""
    poses = Poses.plain(x, surrogate.frequency_inputs(simulated(x)))
    return FrequencyOutputs.of(surrogate, Target.evenly(poses[:workspace])), poses


def proposed(name, surrogate, x, count, taken=0, travel=None, allowed=True):
    """Picks among x (n, 2), of which the first are taken; by default the robot is everywhere."""
    travel = travel or Travel(Cost(np.ones(2)), np.zeros((len(x), 2)))
    outlook, allowed = over(surrogate, x, 200), np.broadcast_to(allowed, len(x))
    return propose(name, x, count, x[:taken], 3, outlook, travel, allowed)


def with_parameters(surrogate, x, p=6):
    """The same with p open parameters of a made-up simulation."""
    rng = np.random.default_rng(1)
    plain = Poses.plain(x, surrogate.frequency_inputs(simulated(x)))
    slope = 0.3 * np.sin(x @ rng.normal(size=(2, 4 * p)) * 3).reshape(len(x), 4, p)
    j = rng.normal(size=(len(x), 3, 2, p)) * (1 + x[:, :1, None, None])
    information = np.swapaxes(j, 2, 3) @ j
    poses = Poses(plain.x, plain.low, slope, information)
    covariance = np.cov(rng.normal(size=(p, 3 * p))) * 0.01
    return FrequencyOutputs.of(surrogate, Target.evenly(poses[:20]), None, covariance), poses


def conditioned_variance(outputs, k, c, low_c):
    """Mean variance over the workspace once c is measured, by adding a row to the GP itself."""
    post, total = outputs.posteriors[k], []
    x, low = np.vstack([post.x, c[None]]), np.append(post.low, low_c)
    for s in range(len(post.theta)):
        whiten = post.solved.whiten[s]
        noisy = np.linalg.inv(whiten.T @ whiten)  # covariance of what was measured, with noise
        cross = post.prior(post.x, low[:-1], c[None], low[-1:])[s]
        own = post.prior(c[None], low[-1:], c[None], low[-1:])[s] + outputs.noise[k]
        grown = np.block([[noisy, cross], [cross.T, own]])
        xu, lu = outputs.workspace.poses.x, outputs.workspace.poses.low[:, k]
        at = post.prior(x, low, xu, lu)[s]
        there = post.prior(xu, lu, xu, lu)[s]
        reduced = np.sum(at * np.linalg.solve(grown, at), axis=0)
        total.append(np.mean(np.diag(there) - reduced))
    return float(np.mean(total))
