"""A slight effect is given up only where the rest need not go far to take its place."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from planner.diagnosis.effects import library
from planner.diagnosis.effects.combined import together
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.damper_like_springs import (
    _as_structure,
    as_structures,
    beside_dampers,
    damper_like,
)
from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.linear.problem import COARSE
from planner.diagnosis.linear.slightness import without_slight
from planner.diagnosis.linear.stated_values import away, pulled
from planner.diagnosis.linear_diagnosis import of_its_own
from tests.support.exact_problem import exact_problem

SOFT, BASE = ("transverse_compliance", "joint_2"), ("base_compliance", "base")
BOTH = "transverse_compliance and base_compliance", "joint_2 and base"
STIFF, HEAVY = 12.0, 40.0  # ln of how much stiffer than likely; kg
Moved = dict[str, float]


@pytest.fixture(scope="module")
def at(tmp_path_factory) -> Callable[[str, str, Moved], Fit]:
    """A fit with one effect, some of its entries moved by so much from their priors' means."""
    problem = exact_problem(tmp_path_factory.mktemp("robot"))
    every = {(e.name, e.at): e for e in library(problem.simulation)} | {("none", ""): Effect("")}
    both = together(every[SOFT], every[BASE])
    assert both is not None
    every[BOTH] = both

    def made(name: str, place: str, moved: Moved) -> Fit:
        effect = every[name, place]
        misfit = problem.misfit(effect, COARSE)
        x = misfit.mean.copy()
        for entry, by in moved.items():
            there = [i for i, known in enumerate(misfit.names) if known.startswith(entry)]
            assert there
            x[there] += by
        return Fit(effect, misfit, x, misfit.by_pose(x))

    return made


def given_on(whole: Fit, without: Fit, prior=(100.0, 1.0)) -> float:
    """Share of the effect that ends up with the fit without it."""
    fits = [without, whole]
    told = [f.effect.parts() for f in fits]
    bent = np.array([moved(f, without) for f in fits])
    shares, evidence = np.array([0.0, 1.0]), np.array([-50.0, 0.0])
    return float(without_slight(fits, told, shares, prior, bent, evidence, 0.03)[0])


def moved(fit: Fit, plain: Fit) -> float:
    return pulled(fit, fit.x, plain)


def test_what_changes_nothing_is_given_to_the_simulation_without_it(at):
    stiff = at("base_compliance", "base", {"stiffness of base": STIFF})
    assert given_on(stiff, at("none", "", {})) > 0.95


def test_what_only_bent_inertias_make_up_for_stays(at):
    """The simulation without it is nearly the same, but of a robot that hardly can be there."""
    stiff = at("base_compliance", "base", {"stiffness of base": STIFF})
    bent = {f"i_{ab} of": s for ab, s in (("xy", 2.5), ("xz", -2.5), ("yz", 2.5))}
    found = at("none", "", bent)
    assert max(map(abs, away(found, found.x, found).values())) == pytest.approx(2.5)
    assert given_on(stiff, found) < 0.01


def test_a_mass_of_nothing_is_none_and_one_that_counts_stays(at):
    none = at("none", "", {})
    assert given_on(at("added_mass", "link_3", {}), none) > 0.95
    assert given_on(at("added_mass", "link_3", {"mass of added_mass": HEAVY}), none) < 0.05


def test_values_far_from_stated_are_likelier_where_something_unknown_pulls(at):
    springs = at("none", "", {"stiffness of": 0.0})
    two = [n for n in springs.misfit.names if n.startswith("stiffness")][:2]
    sd = springs.misfit.sd[springs.misfit.names.index(two[0])]
    sizes = 0.0, 2.0, 4.0, 6.0
    told = [moved(at("none", "", dict.fromkeys(two, s * sd)), springs) for s in sizes]
    assert told[0] < 0
    assert np.all(np.diff(told) > 0)
    assert told[3] - told[0] > 10
    # One alone is that joint's own stiffness.
    alone = [moved(at("none", "", {two[0]: s * sd}), springs) for s in sizes]
    assert max(alone) < 0


def test_of_two_slight_effects_the_likelier_stays(at):
    from planner.diagnosis.effects.combined import Both

    none = at("none", "", {})
    first, second = at("added_mass", "link_3", {}), at("added_mass", "link_2", {})
    both = Fit(Both.of(first.effect, second.effect), first.misfit, first.x, first.data)
    fits = [none, first, second, both]
    told = [f.effect.parts() for f in fits]
    shares, prior = np.array([0.0, 0.0, 0.0, 1.0]), np.ones(4)
    evidence = np.array([-5000.0, -2000.0, -50.0, 0.0])
    out = without_slight(fits, told, shares, prior, np.zeros(4), evidence, 0.03)
    # What both give on goes by way of the likelier, not to whichever changes a little less.
    assert out[1] == 0
    assert out[2] > 0


