"""How much the recordings tell of an effect: log-likelihood ratios in nats."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from planner.truth.deviation import Deviation, Scatter
from planner.truth.handling import Handling
from planner.truth.hits import Hammer, SimulatedHit, noise_power
from planner.truth.model import Truth
from planner.truth.secret import HitVisit, Secret, windowed
from planner.truth.sensitivity import Columns, columns

AT_END = float(np.log(30))  # of the window under which records are compared: 1/30 is left


@dataclass(frozen=True)
class Nats:
    """Expected ln of the likelihood with the effect over that of the best robot without it.

    nats: that robot has other stiffnesses, dampings and inertias, within what they scatter by;
    hits, chain and noise are known. nats_known: it has the true ones. nats_open: misses of hits,
    readback and measuring chain are unknown too, within what they scatter by. change: of the
    accelerations' spectra within the band, relative (root of the sum of squares); left: what of
    that the best robot without the effect leaves; of a joint's own stiffness, which refitting tells
    by itself, all of it. All are of records under an exponential window,
    which counts up to half too little, never too much.
    """

    nats: float
    nats_known: float
    nats_open: float
    change: float
    left: float


@dataclass(frozen=True, eq=False)
class Conditions:
    """What was done in a case, and what is known of how that errs."""

    visits: Sequence[HitVisit]
    band_hz: tuple[float, float]
    scatter: Scatter
    handling: Handling
    hammer: Hammer


@dataclass(frozen=True, eq=False)
class Lacking:
    """A robot without one effect, its noise-free hits, and `most` nats that the effect can have."""

    truth: Truth
    secret: Secret
    quiet: Sequence[Sequence[SimulatedHit]]
    most: float = float("inf")


def nats(
    conditions: Conditions,
    truth: Truth,
    secret: Secret,
    quiet: Sequence[Sequence[SimulatedHit]],
    without: Lacking,
) -> Nats:
    """Of an effect; `truth`, `secret` and noise-free hits `quiet`, visit by visit, have it.

    Recordings are linear in what is refitted, with slopes half-way from one robot to the other.
    """
    found = _Sums()
    for number, visit in enumerate(conditions.visits):
        both = tuple(
            _columns(conditions, t, s, visit, list(hits[number]))
            for t, s, hits in (
                (truth, secret, quiet),
                (without.truth, without.secret, without.quiet),
            )
        )
        _add(found, conditions, both, secret, quiet[number], without, number)
    return found.nats(without.most)


class _Sums:
    """Products of all columns, summed over hits; the effect's comes last."""

    def __init__(self) -> None:
        self.known: np.ndarray | float = 0.0  # of robot and effect
        self.plain: np.ndarray | float = 0.0  # the same in m/s², not in units of the noise
        self.open: np.ndarray | float = 0.0  # of robot, chain and effect, hits and poses free
        self.size = self.change = 0.0  # of spectra and their change, squared

    def nats(self, most: float) -> Nats:
        """See `nats`; none is larger than `most`, or than what is known with less unknown."""
        known, whole = np.asarray(self.known), np.asarray(self.open)
        all_known = float(known[-1, -1]) / 2
        refitted = min(most, all_known, _left(known) / 2)
        opened = min(refitted, _left(whole) / 2)
        change = float(np.sqrt(self.change / self.size))
        left = self._unfollowed(known) if np.isinf(most) else change
        return Nats(refitted, all_known, opened, change, min(change, left))

    def _unfollowed(self, known: np.ndarray) -> float:
        """Relative size of what is left of the effect once a robot without it is fitted."""
        free = len(known) - 1
        fitted = np.linalg.solve(np.eye(free) + known[:free, :free], known[:free, free])
        off = np.append(-fitted, 1.0)
        return float(np.sqrt(max(0.0, off @ self.plain @ off) / self.size))


def _left(products: np.ndarray) -> float:
    """Of the last column's sum of squares once all others explain what they can."""
    return max(0.0, float(_without(products, len(products) - 1)[0, 0]))


def _without(products: np.ndarray, free: int) -> np.ndarray:
    """Products once the first `free` columns, whose numbers have unit variance, are fitted."""
    if free == 0:
        return products
    across = products[:free, free:]
    given = np.linalg.solve(np.eye(free) + products[:free, :free], across)
    return products[free:, free:] - across.T @ given


