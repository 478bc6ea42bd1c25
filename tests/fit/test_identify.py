"""Identification against the other engine: what it finds, what it says that it cannot find."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from planner.dataset.measure import MeasuredPose
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Priors, parametrise
from planner.errors import InputError
from planner.fit import identify as fit
from planner.fit.result import _words, undetermined
from planner.fit.write_robot import updated_toml
from planner.frf.estimator import estimate
from planner.measurement.agreement import fit_similarity
from planner.measurement.nuisances import EXACT_HITS, Tolerances
from planner.proof.arms import KR10
from planner.proof.deviation import Deviation
from planner.proof.hits import Hammer, simulate_hit
from planner.proof.load import load_truth
from planner.proof.model import Truth
from planner.recording.records import Hit
from planner.robot.robot import Robot
from tests.support.measured_frfs import measured_frfs
from tests.support.plain_arm import make_plain_arm

EXACTLY = Priors()  # inertias
LINES = np.linspace(5.0, 150.0, 96)
POSES = KR10.poses(4, seed=2)
OFF = Deviation(seed=3, stiffness=0.5, damping=0.7)


def identify(frfs, q, simulation, priors=EXACTLY, **options):
    """Of FRFs that are computed, as stated alone."""
    options = {"tolerances": EXACT_HITS, "extend": False} | options
    return fit.identify(frfs, q, simulation, priors, **options).identified


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return KR10.write(tmp_path_factory.mktemp("kr10"), 1)


@pytest.fixture(scope="module")
def simulation(folder) -> Simulation:
    return Simulation(Robot.load(folder))


@pytest.fixture(scope="module")
def truth(folder) -> Truth:
    return load_truth(folder, OFF)


@pytest.fixture(scope="module")
def frfs(truth):
    return measured_frfs(truth, POSES, LINES, 0.02)


@pytest.fixture(scope="module")
def found(frfs, simulation):
    return identify(frfs, POSES, simulation)


def true_values(truth: Truth, result) -> np.ndarray:
    return np.array([getattr(truth.springs[e.blocks[0]], e.kind) for e in result.estimates])


def off_by(truth: Truth, result) -> np.ndarray:
    """Errors in posterior sds."""
    true = true_values(truth, result)
    return np.array(
        [np.log(e.value / t) / e.log_sd for e, t in zip(result.estimates, true, strict=True)]
    )


def test_springs_of_the_other_engine_are_found(found, truth, simulation):
    assert found.misfit == pytest.approx(1.0, abs=0.05)
    assert found.converged
    assert np.all(np.abs(off_by(truth, found)) < 4.5)
    assert np.mean(np.abs(off_by(truth, found)) < 2.0) > 0.8
    other = KR10.poses(6, seed=50)
    silent = measured_frfs(truth, other, LINES, 1e-9)
    assert fit_similarity(found.simulation, silent, other).frac > 0.999
    assert fit_similarity(simulation, silent, other).frac < 0.7


def test_sds_grow_with_the_noise(truth, simulation, found):
    loud = identify(measured_frfs(truth, POSES, LINES, 0.08), POSES, simulation)
    pairs = zip(loud.estimates, found.estimates, strict=True)
    ratio = np.array([a.log_sd / b.log_sd for a, b in pairs if a.log_sd < 0.1])
    assert len(ratio) > 8
    assert np.all((ratio > 3.0) & (ratio < 4.4))


def test_missing_physics_shows_in_the_misfit_and_widens_the_sds(tmp_path, simulation, found):
    bending = load_truth(KR10.write(tmp_path, 3))
    result = identify(measured_frfs(bending, POSES, LINES, 0.02), POSES, simulation)
    assert result.misfit > 10
    wider = [a.log_sd / b.log_sd for a, b in zip(result.estimates, found.estimates, strict=True)]
    assert np.median(wider) > 2


def test_an_axis_through_hammer_and_sensor_cannot_be_determined(tmp_path):
    """A turn about joint 6 moves neither, and its own inertia is next to nothing."""
    path = KR10.write(tmp_path)
    text = path.read_text().replace('"tcp"', '"link_6"').replace('"sensor"', '"link_6"')
    path.write_text(text)
    simulation, truth = Simulation(Robot.load(path)), load_truth(path)
    band, lines = (5.0, 60.0), np.linspace(5, 60, 60)
    result = identify(measured_frfs(truth, POSES, lines, 0.05), POSES, simulation, band_hz=band)
    lost = {e.name for e in result.estimates if not e.identifiable}
    assert "damping of joint_6 about z" in lost
    assert "stiffness of joint_1 about z" not in lost
    assert any("damping of joint_6" in text for text in result.undetermined)
    loose = result.estimate("damping of joint_6 about z")
    assert loose.log_sd == pytest.approx(loose.prior_log_sd, rel=0.1)


def test_directions_in_words(simulation):
    p = parametrise(simulation, Priors())
    sd = p.log_sd
    whitened = 1e-4 * np.eye(len(sd))
    whitened[:2, :2] += 0.5 * np.array([[1.0, 1.0], [1.0, 1.0]])  # only the ratio is known
    whitened[3, 3] = 0.9
    ratio = whitened.copy()
    ratio[0, 1] = ratio[1, 0] = -0.5
    texts = undetermined(p, whitened * np.outer(sd, sd))
    assert len(texts) == 2
    assert texts[0].startswith(
        "The product of stiffness of joint_1 about z and stiffness of joint_2 about z is not"
    )
    assert texts[1].startswith("The stiffness of joint_4 about z is not determined: 95 %")
    swapped = undetermined(p, ratio * np.outer(sd, sd))[0]
    assert swapped.startswith("The ratio of stiffness of joint_")
    many = _words(
        [f"stiffness {i}" for i in range(20)], np.tile([1.0, -1.0], 10) / np.sqrt(20), 0.9
    )
    assert many.startswith("The ratio of stiffness ")
    assert "90 % of the prior's spread is left" in many


def hits(truth: Truth, q: np.ndarray, record_s: float) -> tuple[Hit, ...]:
    hammer = Hammer(
        duration_s=0.003, sampling_rate_hz=1024, record_s=record_s, pretrigger_s=0.03, noise=0.01
    )
    rng = np.random.default_rng(0)
    made = [simulate_hit(truth, q, axis, hammer, rng) for axis in ("+x", "+y", "+z") * 3]
    return tuple(
        Hit(Path(str(i)), h.axis, hammer.sampling_rate_hz, h.force_n, h.acceleration_m_s2)
        for i, h in enumerate(made)
    )


def test_records_that_end_before_the_decay(truth, simulation):
    """From hammer hits of 0.3 s: half of the slowest decay is cut off."""
    each = [hits(truth, q, 0.3) for q in POSES]
    recorded = [MeasuredPose((), (5.0, 150.0), given=some).one_hit_frf for some in each]
    known = identify(recorded, POSES, simulation)
    cut = [estimate(some, (5.0, 150.0)) for some in each]
    assert all(np.isfinite(frf.tail_s) for frf in cut)
    blind = [dataclasses.replace(frf, tail_s=np.inf) for frf in cut]
    ignored = identify(blind, POSES, simulation)
    error = [np.abs(np.log([e.value for e in r.estimates]) - np.log(true_values(truth, r)))
             for r in (known, ignored)]  # fmt: skip
    assert known.misfit < 2 < ignored.misfit / 3
    sd = np.array([e.log_sd for e in known.estimates])
    assert np.max(sd[:6]) < 0.03  # stiffness
    assert np.all(error[0] < 5 * sd)
    assert np.median(error[0]) < 0.2 * np.median(error[1])


def test_an_exponential_window_is_part_of_the_model(truth, simulation):
    recorded = [estimate(hits(truth, q, 1.5), (5.0, 150.0), "h1", 6.0) for q in POSES]
    windowed = identify(recorded, POSES, simulation)
    error = np.log([e.value for e in windowed.estimates]) - np.log(true_values(truth, windowed))
    assert np.max(np.abs(error[:5])) < 0.005
    assert np.all(np.abs(off_by(truth, windowed)) < 4.0)
    assert np.median(np.abs(error[6:])) < 0.03


def test_inertias_off_by_five_percent_are_allowed_for(folder, simulation):
    """The springs' sds cover the truth only where inertias may err too."""
    off = load_truth(folder, Deviation(seed=4, stiffness=0.3, inertia=0.05, com_m=0.01))
    recorded = measured_frfs(off, POSES, LINES, 0.03)
    exact = identify(recorded, POSES, simulation)
    free = identify(recorded, POSES, simulation, Priors(mass=0.05, inertia=0.05, com_m=0.01))
    assert free.misfit < 1.1 < exact.misfit
    assert np.all(np.abs(off_by(off, free)) < 4.0)
    assert np.max(np.abs(off_by(off, exact))) > 4.0
    mass = free.simulation.elastic.matrices(POSES).mass
    assert np.all(np.linalg.eigvalsh(mass) > 0)


