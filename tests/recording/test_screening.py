"""Screening: bad hits are refused for the right reason, good ones are not."""

from dataclasses import replace

import numpy as np
import pytest

from planner.recording.screening import screen, screen_repeats
from tests.support.simulated_hits import make_hit

BAND = (4.0, 60.0)


def refused(hit) -> set[str]:
    return {fault.kind for fault in screen(hit) if fault.refuse}


def test_good_hits_are_not_refused():
    rng = np.random.default_rng(0)
    axes = ["+x", "-x", "+y", "-y", "+z", "-z"]
    wrong = 0
    for k in range(240):
        hit = make_hit(rng, axes[k % 6], noise=rng.uniform(0.01, 0.1),
                       duration_s=rng.uniform(0.004, 0.012))  # fmt: skip
        wrong += bool(refused(hit))
    print(f"{wrong} of 240 good hits refused")
    assert wrong == 0


def test_good_repeats_agree():
    rng = np.random.default_rng(1)
    for _ in range(20):
        hits = tuple(make_hit(rng, axis, noise=0.1) for axis in ("+x", "-x", "+x", "+y") * 2)
        assert screen_repeats(hits, BAND) == ((),) * 8


def spoil(hit, **changes):
    return replace(hit, **changes)


@pytest.mark.parametrize("seed", range(8))
def test_bad_hits_are_refused_for_the_right_reason(seed):
    rng = np.random.default_rng(seed)
    good = make_hit(rng)
    f, a = good.force_n, good.acceleration_m_s2
    clip = 0.2 * np.max(np.abs(a[0]))
    cases = {
        "double_hit": make_hit(rng, second=rng.uniform(0.25, 0.9)),
        "too_soft": make_hit(rng, duration_s=0.04),
        "polarity": spoil(good, force_n=-f),
        "too_weak": spoil(good, force_n=rng.standard_normal(f.size)),
        "clipped": spoil(good, acceleration_m_s2=np.clip(a, -clip, clip)),
        "truncated": spoil(good, force_n=f[int(np.argmax(f)):],
                           acceleration_m_s2=a[:, int(np.argmax(f)):]),
        "too_slow": spoil(good, sampling_rate_hz=100.0),
    }  # fmt: skip
    for kind, hit in cases.items():
        assert kind in refused(hit), kind
        for fault in screen(hit):
            assert fault.text.endswith("."), fault


def test_a_hit_on_the_wrong_axis_stands_out():
    rng = np.random.default_rng(2)
    hits = [make_hit(rng) for _ in range(4)]
    hits[2] = replace(make_hit(rng, "+y"), axis="+x")
    faults = screen_repeats(tuple(hits), BAND)
    assert [bool(f) for f in faults] == [False, False, True, False]
    hits[2] = replace(make_hit(rng, "-x"), axis="+x")
    assert screen_repeats(tuple(hits), BAND)[2][0].kind == "wrong_axis"
