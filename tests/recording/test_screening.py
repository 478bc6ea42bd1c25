"""Screening: bad hits and channels are refused for the right reason, good ones are not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.dataset.dataset import Dataset, Visit
from planner.frf.estimator import estimate
from planner.frf.frf import unreciprocal
from planner.recording.channel_faults import by_good_sensors
from planner.recording.force_levels import levels
from planner.recording.points import Dof
from planner.recording.records import Hit
from planner.recording.repeats import doubts, screen_repeats
from planner.recording.screening import driving_point, screen
from tests.support.simulated_hits import POLES, RESIDUES, make_hit

BAND = (4.0, 60.0)


def refused(hit) -> set[str]:
    return {fault.kind for fault in screen(hit, BAND) if fault.refuse}


def odd_ones(hits) -> dict[int, str]:
    """Which of the hits disagree with the others, and how."""
    found = screen_repeats(tuple(hits), BAND)
    return {i: faults[0].kind for i, faults in enumerate(found) if faults}


def test_good_hits_are_not_refused_and_agree():
    rng = np.random.default_rng(0)
    for _ in range(8):
        hits = [make_hit(rng, axis, noise=0.1) for axis in ("+x", "-x", "+x", "+y") * 2]
        assert odd_ones(hits) == {}
        hits += [make_hit(rng, axis, rng.uniform(0.01, 0.1), rng.uniform(0.004, 0.012))
                 for axis in ("-y", "+z", "-z")]  # fmt: skip
        assert not any(map(refused, hits))


@pytest.mark.parametrize("seed", range(8))
def test_bad_hits_are_refused_for_the_right_reason(seed):
    rng = np.random.default_rng(seed)
    good = make_hit(rng)
    f, a = good.force_n, good.acceleration_m_s2
    clip = 0.2 * np.max(np.abs(a[0]))
    cases = {
        "double_hit": make_hit(rng, second=rng.uniform(0.25, 0.9)),
        "too_soft": make_hit(rng, duration_s=0.04),
        "polarity": replace(good, force_n=-f),
        "too_weak": replace(good, force_n=rng.standard_normal(f.size)),
        "clipped": replace(good, acceleration_m_s2=np.clip(a, -clip, clip)),
        "truncated": replace(good, force_n=f[int(np.argmax(f)):],
                           acceleration_m_s2=a[:, int(np.argmax(f)):]),
        "too_slow": replace(good, sampling_rate_hz=100.0),
    }  # fmt: skip
    for kind, hit in cases.items():
        assert kind in refused(hit), kind
        for fault in screen(hit, BAND):
            assert fault.text.endswith("."), fault


@pytest.mark.parametrize(
    ("odd", "kind"),
    [({"axis": "+y"}, "wrong_axis"), ({"axis": "-x"}, "wrong_axis"),
     # Of another pose, whose first mode lies elsewhere: not unlike, but less than the others are.
     *[({"poles": POLES * [by, 1.0]}, "incoherent") for by in (1.05, 1.06, 1.12)]],
)  # fmt: skip
def test_a_hit_along_another_axis_or_of_another_pose_is_refused(odd, kind):
    rng = np.random.default_rng(3)
    hits = [make_hit(rng, axis) for axis in ("+x", "+y", "+z") for _ in range(4)]
    hits[1] = replace(make_hit(rng, **odd), axis="+x")
    assert odd_ones(hits) == {1: kind}


def levelled(rng, changed=POLES, axes=("+x", "+y", "+z"), repeats=1):
    """Three levels; the strongest hits are those of a structure with `changed` poles."""
    return tuple(
        make_hit(rng, axis, peak_n=peak * rng.uniform(0.8, 1.2), poles=poles)
        for axis in axes
        for peak, poles in ((300.0, POLES), (750.0, POLES), (1900.0, changed))
        for _ in range(repeats)
    )


@pytest.mark.parametrize("repeats", [1, 2])
def test_a_level_that_is_answered_otherwise_is_not_refused(repeats):
    """A joint that grows stiffer moves the modes: the diagnosis is to say so."""
    assert odd_ones(levelled(np.random.default_rng(5), 1.3 * POLES, repeats=repeats)) == {}


def test_a_hit_that_its_own_level_disagrees_with_is_refused():
    rng = np.random.default_rng(6)
    hits = list(levelled(rng, 1.3 * POLES, repeats=3))
    hits[7] = make_hit(rng, "+x", peak_n=1900.0, poles=0.7 * POLES)
    assert odd_ones(hits) == {7: "incoherent"}
    # Of two that differ nobody knows which is wrong, unless one is as all others are.
    assert odd_ones(hits[:8]) == {}
    linear = list(levelled(rng, repeats=2))
    linear[5] = hits[7]
    assert list(odd_ones(linear)) == [5]


def test_a_hit_along_another_axis_stands_out_at_a_level_of_its_own():
    rng = np.random.default_rng(7)
    hits = list(levelled(rng))
    hits[2] = replace(make_hit(rng, "+y", peak_n=1900.0), axis="+x")
    (fault,) = screen_repeats(tuple(hits), BAND)[2]
    assert (fault.kind, "along y" in fault.text) == ("wrong_axis", True)


@pytest.mark.parametrize(
    ("force", "acceleration", "said"),
    [
        (1, 1 / 9.80665, "9.8 times smaller than its repeats: g instead of m/s²?"),
        (1 / 4.44822, 1, "times larger than its repeats: lbf instead of N?"),
        (1, 3, "3 times larger than its repeats: another unit or sensitivity?"),
        (3, 3, ""),
        (1, 1.3, ""),
    ],
)
def test_a_file_in_another_unit_than_its_repeats_is_told(force, acceleration, said):
    rng = np.random.default_rng(9)
    hits = [make_hit(rng, axis) for axis in ("+x", "+y", "+z") for _ in range(4)]

    def changed(hit):
        return replace(
            hit, force_n=force * hit.force_n, acceleration_m_s2=acceleration * hit.acceleration_m_s2
        )

    hits[5] = changed(hits[5])
    assert list(odd_ones(hits)) == ([5] if said else [])
    assert said in "".join(fault.text for fault in screen_repeats(tuple(hits), BAND)[5])
    # Of two, or of two and two, nobody knows which is right: all are asked about.
    for few in (hits[4:6], [changed(hits[4]), *hits[5:8]]):
        assert not any(screen_repeats(tuple(few), BAND))
        assert [bool(d) for d in doubts(tuple(few), BAND)] == [bool(said)] * len(few)


def test_hits_that_tilt_as_hands_do_agree():
    """Along an axis that hardly answers, what a tilt brings from another is larger than that."""
    rng = np.random.default_rng(8)
    stiff = RESIDUES * np.array([1.0, 1.0, 0.03])[:, None] * np.array([1.0, 1.0, 0.03])
    alone = 0
    for _ in range(10):
        hits = [make_hit(rng, axis, residues=stiff) for axis in ("+x", "+y") for _ in range(2)]
        for tilt in rng.normal(0.0, np.deg2rad(2.0), (3, 2)):
            turned = np.array([stiff[..., 0], stiff[..., 1]])
            moved = stiff.copy()
            moved[..., 2] += np.tensordot(tilt, turned, 1)
            hits.append(make_hit(rng, "+z", residues=moved))
        alone += any(screen_repeats(tuple(hits[4:]), BAND)[i] for i in range(3))
        assert odd_ones(hits) == {}
    assert alone > 0  # without the other axes nobody could tell


def test_a_coarse_converter_is_no_overload_and_no_error():
    """Stored in a few steps only, a weak channel is often at its top."""
    good = make_hit(np.random.default_rng(9), noise=0.05)
    samples = good.acceleration_m_s2.copy()
    step = np.max(np.abs(samples[2]))
    samples[2] = np.round(samples[2] / step) * step
    assert "clipped" not in refused(replace(good, acceleration_m_s2=samples))
    samples[2] = step * (np.arange(samples.shape[1]) % 2)
    assert "clipped" not in refused(replace(good, acceleration_m_s2=samples))


ELBOW = tuple(Dof("elbow", axis) for axis in "xyz")


def by_two_sensors(rng, spoil=lambda samples: samples):
    """A hit that the tool's sensor and one at the elbow heard; elbow y is spoilt."""
    hit = make_hit(rng)
    own = hit.acceleration_m_s2
    more = 0.4 * own[[1, 2, 0]]
    more[1] = spoil(more[1])
    return replace(
        hit, acceleration_m_s2=np.vstack([own, more]), responses=(*hit.responses, *ELBOW)
    )


