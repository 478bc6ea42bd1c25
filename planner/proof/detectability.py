"""What tells of each effect of a case: the robot without it, and what is seen with it."""

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from planner.proof import refit
from planner.proof.deviation import Deviation
from planner.proof.fault_injection import HitVisit, InjectedFaults, quiet_hits
from planner.proof.hits import AXES, Hammer, SimulatedHit, noise_power, signed
from planner.proof.model import Truth

LINES = 100  # about so many are looked at
FALL = 4.0  # of the window under which hits with a law are compared: e^-4 is left at its end


@dataclass(frozen=True, eq=False)
class ScoredCase:
    """A case as it was made; `rng` as it was when its noise-free hits `quiet` were made."""

    load: Callable[[Deviation], Truth]  # of the case's robot
    band_hz: tuple[float, float]
    reach_m: float
    measured: InjectedFaults
    visits: Sequence[HitVisit]
    wanted: np.ndarray  # (n, dof) rad, set aside
    hammer: Hammer
    quiet: Sequence[Sequence[SimulatedHit]]
    rng: np.random.Generator


def detection_problem(case: ScoredCase, without: InjectedFaults) -> refit.DetectionProblem:
    """Of the effect that `without` lacks."""
    with_it = case.load(case.measured.deviation)
    truth = case.load(without.deviation)
    in_hits = without.ports != case.measured.ports or without.tone != case.measured.tone
    in_time = without.drift != case.measured.drift or without.load != case.measured.load
    n, step_s = case.quiet[0][0].force_n.size, 1 / case.hammer.sampling_rate_hz
    low, high = case.band_hz
    lines = np.flatnonzero(
        (np.fft.rfftfreq(n, step_s) >= low) & (np.fft.rfftfreq(n, step_s) <= high)
    )
    stride = max(1, round(len(lines) / LINES))
    rate = FALL / case.hammer.record_s if in_hits else 0.0
    s = rate + 2j * np.pi * lines[::stride] / (n * step_s)
    other = case.quiet
    if in_hits:
        again = copy.deepcopy(case.rng)
        other = quiet_hits(truth, without, case.visits, case.hammer, again)
    poses = []
    for visit, hits, plain in zip(case.visits, case.quiet, other, strict=True):
        now = without.at(truth, visit.progress)
        robot = snapshot(now, visit.q, s)
        moved = [_frf(snapshot(now, visit.q + turn, s), s) - _frf(robot, s)
                 for turn in refit.READBACK_RAD * np.eye(len(visit.q))]  # fmt: skip
        seen = _by_levels(hits, plain, _frf(robot, s), s, case.hammer) if in_hits else [
            (_shown(case.measured, with_it, visit, s), hits)
        ]  # fmt: skip
        sets = [
            refit.Observed(frf, _variance(some, s, case.hammer), _counts(some))
            for frf, some in seen
        ]
        poses.append(refit.Pose(robot, np.array(moved), sets))
    aside = [] if in_hits or in_time else [
        (snapshot(without.at(truth, 0), q, s), _shown(case.measured, with_it, HitVisit(q, ()), s))
        for q in case.wanted
    ]  # fmt: skip
    return refit.DetectionProblem(s, poses, aside, bodies(truth), case.reach_m, 1 / stride)


def snapshot(truth: Truth, q: np.ndarray, s: np.ndarray) -> refit.Snapshot:
    """A robot at a pose and lines s (F,), and its springs."""
    mass, damping, stiffness, hit, _ = truth.matrices(q)
    sense, parts = truth.frames(q)
    n = len(mass)
    relaxing = np.zeros((len(s), n), dtype=complex)  # what loss factors add to each spring
    for j, more, rate in truth.relaxing(q):
        relaxing[:, j] += more * s / (s + rate)
    at = s[:, None, None]
    z = at**2 * mass + at * damping + stiffness + relaxing[:, None] * np.eye(n)
    factors = truth.factors(q)
    springs = []
    for j, spring in enumerate(truth.springs):
        k, c = factors[j] * spring.stiffness, factors[j] * spring.damping
        sd = refit.STATED_SD if j < truth.stated else refit.SPRING_SD
        springs.append(refit.Spring(np.eye(n)[j], k + relaxing[:, j], c, k, sd))
    return refit.Snapshot(z, springs, np.vstack([hit, truth.turning(q)]).T, sense, parts)


