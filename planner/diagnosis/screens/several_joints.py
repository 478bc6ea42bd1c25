"""The screen for one law at several joints at once, as of drives that all harden.

Laws are fitted to some of the poses and judged at the others.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from planner.dataset.dataset import Dataset
from planner.diagnosis.finding import Finding
from planner.diagnosis.laws.equivalent_stiffness import own_springs
from planner.diagnosis.laws.level_refits import Refit, base, refits
from planner.diagnosis.laws.several_joints import (
    Family,
    Told,
    beginning,
    differences,
    settled,
    straightened,
    told_by,
)
from planner.diagnosis.laws.torque_laws import LAWS, Law, behaviour
from planner.dynamics.simulation import Simulation
from planner.inference.parallel import side_by_side

FITTED, LEAST_VISITS = 4, 3  # poses that laws are fitted to, of how many at least
AFAR, NEAR, CLOSE = (0.3,), (0.1,), (0.03,)  # shares by which errors are softened, in turn
RIVAL = 4.0  # times what the best law leaves: beyond, another is not followed further
CHANGES = 0.05  # of its stiffness, from the weakest to the strongest hits: else a joint is linear
MATTERS = 0.01  # of the levels' differences, that a joint's law must explain by itself
HOPEFUL, EXPLAINED = 0.3, 0.8  # of the levels' differences at poses that were not fitted
INDEPENDENT = 8.0  # values that what no law explains is worth, when laws are weighed
INEXACT = 0.15  # relative sd of k and a, as found on concealed robots
EVIDENCE = 50.0  # in nats: what is explained at other poses, by so many numbers, is no chance


@dataclass(frozen=True, eq=False)
class Shared:
    """A law at all joints, and the share of the levels' differences that it explains elsewhere.

    `changes` (m,): by how much of its stiffness each joint changes from the weakest hits to the
    strongest ones.
    """

    family: Family
    changes: np.ndarray
    explained: float
    left: float

    @property
    def bent(self) -> list[int]:
        """Joints that change."""
        return np.flatnonzero(np.abs(self.changes) > CHANGES).tolist()


def screen(recorded: Dataset, nominal: Simulation) -> tuple[Finding, ...]:
    """One law at two joints or more; nothing where that does not explain the force levels."""
    visits = [v for v in recorded.visits if len({recorded.level(h) for h in v.hits}) > 1]
    if len(visits) < LEAST_VISITS:
        return ()
    count = min(FITTED, len(visits) - 1)
    fitted = set(np.linspace(0, len(visits) - 1, count).round().astype(int).tolist())
    few = recorded.corrected(visits[i] for i in sorted(fitted))
    others = tuple(v for i, v in enumerate(visits) if i not in fitted)
    told = told_by(few, base(few, nominal))
    rest = recorded.corrected(others)
    judged = told_by(rest, base(rest, nominal))
    found = _laws(told, judged, refits(few, nominal))
    best = found[0]
    named = _that_matter(judged, best) if best.explained > EXPLAINED else []
    if len(named) < 2:
        return ()
    shares = np.array([(f.left / best.left) ** (-INDEPENDENT / 2) for f in found])
    sure = min(best.explained, float(shares[0] / shares.sum()))
    return _findings(best, own_springs(nominal)[0], named, sure)


def _laws(told: Told, judged: Told, seen: Sequence[Refit]) -> list[Shared]:
    """Laws fitted to what is told, best first as judged elsewhere."""

    def closer(some: Sequence[Shared], softness: tuple[float, ...]) -> list[Shared]:
        families = [one.family for one in some]
        new = side_by_side(partial(_settled, told, judged, softness), families)
        return [min(both, key=lambda one: one.left) for both in zip(some, new, strict=True)]

    begun = [beginning(seen, *kind, told.plain) for kind in _kinds(seen)]
    afar = _ordered(side_by_side(partial(_settled, told, judged, AFAR), begun))
    best = afar[0]
    if best.explained < HOPEFUL or len(_that_matter(judged, best)) < 2:
        return afar
    rivals = [one for one in afar if one.left < RIVAL * best.left]
    first, *rest = _ordered([*closer(rivals, NEAR), *afar[len(rivals) :]])
    return _ordered([*closer([first], CLOSE), *rest])


def _ordered(some: Sequence[Shared]) -> list[Shared]:
    return sorted(some, key=lambda one: one.left)


def _settled(told: Told, judged: Told, softness: Sequence[float], begun: Family) -> Shared:
    """Fitted to what is told, judged elsewhere."""
    family = settled(told, begun, softness)
    left, before, count = differences(judged, family)
    to_explain = before - count
    explained = 1 - max(left - count, 0.0) / to_explain if to_explain > 0 else 0.0
    changes = _changes(family, told.data.level)
    return Shared(family, changes, explained, max(left - count, INDEPENDENT / 2))


def _that_matter(judged: Told, best: Shared) -> list[int]:
    """Joints that, with a spring in the stead of their law, would explain the levels less."""
    whole, before, count = differences(judged, best.family)
    out = []
    for j in best.bent:
        left, _, _ = differences(judged, straightened(judged.plain, best.family, j))
        if left - whole > MATTERS * (before - count):
            out.append(j)
    return out


def _kinds(seen: Sequence[Refit]) -> list[tuple[Law, int]]:
    """Laws, with the sign of k, that go the way in which joints change from level to level."""
    stiffening, friction, backlash = LAWS
    if np.sum(np.log(seen[-1].stiffness / seen[0].stiffness)) > 0:
        return [(stiffening, 1), (backlash, 1)]
    return [(friction, 1), (stiffening, -1)]


def _changes(family: Family, level: np.ndarray) -> np.ndarray:
    if family.stiffer is None:
        return np.zeros(len(family.scale))
    share = family.stiffer / family.scale
    strong, weak = (np.median(share[level == one], axis=0) for one in (level.max(), level.min()))
    return strong - weak


def _findings(
    best: Shared, ports: tuple[str, ...], named: list[int], sure: float
) -> tuple[Finding, ...]:
    family = best.family
    assert family.normal is not None
    m = len(family.scale)
    spread = np.linalg.inv(2 * family.normal)[-2 * m :, -2 * m :]
    out = []
    for j in named:
        port = ports[j]
        own = spread[np.ix_([j, m + j], [j, m + j])]
        parameters = _parameters(family, j, own)
        told = ", ".join(
            f"{name.replace('_', ' ')} {v:.3g} ± {sd:.1g} {unit}"
            for name, (v, sd, unit) in parameters.items()
        )
        how = behaviour(family.law.effect, family.sign)
        text = f"{port.replace('_', ' ').capitalize()} {how} ({told})."
        if not out:
            text += (
                f" With the same in other joints it explains {100 * best.explained:.0f} % of how "
                "FRFs change with the force at poses that were not fitted."
            )
        out.append(Finding(family.law.effect, port, EVIDENCE, parameters, text, sure=sure))
    return tuple(out)


def _parameters(
    family: Family, joint: int, spread: np.ndarray
) -> dict[str, tuple[float, float, str]]:
    k, a = float(family.k[joint]), float(family.a[joint])
    values, slopes = (k, a), ((1.0, 0.0), (0.0, 1.0))
    if family.law.effect == "friction":
        values, slopes = (k, k * a), ((1.0, 0.0), (1.0, 1.0))
    out = {}
    for (name, unit), value, slope in zip(family.law.names, values, slopes, strict=True):
        along = np.array(slope)
        relative = np.hypot(np.sqrt(along @ spread @ along), INEXACT)
        out[name] = (value, float(relative * abs(value)), unit)
    return out
