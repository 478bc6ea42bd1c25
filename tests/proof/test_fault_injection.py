"""What each concealed effect does to FRFs, as physics says."""

from dataclasses import replace

import numpy as np
import pytest

from planner.proof.arms import KR10, KR210
from planner.proof.deviation import (
    AttachedResonator,
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
from tests.support.direct_solution import direct_accelerance

Q = KR210.poses(1)[0]
QUIET = Hammer(noise=0.0, force_noise=0.0, record_s=2.56)
BAND = (4.0, 60.0)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return replace(KR210, damping_s=9.5e-4).write(tmp_path_factory.mktemp("kr210"))


def frequencies(path, **changes: tuple) -> np.ndarray:
    return load_truth(path, Deviation(**changes)).modes(Q, 4)[0]


def measured(truth: Truth, injected: InjectedFaults | None = None, **hammer: float) -> np.ndarray:
    injected = injected or InjectedFaults(Deviation())
    return frfs(truth, injected, [once(Q, 1000.0)], replace(QUIET, **hammer), BAND)[1][0]


def test_frfs_of_hits_are_the_linear_accelerance(path):
    truth = load_truth(path)
    f, H = frfs(
        truth, InjectedFaults(Deviation()), [once(Q, 1000.0)], replace(QUIET, record_s=20.0), BAND
    )
    exact = truth.accelerance(Q, f)
    assert np.max(np.abs(H[0] - exact)) < 1e-3 * np.max(np.abs(exact))


def test_a_split_link_that_does_not_give_way_is_the_link(path):
    axes = np.eye(3)
    rigid = [Spring("link_2", tuple(a), 1e11, 1.0) for a in axes]
    assert frequencies(path, extra=tuple(rigid)) == pytest.approx(frequencies(path), rel=1e-4)
    stiffness = [1e11, 1e11, 1e11]
    for k in range(3):
        soft = [replace(s, stiffness=2e6 if i == k else stiffness[i]) for i, s in enumerate(rigid)]
        lower = frequencies(path, extra=tuple(soft))
        assert np.all(lower <= frequencies(path) * (1 + 1e-4))
        assert np.any(lower < 0.98 * frequencies(path))


def test_a_base_that_shifts_lowers_frequencies(path):
    def shifting(stiffness: float) -> np.ndarray:
        axes = [tuple(float(v) for v in a) for a in np.eye(3)]
        springs = tuple(Spring("base", a, stiffness, 0.0, slide=True) for a in axes)  # type: ignore
        return frequencies(path, extra=springs)

    assert shifting(1e11) == pytest.approx(frequencies(path), rel=1e-4)
    assert np.all(shifting(1e7) < frequencies(path))


def test_scaling_and_harmonics_change_the_stiffness_of_one_joint(path):
    def springs(truth: Truth, q: np.ndarray) -> np.ndarray:
        return np.diag(truth.matrices(q)[2] - truth.gravity_stiffness(q))

    K = springs(load_truth(path), Q)
    soft = load_truth(path, Deviation(scaled=(ScaledJoint("joint_2", 0.4),)))
    assert springs(soft, Q) / K == pytest.approx([1, 0.4, 1, 1, 1, 1])
    assert soft.modes(Q, 1)[0] < load_truth(path).modes(Q, 1)[0]
    waves = Deviation(harmonics=(StiffnessRipple("joint_3", 2, 0.3, -0.1),))
    for q in KR210.poses(3):
        expected = 1 + 0.3 * np.cos(2 * q[2]) - 0.1 * np.sin(2 * q[2])
        ratio = springs(load_truth(path, waves), q) / K
        assert ratio == pytest.approx([1, 1, expected, 1, 1, 1])


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
    long = replace(QUIET, record_s=10.24)

    def pressed(preload: float) -> np.ndarray:
        port = Port(Contact(4e6, preload), "", "link_5", at, (0.0, 0.0, 1.0))
        injected = InjectedFaults(Deviation(), (port,))
        return frfs(truth, injected, [once(Q, 1e3), once(Q, 2e3)], long, BAND)[1]

    tight, loose = pressed(1.0), pressed(1e-5)
    b = truth.along(Q, "link_5", np.zeros(3), np.array([0.0, 0.0, 1.0]))
    mass, damping, stiffness, hit, sensor = truth.matrices(Q)
    f = np.fft.rfftfreq(4096, 1 / 400)
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
