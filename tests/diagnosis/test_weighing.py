"""Two effects that stand for one do not hide from each other how much it matters."""

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pytest

from planner.diagnosis import verdict

Q = np.zeros((1, 6))
HEAVY, LIGHT, OTHER = (
    SimpleNamespace(label=label, name=("local_resonator", label[:6]), general=False, absorbed=False)
    for label in ("link_6", "link_6#2", "link_4")
)


def fit(*effects: SimpleNamespace) -> SimpleNamespace:
    """Either of the first two gives nearly what both give."""
    there = HEAVY in effects or LIGHT in effects
    size = 1.0 * there + 0.004 * (HEAVY in effects) + 0.003 * (LIGHT in effects)
    return SimpleNamespace(
        effects=effects, h=np.array([10.0 + size + 0.04 * (OTHER in effects)]),
        evidence=2000.0 * there + 100.0 * len(effects),
    )  # fmt: skip


def fewer(explored, f: SimpleNamespace, effect: SimpleNamespace) -> SimpleNamespace:
    """As one that was settled by itself: its effects are the same, not the very same."""
    return fit(*(SimpleNamespace(**vars(o)) for o in f.effects if o is not effect))


def matched(f: SimpleNamespace, other: object, effects: Sequence[SimpleNamespace]) -> list:
    """By the labels, which here stay."""
    return [(mine, own) for mine in f.effects for own in effects if mine.label == own.label]


def gone(fewer: SimpleNamespace, f: SimpleNamespace) -> list:
    left = {effect.label for effect in fewer.effects}
    return [effect for effect in f.effects if effect.label not in left]


@pytest.fixture(autouse=True)
def plain_fits(monkeypatch):
    monkeypatch.setattr(verdict, "added", lambda f: f.effects)
    monkeypatch.setattr(verdict, "matched", matched)
    monkeypatch.setattr(verdict, "gone", gone)
    monkeypatch.setattr(verdict, "built", lambda f: ())
    monkeypatch.setattr(verdict, "_beyond", lambda f: [])
    monkeypatch.setattr(verdict, "_band", lambda f: (5.0, 50.0))
    monkeypatch.setattr(verdict, "_physics", lambda f, q, lines: f.h)
    monkeypatch.setattr(verdict, "RobotPosterior", SimpleNamespace(of=lambda f: f))
    monkeypatch.setattr(verdict, "_without", fewer)
    monkeypatch.setattr(verdict, "most_probable", lambda fits: fits[0])
    monkeypatch.setattr(verdict, "key_of", lambda f: key(f.effects))


def sizes(*sets: tuple[SimpleNamespace, ...]) -> verdict._Sizes:
    """Of sets that were settled, the likeliest first; all as likely."""
    explored = SimpleNamespace(plain=fit(), settled=tuple(fit(*effects) for effects in sets))
    return verdict._Sizes(explored, {key(effects): 0.5 for effects in sets}, 0.01, Q)


def key(effects: tuple[SimpleNamespace, ...]) -> tuple:
    return tuple(sorted(e.name for e in effects))


@pytest.mark.parametrize(
    ("effects", "counting"),
    [
        ((HEAVY, LIGHT), [HEAVY]),
        ((LIGHT,), [LIGHT]),
        ((OTHER,), []),
        ((OTHER, LIGHT, HEAVY), [HEAVY]),
    ],
)
def test_what_two_share_counts_once(effects, counting):
    found = sizes(effects).of_best()
    assert [e.operator for e in found if e.counts] == counting
    assert {id(e.operator) for e in found} == set(map(id, effects))


def test_what_only_another_likely_set_has_counts_by_its_size():
    assert [e.counts for e in sizes((HEAVY,), (HEAVY, OTHER)).of_others()] == [False]
    assert [e.counts for e in sizes((OTHER,), (OTHER, LIGHT)).of_others()] == [True]
    assert sizes((HEAVY, OTHER), (HEAVY,)).of_others() == []
