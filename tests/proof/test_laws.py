"""Laws of joints: energies and backbones that can be written down; robots with them, by an ODE.

`pytest -m slow tests/proof/test_laws.py` integrates the other laws as well.
"""

import itertools
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from planner.errors import InputError
from planner.proof.arms import KR10
from planner.proof.laws import (
    AmplitudeSoftening,
    Backlash,
    BoucWen,
    Contact,
    Friction,
    Hardening,
    HarmonicDrive,
    ImpactDamping,
    Iwan,
    JointLaw,
    LuGre,
    QuadraticDamping,
    Stops,
    stacked,
)
from planner.proof.load import load_truth
from planner.proof.model import Truth
from planner.proof.nonlinear import HitPose, Port, respond

K, COULOMB, A, RATE = 6e4, 9.0, 3e-4, 60.0  # N·m/rad, N·m, rad, rad/s
Z = COULOMB / K
STEPS = 2000  # a cycle
STEP_S = 2 * np.pi / RATE / STEPS
CYCLES = 4
PLAIN = "hardening", "softening", "backlash", "friction", "contact"  # with exact bounds
LAWS = {
    "hardening": Hardening(8e4, A),
    "softening": Hardening(-4e4, A),
    "backlash": Backlash(5e4, A / 2),
    "friction": Friction(K, K * A / 3),
    "contact": Contact(3e4, A / 3),
    "harmonic drive": HarmonicDrive(K, A / 3, A / 2),
    "amplitude softening": AmplitudeSoftening(K, A / 2),
    "Bouc-Wen": BoucWen(K, COULOMB),
    "Iwan": Iwan(K, COULOMB),
    "LuGre": LuGre(K, COULOMB, 1.5 * COULOMB, 0.01, 5.0),
    "impact damping": ImpactDamping(K, A / 3, 2e6),
    "quadratic damping": QuadraticDamping(3e4, 2 * RATE * A),
    "stops": Stops(K, A / 3),
}


def along(law: JointLaw, angles: np.ndarray) -> np.ndarray:
    """Torques along a path of angles (n,)."""
    state, torques = law.at_rest((1,)), [0.0]
    for before, now in itertools.pairwise(angles):
        torque, state = law.torque(state, np.array([before]), np.array([now]), STEP_S)
        torques.append(float(torque[0]))
    return np.array(torques)


@cache
def cycle(law: JointLaw, amplitude: float = A) -> tuple[np.ndarray, np.ndarray]:
    """Angles and torques over the last cycle of a sine."""
    angles = amplitude * np.sin(2 * np.pi * np.arange(CYCLES * STEPS + 1) / STEPS)
    return angles[-STEPS - 1 :], along(law, angles)[-STEPS - 1 :]


def lost(law: JointLaw, amplitude: float = A) -> float:
    """Energy of a cycle in J; torques belong to the middle of a step where they have a rate."""
    angles, torques = cycle(law, amplitude)
    rated = isinstance(law, ImpactDamping | QuadraticDamping | LuGre)
    there = torques[1:] if rated else (torques[1:] + torques[:-1]) / 2
    return float(there @ np.diff(angles))


@pytest.mark.parametrize(
    "name", ["hardening", "backlash", "harmonic drive", "amplitude softening", "stops"]
)
def test_elastic_laws_lose_nothing_and_have_their_backbone(name):
    law = LAWS[name]
    assert abs(lost(law)) < 1e-6 * K * A**2
    angles, torques = cycle(law)
    softer = lambda u: (1 + (2 * u / A) ** 2) ** -0.5 - 1  # noqa: E731
    half = {
        "hardening": lambda t: 8e4 * t**3 / (t**2 + A**2),
        "backlash": lambda t: -5e4 * min(t, A / 2),
        "harmonic drive": lambda t: K * (max(t - A / 3, 0) + max(t - A / 2, 0)),
        "amplitude softening": lambda t: K * quad(softer, 0, t)[0],
        "stops": lambda t: K * max(t - A / 3, 0),
    }[name]
    for k in range(0, len(angles), 97):
        expected = np.sign(angles[k]) * half(abs(angles[k]))
        assert torques[k] == pytest.approx(expected, rel=1e-9, abs=1e-9 * K * A)


def fixed(step: Callable[[float], float]) -> float:
    """Where z = step(z), between 0 and Z, for a step that falls."""
    low, high = 0.0, Z
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if step(middle) > middle else (low, middle)
    return low


def test_bouc_wens_loop_is_a_line_and_a_tanh():
    """Unloading by z_m, then loading to it again: z_m = z_c tanh((2A - z_m) / z_c)."""
    for amplitude in (A / 5, A, 5 * A):
        top = fixed(lambda z, a=amplitude: Z * np.tanh((2 * a - z) / Z))
        loading = Z**2 * np.log(np.cosh((2 * amplitude - top) / Z))
        expected = 2 * K * (loading - top**2 / 2)
        assert lost(BoucWen(K, COULOMB), amplitude) == pytest.approx(expected, rel=2e-3)