def test_ties_and_zeros(tmp_path):
    path = KR10.write(tmp_path, 2)
    text = path.read_text().replace("stiffness = 12000.0\ndamping = 3.5999999999999996",
                                    "stiffness = 12000.0\ndamping = 0.0")  # fmt: skip
    assert "damping = 0.0" in text
    for k in (KR10.torsion[0], KR10.torsion[2]):
        old = f"stiffness = {k}\ndamping = {KR10.damping_s * k}"
        assert old in text
        text = text.replace(old, 'stiffness = 6.0e4\ndamping = 20.0\ntie = "the same motor"')
    path.write_text(text)
    p = parametrise(Simulation(Robot.load(path)), Priors())
    names = [x.name for x in p.parameters]
    assert len(names) == 11 + 10
    assert "stiffness of the same motor" in names
    assert "damping of joint_5 about z" not in names
    springs = p.elasticity(p.mean + 0.1)
    assert springs.stiffness[0] == springs.stiffness[4] == pytest.approx(6.0e4 * np.exp(0.1))
    assert springs.damping[8] == 0.0


def test_loss_factors_are_identified_where_there_are_any(tmp_path):
    path = KR10.write(tmp_path)
    text = path.read_text()
    for k in KR10.torsion:
        text = text.replace(f"damping = {KR10.damping_s * k}", "damping = 0.0\nloss_factor = 0.05")
    path.write_text(text)
    simulation = Simulation(Robot.load(path))
    springs, rng = simulation.elasticity, np.random.default_rng(0)
    factor = np.exp(0.4 * rng.standard_normal((2, 6)))
    true = dataclasses.replace(
        springs, stiffness=springs.stiffness * factor[0], loss_factor=0.05 * factor[1]
    )
    # The other engine has no structural damping: springs are taken, the FRFs are ours.
    exact = simulation.changed(true).accelerance(POSES, LINES)
    template = measured_frfs(load_truth(path), POSES, LINES, 0.02)
    recorded = [dataclasses.replace(t, accelerance=h) for t, h in zip(template, exact, strict=True)]
    result = identify(recorded, POSES, simulation)
    assert {e.kind for e in result.estimates} == {"stiffness", "loss_factor"}
    expected = np.concatenate([true.stiffness, true.loss_factor])
    np.testing.assert_allclose([e.value for e in result.estimates], expected, rtol=0.03)