def _used(hit: SimulatedHit, conditions: Conditions) -> np.ndarray:
    """Lines (lines,) of `rfft` within the band."""
    low, high = conditions.band_hz
    frequency = np.fft.rfftfreq(hit.force_n.size, 1 / conditions.hammer.sampling_rate_hz)
    return (frequency >= low) & (frequency <= high)


def _columns(
    conditions: Conditions, truth: Truth, secret: Secret, visit: HitVisit, hits: list[SimulatedHit]
) -> list[Columns]:
    used = _used(hits[0], conditions)
    return columns(
        truth, secret, visit, hits, conditions.scatter, conditions.handling, conditions.hammer,
        used, _rate(secret, conditions.hammer),
    )  # fmt: skip


def _rate(secret: Secret, hammer: Hammer) -> float:
    """1/s: of the window under which records are compared, and of one that was left on them."""
    return AT_END / hammer.record_s + 1 / secret.artefact.window_s


def _add(
    found: _Sums,
    conditions: Conditions,
    both: tuple[list[Columns], ...],
    secret: Secret,
    quiet: Sequence[SimulatedHit],
    without: Lacking,
    visit: int,
) -> None:
    hammer, used = conditions.hammer, _used(quiet[0], conditions)
    whole: np.ndarray | float = 0.0
    for number, (hit, one, other) in enumerate(zip(quiet, *both, strict=True)):
        seen = _spectra(secret, hit, hammer, used)
        change = seen - _spectra(without.secret, without.quiet[visit][number], hammer, used)
        # Real and imaginary parts have half a line's noise each.
        white = np.sqrt(2 / np.tile(noise_power(hit, hammer)[used], 3))[:, None]
        free = [
            white * (getattr(one, name) + getattr(other, name)) / 2
            for name in ("hit", "pose", "chain", "robot")
        ]
        at = np.hstack([*free, white * change[:, None]])
        at = np.vstack([at.real, at.imag])
        alone = at[:, -1 - one.robot.shape[1] :]
        found.known = found.known + alone.T @ alone
        bare = alone / np.tile(white, (2, 1))
        found.plain = found.plain + bare.T @ bare
        found.size += float(np.sum(np.abs(seen) ** 2))
        found.change += float(np.sum(np.abs(change) ** 2))
        whole = whole + _without(at.T @ at, one.hit.shape[1])
    found.open = found.open + _without(np.asarray(whole), both[0][0].pose.shape[1])


def _spectra(secret: Secret, hit: SimulatedHit, hammer: Hammer, used: np.ndarray) -> np.ndarray:
    """(3 F,): of the accelerations."""
    heard = windowed(secret.artefact, hit, hammer).acceleration_m_s2
    t = np.arange(hit.force_n.size) / hammer.sampling_rate_hz
    heard = heard * np.exp(-AT_END * t / hammer.record_s)
    return np.fft.rfft(heard)[:, used].ravel()


def lacking(whole: Secret, before: Secret, after: Secret) -> Secret:
    """`whole` without the one effect that made `after` of `before`."""
    changes = {}
    for item in fields(Secret):
        old, new, now = (getattr(s, item.name) for s in (before, after, whole))
        if item.name == "deviation":
            changes["deviation"] = _lacking(now, old, new)
        elif isinstance(now, tuple):
            changes[item.name] = _less(now, old, new)
        elif new is not old:
            changes[item.name] = old
    return replace(whole, **changes)


def _lacking(whole: Deviation, before: Deviation, after: Deviation) -> Deviation:
    changes = {}
    for item in fields(Deviation):
        old, new, now = (getattr(d, item.name) for d in (before, after, whole))
        if isinstance(now, tuple):
            changes[item.name] = _less(now, old, new)
        elif new != old:
            changes[item.name] = old
    return replace(whole, **changes)


def _less(whole: tuple, before: tuple, after: tuple) -> tuple:
    """Without what `after` has beyond `before`, and with what it had in its stead."""
    extra = [item for item in after if not any(item is b for b in before)]
    gone = [item for item in before if not any(item is a for a in after)]
    return (*(item for item in whole if not any(item is e for e in extra)), *gone)