def test_iwans_sliders_lose_what_masing_says():
    law = Iwan(K, COULOMB)
    for amplitude in (A / 5, A, 5 * A):
        limit = law.limits()
        each = 4 * K / len(limit) * limit * np.maximum(amplitude - limit, 0)
        assert lost(law, amplitude) == pytest.approx(np.sum(each), rel=2e-3)
        _, torques = cycle(law, amplitude)
        backbone = K * np.mean(np.minimum(amplitude, limit))
        assert np.max(torques) == pytest.approx(backbone, rel=1e-3)


def test_dahls_loop_is_two_exponentials():
    for amplitude in (A / 5, A):
        top = Z * np.tanh(amplitude / Z)
        way = Z * 2 * amplitude - Z * (Z + top) * (1 - np.exp(-2 * amplitude / Z))
        assert lost(Friction(K, COULOMB), amplitude) == pytest.approx(2 * K * way, rel=2e-3)


def test_lugre_is_dahl_at_its_limits_and_slips_more_easily_when_fast():
    dahl = lost(Friction(K, COULOMB))
    same = LuGre(K, COULOMB, COULOMB, 1.0, 0.0)
    assert lost(same) == pytest.approx(dahl, rel=5e-3)
    slow, fast = (LuGre(K, COULOMB, 2 * COULOMB, v, 0.0) for v in (1e3, 1e-9))
    assert lost(slow) == pytest.approx(lost(Friction(K, 2 * COULOMB)), rel=5e-3)
    assert lost(fast) == pytest.approx(dahl, rel=5e-3)
    viscous = LuGre(K, COULOMB, COULOMB, 1.0, 5.0)
    assert lost(viscous) - lost(same) == pytest.approx(np.pi * 5.0 * RATE * A**2, rel=1e-3)


def test_dampers_lose_their_integrals():
    assert lost(QuadraticDamping(3e4, 1.0)) == pytest.approx(8 / 3 * 3e4 * RATE**2 * A**3, rel=1e-3)
    law, gap = ImpactDamping(K, A / 3, 2e6), A / 3
    path = quad(lambda t: (t - gap) * np.sqrt(A**2 - t**2), gap, A)[0]
    assert lost(law) == pytest.approx(4 * 2e6 * RATE * path, rel=1e-2)
    undamped, play = (cycle(law)[1] for law in (ImpactDamping(K, gap, 0.0), Backlash(K, gap)))
    assert undamped == pytest.approx(play)


@pytest.mark.parametrize("name", LAWS)
def test_slopes_are_bounds_and_laws_side_by_side_are_each_alone(name):
    law = LAWS[name]
    angles, torques = cycle(law)
    steps = np.abs(np.diff(torques))
    share, slack = (1e-6, 1e-12) if name in PLAIN else (1e-3, 1e-3 * K * A)
    assert np.all(steps <= law.slope(STEP_S) * np.abs(np.diff(angles)) * (1 + share) + slack)
    rng = np.random.default_rng(0)
    path = rng.standard_normal((30, 2, 3)) * A
    both = stacked([law, law])
    state, alone = both.at_rest((2, 3)), law.at_rest((3,))
    for before, now in itertools.pairwise(path):
        torque, state = both.torque(state, before, now, STEP_S)
        one, alone = law.torque(alone, before[1], now[1], STEP_S)
        assert torque[1] == pytest.approx(one, rel=1e-9, abs=1e-12)


STEP, N = 1 / 6400, 3200
EXACTLY = np.eye(6)  # wrenches of hits exactly along an axis of the tcp, and at it
Q = KR10.poses(1)[0]


@pytest.fixture(scope="module")
def truth(tmp_path_factory) -> Truth:
    return load_truth(KR10.write(tmp_path_factory.mktemp("kr10")))


def pulses(peaks: list[float]) -> np.ndarray:
    t = np.arange(N) * STEP
    return np.outer(peaks, np.sin(np.pi * np.clip((t - 0.01) / 0.006, 0, 1)) ** 2)


QUICK = "hardening", "friction"  # of an elastic law and of one with a memory
EACH = [pytest.param(LAWS[k], marks=() if k in QUICK else pytest.mark.slow) for k in PLAIN]


@pytest.mark.parametrize("law", [None, *EACH], ids=["linear", *PLAIN])
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


def test_a_step_too_long_is_refused(truth):
    port = Port(Hardening(1e9, A), joint="joint_6")
    with pytest.raises(InputError, match="shorten the step"):
        respond([HitPose(truth, Q, pulses([1.0]), EXACTLY[[0]])], [port], STEP)