def bodies(truth: Truth) -> dict[str, refit.Body]:
    """Mass, centre and second moment of each link, in the frame of its first piece."""
    found = {}
    for link, pieces in truth.pieces().items():
        mass = sum(m for m, _, _ in pieces)
        centre = np.sum([m * c for m, c, _ in pieces], axis=0) / mass
        second = sum(
            np.trace(i) / 2 * np.eye(3) - i + m * np.outer(c - centre, c - centre)
            for m, c, i in pieces
        )
        found[link] = refit.Body(mass, centre, np.asarray(second))
    return found


def _frf(robot: refit.Snapshot, s: np.ndarray) -> np.ndarray:
    right = np.linalg.solve(robot.z, robot.load[None, :, :3].astype(complex))
    return (s**2)[:, None, None] * (robot.sense[:3] @ right)


def _shown(injected: InjectedFaults, truth: Truth, visit: HitVisit, s: np.ndarray) -> np.ndarray:
    """FRFs (F, 3, 3) of a robot, as the chain shows them where something is wrong with it."""
    artefact = injected.artefact
    s = s + 1 / artefact.window_s
    frf = _frf(snapshot(injected.at(truth, visit.progress), visit.q, s), s)
    matrix = np.array(artefact.gain)[:, None] * artefact.rotation
    return (matrix @ frf) * np.exp(-s * artefact.delay_s)[:, None, None]


def _by_levels(
    hits: Sequence[SimulatedHit],
    plain: Sequence[SimulatedHit],
    h: np.ndarray,
    s: np.ndarray,
    hammer: Hammer,
) -> list[tuple[np.ndarray, list[SimulatedHit]]]:
    """FRFs (F, 3, 3) of weak and of strong hits, and these: h and what hits have beyond `plain`."""
    peaks = [float(np.max(hit.force_n)) for hit in hits]
    middle = np.sqrt(min(peaks) * max(peaks))
    out = []
    for strong in (False, True):
        some = [i for i, peak in enumerate(peaks) if (peak >= middle) == strong]
        counts, total = np.maximum(_counts([hits[i] for i in some]), 1), h.copy()
        for i in some:
            axis, sense = signed(hits[i].axis)
            extra = hits[i].acceleration_m_s2 - plain[i].acceleration_m_s2
            ratio = _transform(extra, s, hammer) / _transform(hits[i].force_n, s, hammer)
            total[:, :, axis] += sense * ratio.T / counts[axis]
        out.append((total, [hits[i] for i in some]))
    return out


def _transform(signal: np.ndarray, s: np.ndarray, hammer: Hammer) -> np.ndarray:
    """Of samples (…, n) at lines s, which are those of the record moved by their real part."""
    n, step_s = signal.shape[-1], 1 / hammer.sampling_rate_hz
    t = np.arange(n) * step_s
    lines = np.round(s.imag / (2 * np.pi) * n * step_s).astype(int)
    return np.fft.rfft(signal * np.exp(-s[0].real * t))[..., lines]


def _variance(hits: Sequence[SimulatedHit], s: np.ndarray, hammer: Hammer) -> np.ndarray:
    """(F, 3, 3) of the average of hits along each axis."""
    total, counts = np.zeros((len(s), 3, 3)), np.maximum(_counts(hits), 1)
    n = hits[0].force_n.size
    lines = np.round(s.imag / (2 * np.pi) * n / hammer.sampling_rate_hz).astype(int)
    for hit in hits:
        axis, force = AXES.index(hit.axis[1]), np.fft.rfft(hit.force_n)[lines]
        power = noise_power(hit, hammer)[lines] / np.abs(force) ** 2
        total[:, :, axis] += power[:, None] / counts[axis] ** 2
    return total + 1e-30


def _counts(hits: Sequence[SimulatedHit]) -> np.ndarray:
    return np.bincount([AXES.index(hit.axis[1]) for hit in hits], minlength=3)


def without_effect(
    whole: InjectedFaults, before: InjectedFaults, after: InjectedFaults
) -> InjectedFaults:
    """`whole` without the one effect that made `after` of `before`."""
    changes = _undone(whole, before, after)
    if before.deviation != after.deviation:
        deviations = whole.deviation, before.deviation, after.deviation
        changes["deviation"] = replace(whole.deviation, **_undone(*deviations))
    return replace(whole, **changes)


def _undone(whole: Any, before: Any, after: Any) -> dict[str, Any]:
    changes = {}
    for item in fields(before):
        old, new, now = (getattr(one, item.name) for one in (before, after, whole))
        if isinstance(now, tuple):
            extra = [one for one in new if not any(one is b for b in old)]
            gone = [one for one in old if not any(one is a for a in new)]
            kept = (one for one in now if not any(one is e for e in extra))
            changes[item.name] = (*kept, *gone)
        elif new is not old and new != old:
            changes[item.name] = old
    return changes
