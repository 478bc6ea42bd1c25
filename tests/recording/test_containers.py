"""Hits in containers as other programs write them: structs, cells, groups, waveforms, segments."""

import numpy as np
import pytest

from planner.recording.hits import hits_from
from planner.recording.read import hit_count, read
from tests.support.containers import MANY_HITS, ONE_HIT
from tests.support.simulated_hits import make_hit

HITS = [make_hit(np.random.default_rng(k), axis="+x", record_s=1.0) for k in range(3)]


def same(found, made, skip=0, digits=1e-6, rate=1e-4):
    """Whether a hit was read as it was made, from a sample on."""
    scale = np.max(np.abs(made.acceleration_m_s2))
    assert found.sampling_rate_hz == pytest.approx(made.sampling_rate_hz, rel=rate)
    np.testing.assert_allclose(found.force_n, made.force_n[skip:], rtol=0, atol=digits * 1e3)
    np.testing.assert_allclose(
        found.acceleration_m_s2, made.acceleration_m_s2[:, skip:], rtol=0, atol=digits * scale
    )


@pytest.mark.parametrize("what", ONE_HIT)
def test_a_hit_is_read_from_any_container(tmp_path, what):
    name, write = ONE_HIT[what]
    write(tmp_path / name, HITS)
    (hit,) = hits_from(read(tmp_path / name), "+x")
    same(hit, HITS[0])
    assert hit_count(tmp_path / name) == 1
    assert not hit.remarks


@pytest.mark.parametrize("what", MANY_HITS)
def test_each_group_that_is_a_hit_is_one(tmp_path, what):
    name, write = MANY_HITS[what]
    write(tmp_path / name, HITS)
    found = hits_from(read(tmp_path / name), "+x")
    assert len(found) == hit_count(tmp_path / name) == len(HITS)
    for hit, made in zip(found, HITS, strict=True):
        same(hit, made)