def clipped(samples):
    most = 0.3 * np.max(np.abs(samples))
    return np.clip(samples, -most, most)


@pytest.mark.parametrize(
    ("kind", "spoil", "said"),
    [("dead", lambda samples: np.full_like(samples, 0.3), "elbow y is constant"),
     ("clipped", clipped, "elbow y is clipped")],
)  # fmt: skip
def test_a_bad_channel_costs_its_sensor_and_no_other(kind, spoil, said):
    hit = by_two_sensors(np.random.default_rng(0), spoil)
    assert kind in {fault.kind for fault in screen(hit, BAND)}
    left, told = by_good_sensors(hit)
    assert left.responses == hit.responses[:3]
    np.testing.assert_array_equal(left.acceleration_m_s2, hit.acceleration_m_s2[:3])
    assert [fault.kind for fault in told] == [kind]
    assert said in told[0].text
    assert not any(fault.refuse for fault in (*told, *screen(left, BAND)))


def test_good_sensors_stay_and_the_only_one_is_refused_as_before():
    rng = np.random.default_rng(2)
    whole = by_two_sensors(rng)
    assert by_good_sensors(whole) == (whole, ())
    alone = make_hit(rng)
    dead = alone.acceleration_m_s2 * np.array([[1.0], [0.0], [1.0]])
    alone = replace(alone, acceleration_m_s2=dead)
    assert by_good_sensors(alone) == (alone, ())
    assert {fault.kind for fault in screen(alone, BAND) if fault.refuse} == {"dead"}