def test_dampers_say_nothing_of_what_is_stated(at):
    none = at("none", "", {})
    assert moved(at("none", "", {"damping of": 2.0}), none) == moved(none, none)


def test_of_the_halves_of_a_link_that_bends_nothing_is_stated(at):
    none, bent = at("none", "", {}), at("link_flexibility", "link_3", {})
    far = at("link_flexibility", "link_3", {"i_xx of link_3": 5.0, "i_xx of joint_3": 5.0})
    assert moved(far, none) == moved(bent, none)
    assert moved(at("none", "", {"i_xx of joint_3": 5.0}), none) > moved(none, none) + 5


def answering(fit: Fit, like: np.ndarray) -> Fit:
    """The fit, had the robot answered as it does at `like`, known to 1 %."""
    h = fit.misfit.response(like)[0]
    sd = 0.01 * np.abs(h)
    measured = replace(fit.misfit.measured, accelerance=h, sd=sd, noise_sd=sd)
    misfit = replace(fit.misfit, measured=measured)
    return Fit(fit.effect, misfit, fit.x, misfit.by_pose(fit.x))


def with_its_frfs(fit: Fit, other: Fit) -> Fit:
    """Another fit to the same FRFs."""
    misfit = replace(other.misfit, measured=fit.misfit.measured)
    return Fit(other.effect, misfit, other.x, misfit.by_pose(other.x))


@pytest.mark.parametrize("structure", [False, True])
def test_springs_like_dampers_are_stiff_where_that_loses_little(at, structure):
    """What gives like a damper is no structure; but where a stiff base is, it stands for that."""
    base, slow = (
        at("base_compliance", "base", {"damping of base": by}) for by in (0.0, np.log(60.0))
    )
    stiff = at("base_compliance", "base", {"stiffness of base": 1.9})
    fit = answering(slow, stiff.x if structure else slow.x)
    none = with_its_frfs(fit, at("none", "", {}))
    assert damper_like(fit, 1.0)
    assert not damper_like(base, 1.0)
    told = _as_structure(fit, none, 1.0)
    assert damper_like(told, 1.0) is not structure
    assert not structure or told.per_value < 0.01


def test_beside_a_strong_effect_a_spring_like_a_damper_is_worth_its_own(at):
    """Far less than the strong effect is, and yet all that the base explains."""
    softer = {"stiffness of joint_2": -2.0}
    slow = {"damping of base": np.log(60.0) + 3.0, "stiffness of base": 3.0}
    fit = at(*BOTH, slow | softer)
    fit = answering(fit, fit.x)
    none, soft = (with_its_frfs(fit, at(*one)) for one in (("none", "", {}), (*SOFT, softer)))
    nothing, strong, all_ = (f.log_evidence(1.0) for f in (none, soft, fit))
    assert strong - nothing > 100 * (all_ - strong) > 0
    assert as_structures([none, soft, fit])[2] is fit


@pytest.mark.parametrize(("worth", "kept"), [(0.001, False), (0.2, True)])
def test_a_strong_effect_is_told_without_a_damper_beside_it(at, worth, kept):
    """Unless the damper is worth much of what both explain: that is no structure's then."""
    softer = {"stiffness of joint_2": -2.0}
    both = at(*BOTH, softer | {"damping of base": np.log(60.0)})
    both = answering(both, both.x)
    assert damper_like(both, 1.0)
    fits = [with_its_frfs(both, at("none", "", {})), with_its_frfs(both, at(*SOFT, softer)), both]
    evidence = np.array([-1e4, -1e4 * worth, 0.0])
    shares = beside_dampers(fits, [0.0, 0.1, 0.9], evidence, 1.0)
    np.testing.assert_allclose(shares, [0.0, 0.1, 0.9] if kept else [0.0, 1.0, 0.0])


def test_a_damper_by_itself_is_given_to_nothing(at):
    slow = at("base_compliance", "base", {"damping of base": np.log(60.0)})
    slow = answering(slow, slow.x)
    none, other = (with_its_frfs(slow, at(*one, {})) for one in (("none", ""), SOFT))
    evidence = np.array([-1e4, -10.0, 0.0])  # another explanation is none of its parts
    shares = beside_dampers([none, other, slow], [0.0, 0.0, 1.0], evidence, 1.0)
    assert shares.tolist() == [0.0, 0.0, 1.0]


def test_the_mean_of_an_uneven_joint_is_told_with_it(at):
    problem = at("none", "", {}).misfit
    every = {(e.name, e.at): e for e in library(problem.setting.simulation)}
    uneven = every["angle_dependent_stiffness", "joint_2"]
    for place, count in (("joint_2", 1), ("joint_3", 2)):
        both = together(uneven, every["joint_stiffness", place])
        assert both is not None
        told = of_its_own(Fit(both, problem, problem.mean, at("none", "", {}).data), 1.0)
        assert len(told) == count
        assert told[0] is uneven
