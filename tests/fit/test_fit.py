"""One fit: slopes are derivatives, a common scale costs nothing, what lacks is found and sized."""

from dataclasses import replace

import numpy as np
import pytest

from planner.dynamics.simulation import Simulation
from planner.effects.parameters import CAD_INERTIAS
from planner.effects.table import EffectLibrary
from planner.fit.data import FrfData
from planner.fit.departures import departures_text, masses_text, refitted_masses
from planner.fit.fitted import SIZES, StructureFit, settled, size_of
from planner.fit.frequency_uncertainty import log_frequency_slope
from planner.fit.gauss_newton import minimised
from planner.fit.misfit import FrfMisfit
from planner.fit.posterior import RobotBelief, RobotPosterior
from planner.fit.result import as_identification
from planner.fit.search import Search
from planner.fit.starts import in_place_of
from planner.fit.structure import RobotPrior, RobotStructure, exported
from planner.fit.trials import explained
from planner.measurement.nuisances import Tolerances
from planner.robot.robot import Robot
from planner.words import significant
from tests.support.fitted_cases import Case, Judged, everyday, on_a_block


@pytest.fixture(scope="module")
def case(tmp_path_factory) -> Case:
    """A robot of another engine with a soft base, a link that bends and a hose."""
    return everyday("kr210", 1, tmp_path_factory.mktemp("case"))


@pytest.fixture(scope="module")
def prior(case) -> RobotPrior:
    return RobotPrior(EffectLibrary.of(Simulation(Robot.load(case.toml)), CAD_INERTIAS))


@pytest.fixture(scope="module")
def few(case, prior) -> FrfData:
    return FrfData.of(prior, case.frfs[:2], case.q[:2], case.band_hz, 12)


def structure_of(prior: RobotPrior, *labels: str) -> RobotStructure:
    found = RobotStructure(prior)
    for effect in prior.effect_library.effects:
        if effect.label in labels:
            found = found.with_effect(effect)
    assert len(found.effects) == len(labels)
    return found


def set_to(structure: RobotStructure, x: np.ndarray, kind: str, first: int, *values: float):
    """Some of an effect's own numbers."""
    number = next(k for k, e in enumerate(structure.effects) if e.kind == kind)
    at = structure.own[number].start + first
    x[at : at + len(values)] = values


EVERYTHING = (
    "soft_base at base", "shifting_base at base", "link_flexibility at link_2",
    "added_mass at link_3", "local_resonator at link_4", "angle_dependent_stiffness at joint_2",
    "structural_damping at joints",
)  # fmt: skip


ON_A_BLOCK = ("foundation at base", *EVERYTHING[2:])


@pytest.mark.parametrize("labels", [EVERYTHING, ON_A_BLOCK])
def test_slopes_are_the_derivatives(prior, few, labels):
    structure = structure_of(prior, *labels)
    misfit = FrfMisfit(structure, few, Tolerances())
    rng = np.random.default_rng(0)
    x = structure.mean + 0.1 * structure.sd * rng.standard_normal(structure.size)
    assert misfit.possible(x)
    about = misfit.about(misfit.zero_nuisances(), x)
    h, columns, _ = misfit.columns(x, about)
    for i, name in enumerate(structure.names[: structure.chain.start]):
        step = 1e-5 * structure.sd[i] * np.eye(structure.size)[i]
        ahead, behind = (misfit.motion(y, about).accelerance for y in (x + step, x - step))
        slope = (ahead - behind) / (2e-5 * structure.sd[i])
        size = np.linalg.norm(slope) + 1e-9 * np.linalg.norm(h) / structure.sd[i]
        assert np.linalg.norm(slope - columns[:, i]) < 1e-4 * size, name


@pytest.mark.parametrize("labels", [EVERYTHING, ON_A_BLOCK])
def test_slopes_of_frequencies_are_the_derivatives(case, prior, labels):
    structure = structure_of(prior, *(e for e in labels if "damping" not in e))
    x = structure.mean + 0.1 * structure.sd
    set_to(structure, x, "local_resonator", 3, 1.0, 0.5, 0.3)
    belief = RobotBelief(structure, x, np.eye(structure.size), Tolerances())
    q = case.unseen[:2]

    def log_hz(y: np.ndarray) -> np.ndarray:
        return np.log(exported(structure, y)[0].frequencies(q, 5).frequency_hz)

    slope = log_frequency_slope(belief, q, belief.simulation.frequencies(q, 5))
    for i, name in enumerate(structure.names[: structure.chain.start]):
        step = 1e-4 * structure.sd[i] * np.eye(structure.size)[i]
        there = (log_hz(x + step) - log_hz(x - step)) / (2e-4 * structure.sd[i])
        # What is left out, that the sag under gravity changes too, is below a hundredth.
        assert np.abs(slope[:, :, i] - there).max() < 0.01 * max(np.abs(there).max(), 0.1), name