def test_a_hit_whose_sign_is_turned_answers_against_itself():
    rng = np.random.default_rng(3)
    for axis in ("+x", "-x", "+y", "-y", "+z", "-z"):
        hit = make_hit(rng, axis, noise=0.05)
        assert driving_point(hit, BAND) == ()
        other = ("-" if axis[0] == "+" else "+") + axis[1]
        (fault,) = driving_point(replace(hit, axis=other), BAND)
        assert not fault.refuse
        assert f"hits along {other}" in fault.text
        assert driving_point(replace(hit, axis=other, hit_point="elbow"), BAND) == ()


def test_axes_that_do_not_fit_each_other_are_said():
    rng = np.random.default_rng(4)
    hits = tuple(make_hit(rng, axis) for axis in ("+x", "+y", "+z") * 2)
    assert unreciprocal(estimate(hits, BAND)) == ()
    turned = np.array([[1.0], [-1.0], [1.0]])
    wrong = tuple(replace(h, acceleration_m_s2=turned * h.acceleration_m_s2) for h in hits)
    told = unreciprocal(estimate(wrong, BAND))
    assert told
    assert all("along y" in text for text in told)


def pushed(peak):
    force = np.zeros(64)
    force[8] = peak
    return Hit(Path("hit"), "+x", 400.0, force, np.zeros((3, 64)))


def scattered(rng, *usual, count=8):
    """Nobody hits alike twice."""
    return [peak * factor for peak in usual for factor in rng.uniform(0.75, 1.25, count)]


@pytest.mark.parametrize("seed", range(10))
def test_levels_are_told_apart_whether_or_not_forces_lie_in_between(seed):
    rng = np.random.default_rng(seed)
    assert len(levels(np.sort(scattered(rng, 1000.0, count=20)))) == 1
    found = levels(np.sort(scattered(rng, 400.0, 1000.0, 2500.0)))
    assert [len(group) for group in found] == [8, 8, 8]
    # Hits asked for between the levels so far fill the gap that told them apart.
    between = scattered(rng, 1400.0, 1700.0, 2000.0, 2500.0, count=2)
    assert len(levels(np.sort(scattered(rng, 1200.0, 3000.0) + between))) > 1
    hits = tuple(pushed(peak) for peak in rng.permutation(np.geomspace(500, 3500, 24)))
    recorded = Dataset.of_visits((Visit("P1", np.zeros(6), 0.0, hits),), (5.0, 50.0))
    groups = levels(np.sort([hit.pulse.peak_n for hit in hits]))
    assert all(hit.pulse.peak_n in groups[recorded.level(hit)] for hit in hits)
