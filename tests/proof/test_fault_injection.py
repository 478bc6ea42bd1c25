"""What concealed effects do, as physics says: each against a formula or a rigid limit."""

from dataclasses import replace

import numpy as np
import pytest

from planner.proof.arms import KR10, KR210
from planner.proof.deviation import (
    AttachedResonator,
    BentLink,
    Bridge,
    Compensator,
    Deviation,
    Feedback,
    ScaledJoint,
    Spring,
    StiffnessRipple,
)
from planner.proof.fault_injection import (
    Artefact,
    HitVisit,
    InjectedFaults,
    JointDrift,
    Tone,
    frfs,
    hit_poses,
    once,
)
from planner.proof.hits import Hammer
from planner.proof.laws import Contact
from planner.proof.load import load_truth
from planner.proof.model import Truth
from planner.proof.nonlinear import Port
from planner.proof.springs import LOSS_BAND_HZ, branches, compensation
from tests.support.direct_solution import direct_accelerance

Q = KR210.poses(1)[0]
QUIET = Hammer(noise=0.0, force_noise=0.0, record_s=2.56)
BAND = (4.0, 60.0)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return replace(KR210, damping_s=9.5e-4).write(tmp_path_factory.mktemp("kr210"))


def measured(truth: Truth, injected: InjectedFaults | None = None, **hammer: float) -> np.ndarray:
    injected = injected or InjectedFaults(Deviation())
    return frfs(truth, injected, [once(Q, 1000.0)], replace(QUIET, **hammer), BAND)[1][0]


RIPPLE = StiffnessRipple("joint_3", 2, 0.3, -0.1)
# What scatters, and by how much the stiffness of each joint changes at q.
CHANGES = {
    "one joint": ({"scaled": (ScaledJoint("joint_2", 0.4),)}, lambda q: [1, 0.4, 1, 1, 1, 1]),
    "all joints": ({"common": 0.6}, lambda q: [0.6] * 6),
    "with the angle": (
        {"harmonics": (RIPPLE,)},
        lambda q: [1, 1, 1 + 0.3 * np.cos(2 * q[2]) - 0.1 * np.sin(2 * q[2]), 1, 1, 1],
    ),
    "with another's angle": (
        {"harmonics": (replace(RIPPLE, order=1, by="joint_2"),)},
        lambda q: [1, 1, 1 + 0.3 * np.cos(q[1]) - 0.1 * np.sin(q[1]), 1, 1, 1],
    ),
}


@pytest.mark.parametrize("case", CHANGES)
def test_stiffness_of_joints_changes_as_stated(path, case):
    def springs(truth: Truth, q: np.ndarray) -> np.ndarray:
        return np.diag(truth.matrices(q)[2] - truth.gravity_stiffness(q))[:6]

    change, factors = CHANGES[case]
    base = Spring("base", (1, 0, 0), 1e7, 1.0)  # which is as it is stated here
    plain, changed = load_truth(path), load_truth(path, Deviation(**change, extra=(base,)))
    assert changed.springs[-1].stiffness == 1e7
    for q in (Q, *KR210.poses(3)):
        assert springs(changed, q) / springs(plain, q) == pytest.approx(factors(q))


def test_feedback_breaks_reciprocity_and_nothing_else_does(tmp_path):
    path = KR10.write(tmp_path)
    path.write_text(path.read_text().replace('sensor_frame = "sensor"', 'sensor_frame = "tcp"'))
    q, f = KR10.poses(1)[0], np.linspace(5, 100, 50)

    def asymmetry(deviation: Deviation) -> float:
        H = load_truth(path, deviation).accelerance(q, f)
        return float(np.max(np.abs(H - H.transpose(1, 0, 2))) / np.max(np.abs(H)))

    flexible = Spring("link_2", (0.0, 1.0, 0.0), 5e4, 10.0)
    small = AttachedResonator("link_4", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 1.0, 20.0, 0.02)
    assert asymmetry(Deviation(extra=(flexible,), resonators=(small,))) < 1e-8
    assert asymmetry(Deviation(feedback=(Feedback("joint_1", "joint_2", 3e4),))) > 0.05