def test_an_axis_that_was_not_hit_and_a_noise_that_is_not_known(frfs, simulation, truth):
    partly = []
    for frf in frfs:
        h, nan = frf.accelerance.copy(), np.full(frf.variance.shape, np.nan)
        h[:, 1] = np.nan
        partly.append(dataclasses.replace(frf, accelerance=h, variance=nan, hits=(1, 0, 1)))
    result = identify(partly, POSES, simulation)
    error = np.log([e.value for e in result.estimates]) - np.log(true_values(truth, result))
    assert np.max(np.abs(error[:5])) < 0.03


def test_a_pose_with_wrong_angles_stands_out(frfs, simulation):
    q = POSES.copy()
    q[2, 1] += np.deg2rad(2.0)
    result = identify(frfs, q, simulation, tolerances=Tolerances())
    assert int(np.argmax(result.misfit_by_pose)) == 2


def test_a_robot_toml_takes_the_springs_and_keeps_its_words(found, folder, tmp_path):
    commented = "# tuned in spring\n" + folder.read_text()
    (tmp_path / "robot.urdf").write_text(folder.with_name("robot.urdf").read_text())
    (tmp_path / "robot.toml").write_text(updated_toml(commented, found))
    assert (tmp_path / "robot.toml").read_text().startswith("# tuned in spring\n")
    written = Simulation(Robot.load(tmp_path / "robot.toml")).elasticity
    expected = found.simulation.elasticity
    np.testing.assert_allclose(written.stiffness, expected.stiffness, rtol=1e-5)
    np.testing.assert_allclose(written.damping, expected.damping, rtol=1e-5)


@pytest.mark.parametrize(
    ("poses", "bounds", "options", "words"),
    [
        (2, {}, {}, "do not fit together"),
        (4, {}, {"band_hz": (300.0, 400.0)}, "leaves nothing to fit"),
        (4, {"stiffness of joint_9": (1.0, 2.0)}, {}, "'stiffness of joint_9'"),
        (4, {"stiffness of joint_1 about z": (2.0, 1.0)}, {}, "must rise"),
    ],
)
def test_bad_input_in_one_sentence(frfs, simulation, poses, bounds, options, words):
    with pytest.raises(InputError, match=words):
        identify(frfs, POSES[:poses], simulation, Priors(bounds=bounds), **options)


def test_springs_that_could_never_carry_the_robot_are_said(tmp_path, frfs):
    simulation = Simulation(Robot.load(make_plain_arm(tmp_path, softer=1e7)))
    with pytest.raises(InputError, match="far too soft to carry the robot's weight"):
        identify(frfs, POSES[:, :4], simulation)