def test_masses_springs_and_gain_times_one_number_leave_frfs_as_they_are(prior, few):
    structure = structure_of(prior, "soft_base at base")
    misfit = FrfMisfit(structure, few, Tolerances())
    x, other, by = structure.mean, structure.mean.copy(), 1.1
    other[: structure.stiffnesses] += np.log(by)
    bodies = structure.bodies
    scaled = bodies.scaled[bodies.sigma > 0]
    other[structure.inertial.start + scaled] += np.log(by) / bodies.sigma[bodies.sigma > 0]
    there, h = (misfit.motion(y, None).accelerance for y in (other, x))
    # Gravity's own stiffness stays what the URDF's weight makes it.
    np.testing.assert_allclose(there * by, h, rtol=0, atol=2e-3 * np.abs(h).max())
    assert bodies.barrier(other[structure.inertial])[0] < 1e-12


@pytest.mark.parametrize("labels", [EVERYTHING[:5], ON_A_BLOCK[:4]])
def test_what_was_found_is_a_simulation_of_its_own(prior, few, labels):
    structure = structure_of(prior, *labels)
    x = structure.mean.copy()
    set_to(structure, x, "added_mass", 0, 0.5, 0.3, -0.2, 0.1)
    set_to(structure, x, "added_mass", 7, 0.5, -0.4, 0.3)
    set_to(structure, x, "local_resonator", 3, 1.0, 0.5, 0.0)
    x[structure.chain] = 0.0
    simulation, _ = exported(structure, x)
    lines = few.measured.frequency_hz[0]
    true = replace(few, measured=replace(few.measured, s=2j * np.pi * few.measured.frequency_hz))
    fitted = FrfMisfit(structure, true, Tolerances()).motion(x, None).accelerance[0]
    again = simulation.accelerance(few.q[:1], lines)[0]
    np.testing.assert_allclose(again, fitted, rtol=0, atol=2e-3 * np.abs(fitted).max())


def test_the_same_matter_on_another_link_gives_the_same_frfs(case, prior):
    """The joint between both at one angle, and stiff."""
    one, other = (structure_of(prior, f"added_mass at link_{k}") for k in (5, 6))
    q, x, y = case.q[:2].copy(), one.mean.copy(), other.mean.copy()
    q[:, 5] = 0.4
    few = FrfData.of(prior, case.frfs[:2], q, case.band_hz, 12)
    set_to(one, x, "added_mass", 0, 1.0, 0.6, -0.2, 0.1)
    set_to(one, x, "added_mass", 7, 0.5, -0.4, 0.3)
    before, after = (FrfMisfit(s, few, Tolerances(), 0.1) for s in (one, other))
    base = FrfMisfit(RobotStructure(prior), few, Tolerances(), 0.1)
    motions, gain = base.first_order(RobotStructure(prior).mean, base.zero_nuisances())
    begun = other.effects[0].moved_to(one.effects[0], x[one.own[0]], motions, gain)
    y[other.own[0]] = begun.psi
    for z, s in (x, one), (y, other):
        joints = [i for i, p in enumerate(s.parameters) if "joint_6" in p.name]
        z[[i for i in joints if s.parameters[i].kind == "stiffness"]] += 12.0
    with_5, with_6 = (m.motion(z, None).accelerance for m, z in ((before, x), (after, y)))
    without = base.motion(RobotStructure(prior).mean, None).accelerance
    size = np.linalg.norm(with_5)
    assert np.linalg.norm(with_6 - with_5) < 0.01 * size
    assert np.linalg.norm(without - with_5) > 0.3 * size


def test_damping_that_scatters_from_visit_to_visit_is_no_discrepancy(prior, few):
    structure, rng = RobotStructure(prior), np.random.default_rng(3)
    x, dampers = structure.mean, [p.kind == "damping" for p in structure.parameters]
    misfit = FrfMisfit(structure, few, Tolerances(), 0.06)
    visits = []
    for pose in range(len(few.q)):
        there = x.copy()
        there[: len(dampers)][dampers] += 0.1 * rng.standard_normal(sum(dampers))
        visits.append(misfit.motion(there, None).accelerance[pose])
    data = replace(few, measured=replace(few.measured, accelerance=np.array(visits)))
    sizes = {}
    for sd in (Tolerances().visit_damping, 0.0):
        one = replace(misfit, data=data, tolerances=replace(Tolerances(), visit_damping=sd))
        sizes[sd] = size_of(settled(one, one(x), rounds=3))
    assert sizes[0.0] > SIZES[0]
    assert sizes[Tolerances().visit_damping] == SIZES[0]