def test_a_tight_contact_is_a_spring_and_a_loose_one_is_not(path):
    truth, at = load_truth(path), (0.0, 0.0, 0.0)
    long = replace(QUIET, record_s=5.12)

    def pressed(preload: float) -> np.ndarray:
        port = Port(Contact(4e6, preload), "", "link_5", at, (0.0, 0.0, 1.0))
        injected = InjectedFaults(Deviation(), (port,))
        return frfs(truth, injected, [once(Q, 1e3), once(Q, 2e3)], long, BAND)[1]

    tight, loose = pressed(1.0), pressed(1e-5)
    b = truth.along(Q, "link_5", np.zeros(3), np.array([0.0, 0.0, 1.0]))
    mass, damping, stiffness, hit, sensor = truth.matrices(Q)
    f = np.fft.rfftfreq(2048, 1 / 400)
    f = f[(f >= BAND[0]) & (f <= BAND[1])]
    stiffness += 4e6 * np.outer(b, b)
    exact = direct_accelerance(mass, damping, stiffness, hit, sensor, f)
    assert np.max(np.abs(tight[0] - exact)) < 0.02 * np.max(np.abs(exact))
    assert np.max(np.abs(tight[0] - tight[1])) < 0.02 * np.max(np.abs(tight[0]))
    assert np.max(np.abs(loose[0] - tight[0])) > 0.2 * np.max(np.abs(tight[0]))


def test_artefacts_of_the_sensor(path):
    truth = load_truth(path)
    plain = measured(truth)

    def heard(**artefact: object) -> np.ndarray:
        return measured(truth, InjectedFaults(Deviation(), artefact=Artefact(**artefact)))  # type: ignore

    assert heard(gain=(1.0, -1.0, 0.6)) == pytest.approx(plain * [[[1]], [[-1]], [[0.6]]], rel=1e-9)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert heard(rotation=turn) == pytest.approx(np.stack([-plain[1], plain[0], plain[2]]))
    f = np.fft.rfftfreq(1024, 1 / 400)
    f = f[(f >= BAND[0]) & (f <= BAND[1])]
    late = heard(delay_s=2.5e-3) * np.exp(2j * np.pi * f * 2.5e-3)
    assert np.max(np.abs(late - plain)) < 0.05 * np.max(np.abs(plain))


def test_an_uncorrected_window_adds_the_same_decay_to_every_mode(path):
    truth, time = load_truth(path), 0.4
    injected = InjectedFaults(Deviation(), artefact=Artefact(window_s=time))
    f, H = frfs(truth, injected, [once(Q, 1e3)], QUIET, BAND)
    # e^(-t/T) shifts the argument of the transfer function: H(s + 1/T).
    poles, residues, _ = truth.poles(Q)
    s = 2j * np.pi * f + 1 / time
    exact = s**2 * np.einsum("kij,kf->ijf", residues, 1 / (s - poles[:, None]))
    assert np.max(np.abs(H[0] - exact)) < 0.03 * np.max(np.abs(exact))


def test_drift_follows_its_course(path):
    truth = load_truth(path)
    for course, expected in (("linear", 0.85), ("step", 0.7), ("warming", 1 - 0.3 * 0.8646647)):
        drift = JointDrift((("", -0.3, course),))
        factors = (drift.applied(truth, p).springs[0].stiffness for p in (0.0, 0.5))
        ratios = [factor / truth.springs[0].stiffness for factor in factors]
        assert ratios == pytest.approx([1.0, expected])
    injected = InjectedFaults(Deviation(), drift=JointDrift((("", -0.3, "linear"),)))
    visits = [once(Q, 1e3), once(Q, 1e3, 1.0)]
    start, end = frfs(truth, injected, visits, QUIET, BAND)[1]
    assert start == pytest.approx(measured(truth), rel=0.02, abs=1e-4)
    ratio = truth.changed(0.7).modes(Q, 3)[0] / truth.modes(Q, 3)[0]
    assert ratio == pytest.approx(np.full(3, np.sqrt(0.7)), rel=0.02)
    assert np.max(np.abs(end - start)) > 0.3 * np.max(np.abs(start))


