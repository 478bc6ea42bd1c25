"""Two effects that stand for one do not hide from each other how much it matters."""

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


@pytest.fixture(autouse=True)
def plain_fits(monkeypatch):
    monkeypatch.setattr(verdict, "added", lambda f: f.effects)
    monkeypatch.setattr(verdict, "built", lambda f: ())
    monkeypatch.setattr(verdict, "_beyond", lambda f: [])
    monkeypatch.setattr(verdict, "_band", lambda f: (5.0, 50.0))
    monkeypatch.setattr(verdict, "_physics", lambda f, q, lines: f.h)
    monkeypatch.setattr(verdict, "RobotPosterior", SimpleNamespace(of=lambda f: f))
    monkeypatch.setattr(verdict, "_without", fewer)


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
    explored = SimpleNamespace(plain=fit(), settled=())
    found = verdict._weighed(explored, fit(*effects), {}, 0.01, Q)
    assert [e.operator for e in found if e.counts] == counting
    assert {id(e.operator) for e in found} == set(map(id, effects))