def test_a_sensor_that_is_seated_again_at_each_pose_is_known(prior, few):
    structure, rng, t = RobotStructure(prior), np.random.default_rng(5), Tolerances()
    x, misfit = structure.mean, FrfMisfit(structure, few, t, 0.06)
    # Two sds of what visits have of their own: turned by a degree, cables and gains as they come.
    off = 2 * t.visit_chain * np.where(np.eye(3), t.gain, t.across)
    seated = np.eye(3) + off * rng.standard_normal((len(few.q), 3, 3))
    seated *= 1 + 2 * t.visit_chain * t.force_gain * rng.standard_normal((len(few.q), 1, 1))
    shown = np.einsum("nij,njcf->nicf", seated, misfit.motion(x, None).accelerance)
    data = replace(few, measured=replace(few.measured, accelerance=shown))
    evidence = {}
    for share in (t.visit_chain, 0.0):
        one = replace(misfit, data=data, tolerances=replace(t, visit_chain=share))
        evidence[share] = settled(one, one(x), rounds=3).evidence
    assert evidence[t.visit_chain] > evidence[0.0] + 20.0


def test_a_fit_begins_with_a_mass_that_a_body_stands_for_and_gives_the_same_frfs(prior, few):
    """40 kg that a fit had put into a link's own body, with moments that no matter has."""
    plain = RobotStructure(prior)
    x, wider = plain.mean.copy(), structure_of(prior, "added_mass at link_5")
    body = plain.bodies.mine[plain.bodies.bodies.index("joint_5")]
    x[plain.inertial][body] = 6.0, 1.0, -1.0, 0.5, 2.0, 0.0, -2.0, 0.0, 1.0, 0.0
    misfit = FrfMisfit(plain, few, Tolerances(), 0.1)
    found = StructureFit(misfit, misfit(x), 0.0)
    (begun,) = in_place_of(found, wider)
    before, after = found.at.motion, replace(misfit, structure=wider).motion(begun, None)
    size = np.linalg.norm(before.accelerance)
    assert np.linalg.norm(after.accelerance - before.accelerance) < 1e-6 * size
    far, near = ((z - s.mean) / s.sd for z, s in ((x, plain), (begun, wider)))
    assert np.sum(near**2) < 0.5 * np.sum(far**2)
    assert wider.massive(begun)


def test_a_step_never_leads_uphill_nor_to_what_no_body_can_be(prior, few):
    structure = structure_of(prior, *EVERYTHING)
    misfit = FrfMisfit(structure, few, Tolerances(), 0.1)
    x = structure.mean.copy()
    set_to(structure, x, "local_resonator", 3, 1.0, 0.0, 0.0)
    found = minimised(misfit, x, 4)
    assert found.value < misfit(x).value
    assert misfit.possible(found.x)


def test_a_link_that_is_cut_and_whole_again_weighs_as_before(case, prior):
    """However far the fit moved its mass, centre and moments; halves are such as can be."""
    whole = RobotStructure(prior)
    cut = structure_of(prior, "link_flexibility at link_2")
    x, rng = whole.mean.copy(), np.random.default_rng(4)
    x[whole.inertial] = rng.normal(0.0, 0.5, whole.bodies.size)
    x[whole.names.index("mass of joint_2")] = 6.0
    y = cut.carried(whole, x)
    assert np.isfinite(cut.bodies.barrier(y[cut.inertial])[0])
    np.testing.assert_allclose(whole.carried(cut, y), x, atol=1e-6)
    y[[i for i, p in enumerate(cut.parameters) if "link" in p.name and p.kind == "stiffness"]] = 30
    both = (whole, x), (cut, y)
    told = [exported(s, z)[0].frequencies(case.q, 4).frequency_hz for s, z in both]
    np.testing.assert_allclose(*told, rtol=1e-4)


def test_what_swings_stays_in_the_band(prior, few):
    structure = structure_of(prior, "local_resonator at link_4")
    misfit, x = FrfMisfit(structure, few, Tolerances(), 0.1), structure.mean.copy()
    low, high = prior.effect_library.simulation.robot.config.band_hz
    for hertz in (1.05 * low, high / 1.05):
        set_to(structure, x, "local_resonator", 1, np.log(hertz))
        set_to(structure, x, "local_resonator", 3, 1.0, 0.0, 0.0)
        found = minimised(misfit, x, 12)
        assert found.value < misfit(x).value
        assert low <= np.exp(found.x[structure.own[0].start + 1]) <= high


@pytest.mark.parametrize("at_its_bound", [False, True])
def test_what_ends_at_its_bound_explains_nothing(prior, few, at_its_bound):
    structure = structure_of(prior, "local_resonator at link_4")
    misfit, x = FrfMisfit(structure, few, Tolerances(), SIZES[0]), structure.mean.copy()
    if at_its_bound:
        set_to(structure, x, "local_resonator", 1, structure.most[structure.own[0].start + 1])
    assert explained(StructureFit(misfit, misfit(x), 0.0)) is not at_its_bound


