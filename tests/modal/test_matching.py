"""Matchings of labels and modes against counting them all, and laws of the MAC."""

from itertools import combinations, permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from planner.modal.mac import mac
from planner.modal.mode_matching import best, chances

numbers = st.floats(-1e3, 1e3).filter(lambda x: x == 0 or abs(x) > 1e-3)
shapes = st.builds(
    lambda r, i: r + 1j * i, arrays(float, 3, elements=numbers), arrays(float, 3, elements=numbers)
).filter(lambda s: np.any(s != 0))


def every_matching(labels: int, modes: int, ordered: bool):
    """All sets of pairs, one to one."""
    for size in range(min(labels, modes) + 1):
        for rows in combinations(range(labels), size):
            columns = combinations if ordered else permutations
            for chosen in columns(range(modes), size):
                yield dict(zip(rows, chosen, strict=True))


@pytest.mark.parametrize("ordered", [True, False])
@pytest.mark.parametrize("shape", [(1, 1), (3, 4), (4, 2), (2, 0)])
def test_probabilities_are_those_of_counting(shape, ordered):
    gain = np.random.default_rng(0).uniform(-10, 10, shape)
    weights, total = np.zeros((shape[0], shape[1] + 1)), 0.0
    for pairs in every_matching(*shape, ordered):
        weight = np.exp(sum(gain[p] for p in pairs.items()) / 2)
        total += weight
        for label in range(shape[0]):
            weights[label, pairs.get(label, shape[1])] += weight
    np.testing.assert_allclose(chances(gain, ordered), weights / total, atol=1e-12)


def test_many_modes_keep_the_likely_ones():
    gain = np.full((2, 15), -60.0)
    gain[0, 14], gain[1, 3] = 8.0, 6.0
    assert best(gain).tolist() == [14, 3]
    np.testing.assert_allclose(chances(gain)[[0, 1], [14, 3]], [0.982, 0.953], atol=1e-3)


@given(shapes, shapes)
def test_mac_is_between_zero_and_one(a, b):
    assert 0.0 <= mac(a, b) <= 1.0
    assert abs(mac(a, b) - mac(b, a)) < 1e-12
    assert abs(mac(a, a) - 1.0) < 1e-12


@given(shapes, shapes, st.floats(1e-3, 1e3), st.floats(0, 6.3))
def test_mac_ignores_scale_and_phase(a, b, scale, phase):
    assert abs(mac(a * scale * np.exp(1j * phase), b) - mac(a, b)) < 1e-9