def test_a_tone_hums_before_the_hit_and_at_its_frequency_only(path):
    truth = load_truth(path)
    injected = InjectedFaults(Deviation(), tone=Tone("link_3", (0.0, 0.6, 0.8), 25.0, 100.0))
    silent = HitVisit(Q, [("+x", 0.0), ("+x", 0.0)])
    one, two = hit_poses(truth, injected, [silent], QUIET, np.random.default_rng(3))[0]
    spectrum = np.abs(np.fft.rfft(one.acceleration_m_s2[:, 24:]))
    f = np.fft.rfftfreq(1000, 1 / 400)
    assert np.all(spectrum[:, f == 25.0] > 50 * np.median(spectrum))
    amplitude = np.max(np.abs(one.acceleration_m_s2[:, 200:]))
    assert amplitude == pytest.approx(np.max(np.abs(two.acceleration_m_s2[:, 200:])), rel=0.02)
    assert not np.allclose(one.acceleration_m_s2, two.acceleration_m_s2)


@pytest.mark.parametrize("robot", [KR10, KR210], ids=lambda r: r.name.split()[0])
@pytest.mark.parametrize("link", ["link_2", "link_3", "link_4"])
def test_a_stiff_beam_is_the_rigid_link(robot, link, tmp_path):
    path, q = robot.write(tmp_path), robot.poses(1)[0]
    stiff = BentLink(link, (1e12, 1e12), 1e12, 1e-9)
    ours = load_truth(path, Deviation(7, inertia=0.05, beams=(stiff,))).modes(q, 5)
    rigid = load_truth(path, Deviation(7, inertia=0.05)).modes(q, 5)
    assert ours[0] == pytest.approx(rigid[0], rel=1e-5)


def test_a_beams_compliance_settles_with_its_elements(tmp_path):
    """All joints stiff: what gives way is the beam alone, and 5 elements are nearly all of it."""
    path = KR210.write(tmp_path)
    text = path.read_text()
    for k in (*KR210.torsion, *KR210.bending):
        text = text.replace(f"stiffness = {k}\n", "stiffness = 1e13\n")
    path.write_text("geometric_stiffness = false\n" + text)
    k = 5e6

    def compliance(elements: int) -> np.ndarray:
        beam = BentLink("link_2", (k, k), k, 1e-4, elements)
        truth = load_truth(path, Deviation(beams=(beam,)))
        _, _, stiffness, hit, _ = truth.matrices(Q)
        return hit @ np.linalg.solve(stiffness, hit.T)

    coarse, fine, finest = (compliance(n) for n in (5, 20, 40))
    assert np.max(np.abs(fine - finest)) < 0.01 * np.max(np.abs(finest))
    assert np.max(np.abs(coarse - finest)) < 0.1 * np.max(np.abs(finest))


def test_a_loss_factor_is_nearly_the_same_over_the_band():
    spring = Spring("j", (0.0, 0.0, 1.0), 1e6, 0.0, loss=0.05)
    low, high = LOSS_BAND_HZ
    for f in np.geomspace(3 * low, high / 3, 25):
        s = 2j * np.pi * f
        stiff = 1e6 + sum(k * s / (s + rate) for _, k, rate in branches([spring], np.array([1e6])))
        assert stiff.imag == pytest.approx(0.05 * 1e6, rel=0.15)
        assert 1.0 < stiff.real / 1e6 < 1.25


