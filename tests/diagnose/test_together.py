"""Screens and linear effects as one list of candidates."""

from dataclasses import dataclass, replace
from typing import Any, cast

import pytest

from planner.diagnosis.effects.added_mass import AddedMass
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.effects.sensor_channel import ChannelDelay
from planner.diagnosis.finding import Finding
from planner.diagnosis.law_beside_linear import leaves_room
from planner.diagnosis.linear_diagnosis import Candidate, Diagnosis, beside_another
from planner.diagnosis.revoked_artefacts import taken_back
from planner.diagnosis.thresholds import SECOND_EFFECT
from planner.diagnosis.verdict import linear_effects_apply, together
from planner.report.mismatch import MismatchPlaces


@dataclass(frozen=True)
class Linear:
    places: tuple
    probability: float


@dataclass(frozen=True)
class Diagnosed:
    candidates: tuple[Linear, ...]


def combined(findings, *linear):
    return together(findings, cast(Any, Diagnosed(tuple(Linear((p,), w) for p, w in linear))))


NONE, BASE = ("none", None), ("base_compliance", "base")
UNKNOWN = ("unknown", None)
GAIN = Finding("sensor_gain", "sensor_z", 500.0)
FRICTION = Finding("friction", "joint_2", 60.0)
TONE = Finding("unknown", None, 80.0)


@pytest.mark.parametrize("findings", [(), (GAIN,), (FRICTION,), (TONE,), (GAIN, FRICTION)])
def test_probabilities_sum_to_one_and_fall(findings):
    found = combined(findings, (BASE, 0.7), (NONE, 0.2), (UNKNOWN, 0.1))
    shares = [c.probability for c in found.candidates]
    assert sum(shares) == pytest.approx(1.0)
    assert shares == sorted(shares, reverse=True)


@pytest.mark.parametrize("sure", [NONE, BASE, UNKNOWN])
def test_no_probability_is_capped(sure):
    others = [place for place in (NONE, BASE, UNKNOWN) if place != sure]
    found = combined((), (sure, 0.999), *((place, 0.0005) for place in others)).candidates
    assert found[0].places == (sure,)
    assert found[0].probability == pytest.approx(0.999)


def test_without_findings_the_linear_verdict_stands():
    assert combined((), (NONE, 0.9), (BASE, 0.1)).verdict == "consistent"
    assert combined((), (BASE, 0.9), (NONE, 0.1)).verdict == "explained"
    assert combined((), (UNKNOWN, 0.9), (NONE, 0.1)).verdict == "unexplained"


def test_an_artefact_stands_beside_the_physics_that_is_found_once_it_is_corrected():
    found = combined((GAIN,), (BASE, 0.9), (NONE, 0.1))
    assert found.candidates[0].places == (("sensor_gain", "sensor_z"), BASE)
    alone = combined((GAIN,), (NONE, 0.9), (BASE, 0.1))
    assert alone.candidates[0].places == (("sensor_gain", "sensor_z"),)
    assert alone.verdict == "explained"


def test_a_nonlinear_joint_leaves_no_linear_effect():
    assert not linear_effects_apply((FRICTION,))
    assert linear_effects_apply((GAIN, TONE))
    found = combined((FRICTION,), (BASE, 0.9), (NONE, 0.1))
    assert found.candidates[0].places == (("friction", "joint_2"),)
    assert all(BASE not in c.places for c in found.candidates)


def test_a_tone_is_unknown_whatever_else_fits():
    assert combined((TONE,), (BASE, 0.9), (NONE, 0.1)).verdict == "unexplained"


def test_little_evidence_for_an_artefact_makes_it_doubtful():
    weak = Finding("channel_delay", "sensor", 3.0)
    assert 0.3 < combined((weak,), (NONE, 1.0)).candidates[0].probability < 0.7


def test_beside_a_joint_law_linear_effects_count_only_where_they_were_fitted_with_it():
    law = (Finding("friction", "joint_2", 60.0),)
    linear = (Linear((BASE,), 0.75), Linear((BASE, ("joint_stiffness", "joint_2")), 0.25))
    found = cast(Any, Diagnosed(linear))
    alone, both = together(law, found), together(law, found, True)
    assert alone.candidates[0].places == (("friction", "joint_2"),)
    # The joint's own spring is part of its law.
    assert both.candidates[0].places == (("friction", "joint_2"), BASE)
    assert both.candidates[0].probability == pytest.approx(alone.candidates[0].probability)
    assert both.verdict == "explained"


