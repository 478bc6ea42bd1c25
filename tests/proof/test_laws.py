"""Robots with nonlinear joints: an ODE solver, the linear limit, and what textbooks say.

`pytest -m slow tests/proof/test_laws.py` integrates the other laws as well.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from planner.errors import InputError
from planner.proof.arms import KR10
from planner.proof.deviation import Deviation
from planner.proof.fault_injection import InjectedFaults, frfs, once
from planner.proof.hits import Hammer
from planner.proof.laws import Backlash, Contact, Friction, Hardening, JointLaw
from planner.proof.load import load_truth
from planner.proof.model import Truth
from planner.proof.nonlinear import HitPose, Port, respond

STEP, N = 1 / 6400, 3200
EXACTLY = np.eye(6)  # wrenches of hits exactly along an axis of the tcp, and at it
Q = KR10.poses(1)[0]
ANGLE = 3e-4
QUIET = Hammer(80.0, 0.004, record_s=2.56, noise=0.0, force_noise=0.0)
LAWS = {
    "hardening": Hardening(8e4, ANGLE),
    "softening": Hardening(-4e4, ANGLE),
    "backlash": Backlash(5e4, ANGLE / 2),
    "friction": Friction(6e4, 6e4 * ANGLE / 3),
    "contact": Contact(3e4, ANGLE / 3),
}


@pytest.fixture(scope="module")
def truth(tmp_path_factory) -> Truth:
    return load_truth(KR10.write(tmp_path_factory.mktemp("kr10")))


def pulses(peaks: list[float]) -> np.ndarray:
    t = np.arange(N) * STEP
    return np.outer(peaks, np.sin(np.pi * np.clip((t - 0.01) / 0.006, 0, 1)) ** 2)


def test_without_laws_it_is_the_linear_truth(truth):
    forces, axes = pulses([100.0, 30.0, 60.0]), [0, 1, 2]
    ours = respond([HitPose(truth, Q, forces, EXACTLY[axes])], (), STEP)[0]
    theirs = [truth.respond(Q, f, a, STEP) for f, a in zip(forces, axes, strict=True)]
    assert np.max(np.abs(ours - theirs)) < 1e-9 * np.max(np.abs(ours))


QUICK = "hardening", "friction"  # of an elastic law and of one with a memory
EACH = [pytest.param(v, marks=() if k in QUICK else pytest.mark.slow) for k, v in LAWS.items()]


@pytest.mark.parametrize("law", [None, *EACH], ids=["linear", *LAWS])
def test_response_is_that_of_an_ode_solver(truth, law):
    force = pulses([300.0])
    linear = truth.respond(Q, force[0], 1, STEP)
    pose, ports = HitPose(truth, Q, force, EXACTLY[[1]]), [Port(law, joint="joint_2")]
    response = linear if law is None else respond([pose], ports, STEP)[0][0]
    mass, damping, stiffness, hit, sensor = truth.matrices(Q)
    own, e, t = truth.own("joint_2"), len(mass), np.arange(N) * STEP

    def torque(angle: float, z: float) -> float:
        if isinstance(law, Friction):
            return law.stiffness * z
        if law is None:
            return 0.0
        return float(law.torque(np.zeros(1), np.array([angle]), np.array([angle]), STEP)[0][0])

    def acceleration(y, f):
        load = hit[1] * f - damping @ y[e:-1] - stiffness @ y[:e]
        return np.linalg.solve(mass, load - own * torque(own @ y[:e], y[-1]))

    def slope(time, y):
        rate = own @ y[e:-1]
        limit = law.coulomb / law.stiffness if isinstance(law, Friction) else 1.0
        now = acceleration(y, np.interp(time, t, force[0]))
        return np.concatenate([y[e:-1], now, [rate - np.abs(rate) * y[-1] / limit]])

    found = solve_ivp(slope, (0, t[-1]), np.zeros(2 * e + 1), "DOP853", t[::20],
                      rtol=1e-8, atol=1e-13, max_step=1e-3)  # fmt: skip
    expected = np.transpose(
        [sensor @ acceleration(y, f) for y, f in zip(found.y.T, force[0, ::20], strict=True)]
    )
    error = np.max(np.abs(response[:, ::20] - expected))
    if law is None:
        assert error < 1e-4 * np.max(np.abs(expected))
    else:
        assert error < 3e-3 * np.max(np.abs(expected))
        assert np.std(response - linear) > 0.05 * np.std(linear)  # it does something


@pytest.mark.parametrize("law", EACH, ids=LAWS)
def test_hits_die_out(truth, law):
    force = np.pad(pulses([300.0]), ((0, 0), (0, 5 * N)))
    response = respond(
        [HitPose(truth, Q, force, EXACTLY[[0]])], [Port(law, joint="joint_1")], STEP
    )[0][0]
    blocks = np.sqrt(np.mean(response[:, N:].reshape(3, 5, -1) ** 2, axis=(0, 2)))
    assert np.all(blocks[1:] < blocks[:-1])


def test_poses_integrated_together_do_not_meet(truth):
    port, other = Port(LAWS["friction"], joint="joint_2"), KR10.poses(2, seed=3)[1]
    poses = [
        HitPose(truth, Q, pulses([300.0, 40.0]), EXACTLY[[0, 2]]),
        HitPose(truth, other, pulses([99.0]), EXACTLY[[1]]),
    ]
    together = respond(poses, [port], STEP)
    alone = [respond([pose], [port], STEP)[0] for pose in poses]
    for a, b in zip(together, alone, strict=True):
        assert np.max(np.abs(a - b)) < 1e-5 * np.max(np.abs(b))


def resonance(truth: Truth, law: JointLaw, peak_n: float) -> float:
    """Frequency of the first mode as a hit shows it, between two bins."""
    visit = [once(Q, peak_n)]
    f, H = frfs(
        truth, InjectedFaults(Deviation(), (Port(law, joint="joint_2"),)), visit, QUIET, (5.0, 20.0)
    )
    power = np.sum(np.abs(H[0]) ** 2, axis=(0, 1))
    near = slice(max(int(np.argmax(power)) - 3, 0), int(np.argmax(power)) + 4)
    return float(np.sum(power[near] * f[near]) / np.sum(power[near]))


def test_hardening_raises_and_softening_lowers_the_frequency_with_the_level(truth):
    low, middle, high = (resonance(truth, LAWS["hardening"], p) for p in (3.0, 200.0, 600.0))
    assert low < middle - 0.1 < high - 0.2
    low, middle, high = (resonance(truth, LAWS["softening"], p) for p in (3.0, 200.0, 600.0))
    assert low > middle + 0.1 > high + 0.2
    linear = truth.modes(Q, 1)[0][0]
    assert low == pytest.approx(linear, abs=0.3)


def test_backlash_lowers_the_frequency_at_low_level(truth):
    law = Backlash(3e4, ANGLE / 2)
    assert resonance(truth, law, 3.0) < resonance(truth, law, 600.0) - 0.3
    assert resonance(truth, law, 2000.0) == pytest.approx(truth.modes(Q, 1)[0][0], abs=0.5)


def test_friction_stiffens_a_joint_at_low_level_only(truth):
    law = Friction(4e4, 4e4 * ANGLE / 10)
    low, high = resonance(truth, law, 0.5), resonance(truth, law, 2000.0)
    assert low > high + 0.5
    assert high == pytest.approx(truth.modes(Q, 1)[0][0], abs=0.5)


def test_a_step_too_long_is_refused(truth):
    port = Port(Hardening(1e9, ANGLE), joint="joint_6")
    with pytest.raises(InputError, match="shorten the step"):
        respond([HitPose(truth, Q, pulses([1.0]), EXACTLY[[0]])], [port], STEP)