def test_mixed_damping_is_damped_and_its_modes_are_those_of_the_dynamic_stiffness(path):
    truth = load_truth(path, Deviation(3, mixed=1.0))
    mass, damping, stiffness, hit, sensor = truth.matrices(Q)
    f = np.linspace(4, 60, 29)
    exact = []
    for s in 2j * np.pi * f:
        whole = stiffness + s * damping + s**2 * mass
        own = np.array([spring.stiffness for spring in truth.springs])
        for j, more, rate in branches(truth.springs, own):
            whole[j, j] += more * s / (s + rate)
        exact.append(s**2 * sensor @ np.linalg.solve(whole, hit.T))
    ours = truth.accelerance(Q, f)
    assert np.max(np.abs(ours - np.moveaxis(np.array(exact), 0, 2))) < 1e-8 * np.max(np.abs(exact))
    assert all(0 < d < 0.3 for d in truth.modes(Q, 3)[1])
    shares = [s.loss * s.stiffness / (s.damping + 1e-12) for s in truth.springs]
    assert max(shares) > 3 * min(shares)  # no two joints alike: not proportional to stiffness


def test_a_gas_spring_has_the_stiffness_of_its_energy():
    spring = Compensator("joint_2", 0.2, 0.7, 0.4, 8e3, 2e4)

    def energy(q: float) -> float:
        length = np.sqrt(0.2**2 + 0.7**2 - 2 * 0.2 * 0.7 * np.cos(q + 0.4))
        return 8e3 * length + 2e4 * (length - 0.2) ** 2 / 2

    for q in (-1.0, 0.0, 0.8):
        h = 1e-3
        second = (energy(q + h) - 2 * energy(q) + energy(q - h)) / h**2
        assert compensation(spring, q) == pytest.approx(second, rel=1e-4)


def test_a_gas_spring_stiffens_its_joint(path):
    spring = Compensator("joint_2", 0.3, 0.9, 0.4, 5e4, 4e6)
    with_it = load_truth(path, Deviation(compensators=(spring,))).matrices(Q)[2]
    without = load_truth(path).matrices(Q)[2]
    change, own = with_it - without, load_truth(path).own("joint_2")
    expected = compensation(spring, Q[1])
    assert own @ change @ own == pytest.approx(expected, rel=0.02)  # the weight sags otherwise
    assert abs(expected) > 1e5


def test_a_spindle_that_turns_couples_without_taking_energy(path):
    still, turning = load_truth(path), load_truth(path, Deviation(spin=40.0))
    change = turning.matrices(Q)[1] - still.matrices(Q)[1]
    assert change == pytest.approx(-change.T)
    axes = turning.turning(Q)  # about the tool's x and y, the torques are h times the other's rate
    assert np.max(np.abs(change)) == pytest.approx(
        40 * np.max(np.abs(np.outer(axes[0], axes[1]) - np.outer(axes[1], axes[0]))), rel=1e-9
    )
    back = turning.accelerance(Q, np.array([20.0]))[:, :, 0]
    assert np.max(np.abs(back - still.accelerance(Q, np.array([20.0]))[:, :, 0])) > 0


def test_a_bridge_between_links_is_a_spring_between_their_points(path):
    bridge = Bridge(
        ("link_2", "link_5"), ((0.1, 0.0, 0.0), (0.0, 0.0, 0.1)), (0.0, 0.6, 0.8), 2e6, 50.0
    )
    with_it, without = load_truth(path, Deviation(bridges=(bridge,))), load_truth(path)
    ends = [
        without.along(Q, link, np.array(at), np.array(bridge.direction))
        for link, at in zip(bridge.links, bridge.positions_m, strict=True)
    ]
    b = ends[0] - ends[1]
    for which, size in ((1, 50.0), (2, 2e6)):
        change = with_it.matrices(Q)[which] - without.matrices(Q)[which]
        assert change == pytest.approx(size * np.outer(b, b))