def test_a_soft_base_a_bending_link_and_a_hose_are_found_together(case):
    found = case.posterior()
    judged = Judged.of(case, found)
    kinds = {name.split(" at ")[0] for name in judged.named}
    assert {"soft_base", "link_flexibility", "local_resonator"} <= kinds
    assert judged.rmse_percent < 0.3
    assert judged.frac > 0.998
    assert abs(judged.scale - 1) < 2.5 * judged.scale_sd < 0.1
    assert isinstance(found, RobotPosterior)


def test_what_a_robot_stands_on_is_weighed_and_its_foot_is_found(tmp_path):
    case, block = on_a_block("kr10", 1000, tmp_path)
    found = case.posterior()
    [effect] = [e for e in found.structure.effects if e.kind == "foundation"]
    told = effect.parameters(found.values(effect))
    (mass, mass_sd, _), (height, height_sd, _) = told["mass"], told["height"]
    assert abs(mass - block.mass_kg) < max(3 * mass_sd, 0.1 * block.mass_kg)
    assert abs(height + block.side_m) < max(3 * height_sd, 0.1 * block.side_m)
    judged = Judged.of(case, found)
    assert judged.rmse_percent < 0.3
    assert judged.error < 0.06


def test_what_was_found_is_recalled_as_it_was(case, prior):
    tolerances = Tolerances.of(prior.effect_library.simulation.robot.config)
    search = Search(prior, case.frfs[:1], case.q[:1], case.band_hz, tolerances)
    found = search.found()
    again = search.recalled(found.remembered)
    np.testing.assert_array_equal(again.at.x, found.at.x)
    assert again.structure.names == found.structure.names
    assert again.evidence == pytest.approx(found.evidence, abs=0.1)


def test_what_may_give_beside_is_only_what_such_a_robot_can_have(case, prior):
    """A link from which mass was taken can weigh what it does, and its cut halves cannot."""
    tolerances = Tolerances.of(prior.effect_library.simulation.robot.config)
    search = Search(prior, case.frfs[:1], case.q[:1], case.band_hz, tolerances)
    structure = structure_of(prior, "added_mass at link_2")
    misfit = FrfMisfit(structure, search.data(8), tolerances)
    start, taken = structure.mean, structure.own[0].start
    lighter = [start - share * np.eye(start.size)[taken] for share in np.arange(0.2, 9.0, 0.2)]
    x = [x for x in lighter if misfit.possible(x)][-1]
    wider = search._widened(StructureFit(misfit, misfit(x), 0.0))
    labels = {effect.label for effect in wider.structure.effects}
    assert "soft_base at base" in labels
    assert "link_flexibility at link_2" not in labels
    exported(wider.structure, wider.at.x)  # and so it is a robot anywhere


@pytest.mark.parametrize(("size", "explained"), [(0.004, True), (0.3, False)])
def test_nothing_counts_as_known_where_nothing_explains(prior, few, size, explained):
    """Loss factors neither, which robot.toml does not have."""
    structure = structure_of(prior, "structural_damping at joints")
    misfit = FrfMisfit(structure, few, Tolerances(), size)
    posterior = RobotPosterior.of(StructureFit(misfit, misfit(structure.mean), 0.0))
    told = as_identification(posterior).estimates
    assert "loss_factor" in {estimate.kind for estimate in told}
    assert {estimate.explained for estimate in told} == {explained}


def test_what_the_fit_moved_far_is_told(prior):
    structure = RobotStructure(prior)
    x, sure = structure.mean.copy(), np.full(structure.size, 0.1)
    assert not departures_text(structure, x, sure)
    spring = next(i for i, p in enumerate(structure.parameters) if p.stated)
    mass = structure.names.index("mass of joint_5")
    for number in (spring, mass):
        x[number] += 5 * structure.sd[number]
    told = departures_text(structure, x, sure)
    times = np.exp(5 * structure.sd[spring])
    assert f"{significant(times)} times stiffer than robot.toml has it" in told
    assert "link_5 would have to weigh" in told
    assert "times stiffer" not in departures_text(structure, x, 10 * sure)
    x = structure.mean.copy()
    assert not masses_text(structure, x)
    x[mass] += 2 * structure.sd[mass]
    assert not departures_text(structure, x, sure)
    (heavier,) = (m for m in refitted_masses(structure, x) if m.link == "link_5")
    assert heavier.more_kg > heavier.sd_kg
    assert f"link_5 {significant(heavier.stated_kg + heavier.more_kg)} kg where " in masses_text(
        structure, x
    )
