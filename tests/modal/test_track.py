"""Labels over many poses: shifts, crossings, missing and unexpected modes; laws of the MAC.

Matchings of labels and modes are those of counting them all.
"""

from itertools import combinations, permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from planner.modal.mac import mac
from planner.modal.mode_matching import best, chances
from planner.modal.modes import Mode
from planner.modal.tracking import Guide, track

SHAPES = np.array([[1, 0.1, 0], [0.1, 1, 0.2], [0, 0.2, 1], [0.7, -0.7, 0.1]], complex)
X = np.linspace(0, 1, 20)[:, None]


def mode(frequency_hz: float, shape: np.ndarray, zeta: float = 0.03, sure: float = 0.95) -> Mode:
    nothing = np.full((3, 3), np.nan)
    unit = shape / np.linalg.norm(shape)
    return Mode(frequency_hz, 1e-3 * frequency_hz, zeta, 0.002, nothing, nothing, unit, sure)


def crossing() -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (n, 4) of a robot and of its simulation; modes 2 and 3 cross, not together."""
    x = X[:, 0]
    truth = np.stack([8 + x, 14 + 4 * x, 18 - 5 * x, 30 + 3 * x], axis=1)
    guide = np.stack([9 + x, 15 + 4 * x, 22 - 7 * x, 33 + x], axis=1)
    return truth, guide


def poses(truth: np.ndarray, rng: np.random.Generator) -> list[list[Mode]]:
    """Measured modes in order of frequency, scattered a little."""
    out = []
    for row in truth:
        shapes = SHAPES + 0.1 * (rng.normal(size=(4, 3)) + 1j * rng.normal(size=(4, 3)))
        values = row * np.exp(0.002 * rng.normal(size=4))
        found = [mode(f, s) for f, s in zip(values, shapes, strict=True)]
        out.append(sorted(found, key=lambda m: m.frequency_hz))
    return out


def guided(frequency_hz: np.ndarray) -> Guide:
    return Guide(frequency_hz, np.tile(SHAPES, (len(frequency_hz), 1, 1)))


def right(tracks, truth: np.ndarray) -> np.ndarray:
    """(n, k) whether the label carries the mode nearest its true frequency."""
    return np.abs(np.log(tracks.frequency_hz / truth)) < 0.01


@pytest.mark.parametrize("seed", range(5))
def test_labels_follow_shapes_through_a_crossing(seed):
    truth, guide = crossing()
    tracks = track(poses(truth, np.random.default_rng(seed)), guided(guide), X)
    assert np.mean(right(tracks, truth)) == 1.0
    assert np.all(np.argsort(tracks.frequency_hz[0]) == [0, 1, 2, 3])
    assert np.all(np.argsort(tracks.frequency_hz[-1]) == [0, 2, 1, 3])


def test_ordered_labels_keep_the_order():
    truth, guide = crossing()
    order = np.argsort(guide, axis=1)
    shapes = np.take_along_axis(np.tile(SHAPES, (20, 1, 1)), order[..., None], axis=1)
    ordered = Guide(np.sort(guide, axis=1), shapes)
    tracks = track(poses(truth, np.random.default_rng(0)), ordered, X, ordered=True)
    assert np.all(np.diff(tracks.frequency_hz, axis=1) > 0)


@settings(max_examples=20, deadline=None)
@given(
    pose=st.integers(0, 19),
    hidden=st.integers(0, 3),
    seed=st.integers(0, 3),
    ordered=st.booleans(),
)
def test_a_hidden_mode_shifts_no_other(pose, hidden, seed, ordered):
    truth, guide = crossing()
    if ordered:
        truth, guide = np.sort(truth, axis=1), np.sort(guide, axis=1)
        truth[:, 1:3] += [-3.0, 3.0]
        guide[:, 1:3] += [-3.0, 3.0]
    found = poses(truth, np.random.default_rng(seed))
    gone = truth[pose, hidden]
    nearest = int(np.argmin([abs(m.frequency_hz - gone) for m in found[pose]]))
    found[pose].pop(nearest)
    tracks = track(found, guided(guide), X, ordered)
    assert tracks.modes[pose][hidden] is None
    expected = np.ones((20, 4), bool)
    expected[pose, hidden] = False
    np.testing.assert_array_equal(right(tracks, truth), expected)


def test_strangers_carry_no_label_and_are_told():
    truth, guide = crossing()
    found = poses(truth, np.random.default_rng(1))
    stranger = mode(47.0, np.array([0.3, 0.4, -1.0]))
    found[7].append(stranger)
    tracks = track(found, guided(guide), X)
    assert tracks.unexpected[7] == (stranger,)
    assert np.all(right(tracks, truth))


def test_nothing_measured_and_nothing_expected():
    assert track([], Guide(np.zeros((0, 2)), np.zeros((0, 2, 3))), np.zeros((0, 1))).modes == ()
    tracks = track([[], []], guided(np.ones((2, 4))), X[:2])
    assert tracks.modes == ((None,) * 4,) * 2
    unknown = Guide(np.full((2, 2), np.nan), np.full((2, 2, 3), np.nan + 0j))
    found = [[mode(10.0, SHAPES[0])], [mode(10.1, SHAPES[0])]]
    assert track(found, unknown, X[:2]).modes == ((None, None),) * 2


def near_each_other(exchanged: bool) -> tuple[np.ndarray, list[list[Mode]]]:
    """Modes 2 and 3 come near each other at x = 0.5, and may exchange their shapes there."""
    apart = 2 * np.hypot(2 * (X[:, 0] - 0.5), 0.05)
    truth = np.stack([0 * apart + 8, 15 - apart / 2, 15 + apart / 2, 0 * apart + 30], axis=1)
    found = poses(truth, np.random.default_rng(4))
    if exchanged:
        for row in found[10:]:
            low, high = row[1], row[2]
            row[1:3] = [
                mode(low.frequency_hz, high.shape),
                mode(high.frequency_hz, low.shape),
            ]
    return truth, found


def test_measured_shapes_that_keep_their_places_outweigh_a_guide_that_crosses():
    truth, found = near_each_other(exchanged=False)
    tracks = track(found, guided(crossing()[1]), X)
    assert np.all(right(tracks, truth))
    assert np.min(tracks.probability) > 0.95


def test_beyond_an_exchange_that_may_be_a_crossing_labels_are_unsure():
    truth, found = near_each_other(exchanged=True)
    tracks = track(found, guided(truth), X)
    assert np.min(tracks.probability[:10]) > 0.9
    assert np.max(tracks.probability[10:, 1:3]) < 0.9
    assert np.min(tracks.probability[10:, [0, 3]]) > 0.9


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


@given(shapes, shapes, st.floats(1e-3, 1e3), st.floats(0, 6.3))
def test_mac_is_a_share_that_ignores_scale_and_phase(a, b, scale, phase):
    assert 0.0 <= mac(a, b) <= 1.0
    assert abs(mac(a, b) - mac(b, a)) < 1e-12
    assert abs(mac(a, a) - 1.0) < 1e-12
    assert abs(mac(a * scale * np.exp(1j * phase), b) - mac(a, b)) < 1e-9