def test_only_a_crude_law_leaves_room_for_something_beside_it():
    assert not leaves_room(())
    assert not leaves_room((Finding("friction", "joint_2", 60.0, misfit=1.2),))
    assert leaves_room((Finding("friction", "joint_2", 60.0, misfit=9.0),))


def test_rival_laws_share_what_a_finding_is_sure_of():
    law = Finding("backlash", "joint_4", 60.0, sure=0.9, rivals=(("nonlinear_stiffness", 0.4),))
    found = combined((law,), (NONE, 1.0))
    shares = {c.places: c.probability for c in found.candidates}
    assert shares[(("backlash", "joint_4"),)] == pytest.approx(0.54)
    assert shares[(("nonlinear_stiffness", "joint_4"),)] == pytest.approx(0.36)
    assert shares[(UNKNOWN,)] == pytest.approx(0.1)
    assert found.established[0][1] == pytest.approx(0.54)


class Softer(Effect):
    name = "joint_stiffness"


@pytest.mark.parametrize(("none", "verdict"), [(0.3, "consistent"), (0.1, "explained")])
def test_beside_something_found_an_effect_is_one_more(none, verdict):
    fits = {at: cast(Any, f"fit of {at}") for at in ("", "joint_2")}
    candidates = (
        Candidate((Softer("joint_2"),), 0.95 - none, fits["joint_2"]),
        Candidate((Effect(""),), none, fits[""]),
        Candidate((), 0.05, None),
    )
    anything = cast(Any, None)
    before = Diagnosis("explained", candidates, anything, fits["joint_2"], 1.0, 0.0, anything)
    after = beside_another(before)
    shares = {c.fit: c.probability for c in after.candidates}
    assert after.verdict == verdict
    assert after.best == max(shares, key=lambda f: shares[f])
    assert sum(shares.values()) == pytest.approx(1.0)
    odds = (0.95 - none) / none
    assert shares[fits["joint_2"]] / shares[fits[""]] == pytest.approx(SECOND_EFFECT * odds)


DELAY = Finding("channel_delay", "sensor", 500.0, {"delay": (2.1e-3, 3e-4, "s")})


@dataclass(frozen=True)
class Delayed:
    """A fit whose one artefact is a further delay."""

    delay_s: float

    def parameters(self, temper: float, part: Effect) -> dict:
        return {"delay": (self.delay_s, 1e-6, "s")} if part.name == "channel_delay" else {}


def explained(delay_s: float, probability: float = 1.0) -> Diagnosis:
    fit = cast(Any, Delayed(delay_s))
    mass, delay = AddedMass("link_4"), ChannelDelay("sensor")
    candidates = (
        Candidate((mass, delay), probability, fit),
        Candidate((mass,), 1 - probability, fit),
        Candidate((), 0.0, None),
    )
    return Diagnosis("explained", candidates, fit, fit, 1.0, 0.0, cast(Any, None))


def test_a_delay_that_the_explanation_takes_back_was_none():
    kept, found = taken_back((DELAY, FRICTION), explained(-2.09e-3))
    assert kept == (FRICTION,)
    assert found.candidates[0].places == (("added_mass", "link_4"),)
    assert found.candidates[-1].places == (UNKNOWN,)


def test_where_nothing_is_explained_but_the_delay_nothing_is_left_of_it():
    found = explained(-2.09e-3)
    alone = replace(found.candidates[0], effects=(ChannelDelay("sensor"),))
    kept, found = taken_back((DELAY,), replace(found, candidates=(alone, *found.candidates[2:])))
    assert kept == ()
    assert not any(e.at for e in found.candidates[0].effects)


@pytest.mark.parametrize("found", [explained(-1e-3), explained(2.1e-3), explained(-2.1e-3, 0.6)])
def test_a_delay_that_is_only_mended_or_doubted_stays(found):
    assert taken_back((DELAY,), found) == ((DELAY,), found)


def test_what_is_off_is_said_without_gaps():
    places = MismatchPlaces([[11.0, 18.0]], (), [])
    assert places.sentence.endswith("the simulation is clearly off at 11 to 18 Hz.")
    places = MismatchPlaces([[11.0, 18.0]], ("P1", "P3"), ["x"])
    assert places.sentence.endswith("at 11 to 18 Hz, at poses P1, P3, along x.")
