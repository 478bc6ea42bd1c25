"""FRFs of hits without noise are those of the other engine's own matrices, but for the decay that
the end of each record cuts off, which fits have in their model."""

from dataclasses import replace

import numpy as np
import pytest

from planner.dataset.measure import MeasuredPose
from planner.dynamics.simulation import Simulation
from planner.proof.hits import AXES, simulate_hit
from planner.proof.load import load_truth
from planner.robot.robot import Robot
from planner.studies.hits import as_read
from tests.support.fitted_cases import drawn_arm, limits

POSES = 2


@pytest.mark.parametrize("name", ["kr10", "irb6640", "kr210"])
def test_perfect_hits_give_the_true_frfs(name, tmp_path):
    rng, arm = drawn_arm(name, 31, tmp_path)
    truth = load_truth(arm.toml)
    low, high = limits(arm, Simulation(Robot.load(arm.toml)))
    hammer = replace(arm.hammer, noise=0.0, force_noise=0.0)
    for q in rng.uniform(low, high, (POSES, len(low))):
        hits = [simulate_hit(truth, q, f"+{axis}", hammer, rng) for axis in AXES]
        frf = MeasuredPose((), arm.band_hz, given=as_read(hits, hammer)).frf.within(arm.band_hz)
        s = 2j * np.pi * frf.frequency_hz + frf.exponential_rate_1_s
        poles, residues, _ = truth.poles(q)
        each = 1 / (s - poles[:, None])
        true = s**2 * np.einsum("kij,kf->ijf", residues, each)
        ringing = residues * poles[:, None, None] ** 2
        cut = each * np.exp((poles[:, None] - s) * frf.tail_s)
        off = frf.accelerance - (true - np.einsum("kij,kf->ijf", ringing, cut))
        assert np.linalg.norm(off) < 1e-3 * np.linalg.norm(true)
