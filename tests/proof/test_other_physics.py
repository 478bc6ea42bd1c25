"""Physics that the planner's simulation does not have: each against a formula or a rigid limit."""

from dataclasses import replace

import numpy as np
import pytest

from planner.proof.arms import KR10, KR210
from planner.proof.deviation import (
    BentLink,
    Bridge,
    Compensator,
    Deviation,
    Spring,
    StiffnessRipple,
)
from planner.proof.load import load_truth
from planner.proof.springs import LOSS_BAND_HZ, branches, compensation

Q = KR210.poses(1)[0]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return replace(KR210, damping_s=9.5e-4).write(tmp_path_factory.mktemp("kr210"))


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


def test_stiffness_may_go_with_another_joints_angle(path):
    wave = StiffnessRipple("joint_3", 1, 0.4, 0.0, by="joint_2")
    truth = load_truth(path, Deviation(harmonics=(wave,)))
    factors = truth.factors(Q)
    assert truth.own("joint_3") @ factors == pytest.approx(1 + 0.4 * np.cos(Q[1]))


def test_all_stated_stiffnesses_can_be_off_by_the_same_factor(path):
    soft = load_truth(path, Deviation(common=0.6, extra=(Spring("base", (1, 0, 0), 1e7, 1.0),)))
    plain = load_truth(path)
    ratio = [a.stiffness / b.stiffness for a, b in zip(soft.springs, plain.springs, strict=False)]
    assert ratio == pytest.approx([0.6] * plain.stated)
    assert soft.springs[-1].stiffness == 1e7
