"""What tells of each effect of a case: the robot without it, and what is seen with it."""

from collections.abc import Sequence

import numpy as np

from planner.proof import refit
from planner.proof.tree.case import Case, system_of
from planner.proof.tree.effects import Effect
from planner.proof.tree.laws import Spring
from planner.proof.tree.records import Motion
from planner.proof.tree.system import System, Tie

LINES = 100  # about so many are looked at


def question(case: Case, effect: Effect) -> refit.Question:
    """Of one effect of a case whose recordings have been written."""
    rest = [e for e in case.effects if e is not effect]
    length = case.clock.samples / case.clock.rate
    sigma = 4.0 / length if effect.law is not None else 0.0
    low, high = case.robot.band
    lines = np.arange(int(np.ceil(low * length)), int(high * length) + 1)
    stride = max(1, round(len(lines) / LINES))
    s = sigma + 2j * np.pi * lines[::stride] / length
    poses = [_pose(case, effect, rest, number, s, sigma) for number in range(len(case.poses))]
    in_time = effect.law is not None or effect.memory_per_hit > 0
    aside = [] if in_time else [
        (snapshot(system_of(case.truth, rest, q), s), _shown(case, effect, q, s, 0.0))
        for q in case.wanted
    ]  # fmt: skip
    bodies = {
        f"link_{i + 1}": refit.Body(b.mass, b.centre, b.second)
        for i, b in enumerate(case.robot.links)
    }
    return refit.Question(s, poses, aside, bodies, case.robot.reach, 1 / stride)


def snapshot(system: System, s: np.ndarray) -> refit.Snapshot:
    """A system at some lines, and which of its springs can be moved."""
    springs = [_spring(tie, s) for tie in system.ties if _movable(tie)]
    z = system.dynamic_stiffness(s)
    return refit.Snapshot(z, springs, system.load, system.sense, system.parts)


def _movable(tie: Tie) -> bool:
    return tie.mutual and isinstance(tie.law, Spring)


def _spring(tie: Tie, s: np.ndarray) -> refit.Spring:
    law = tie.law
    sd = refit.STATED_SD if tie.name.endswith(":gear") else refit.SPRING_SD
    return refit.Spring(tie.left, law(s) - law.damping * s, law.damping, law.stiffness, sd)


def _pose(
    case: Case, effect: Effect, rest: Sequence[Effect], number: int, s: np.ndarray, sigma: float
) -> refit.Pose:
    q, mine = case.poses[number], [i for i, h in enumerate(case.hits) if h.pose == number]
    before = system_of(case.truth, list(rest), q)
    h = before.frf(s)[:, :3, :3]
    readback = np.array([
        system_of(case.truth, list(rest), q + refit.READBACK_RAD * unit).frf(s)[:, :3, :3] - h
        for unit in np.eye(len(q))
    ])  # fmt: skip
    groups, sets = (_levels(case, mine) if effect.law is not None else [mine]), []
    for some in groups:
        if effect.law is not None:
            seen = h + _excess(case, some, s, sigma)
        else:
            warm = float(np.mean([case.warmth(case.hits[i].order) for i in some]))
            seen = _shown(case, effect, q, s, warm)
        sets.append(refit.Observed(seen, _variance(case, some, s), _counts(case, some)))
    return refit.Pose(snapshot(before, s), readback, sets)


def _shown(case: Case, effect: Effect, q: np.ndarray, s: np.ndarray, warmth: float) -> np.ndarray:
    """FRFs (F, 3, 3) with the effect, as the chain shows them where it is an artefact."""
    chain = effect.chain
    window, length = chain.get("window"), case.clock.samples / case.clock.rate - case.clock.trigger
    faster = -np.log(window["end"]) / length if window else 0.0
    h = system_of(case.truth, case.effects, q, warmth).frf(s + faster)[:, :3, :3]
    return (chain.get("matrix", np.eye(3)) @ h) * np.exp(-s * chain.get("delay", 0.0))[
        :, None, None
    ]


def _levels(case: Case, mine: list[int]) -> list[list[int]]:
    """Weak hits and strong ones, where there are both."""
    peaks = np.array([case.hits[i].peak for i in mine])
    middle = np.sqrt(peaks.min() * peaks.max()) if peaks.max() > 1.4 * peaks.min() else 0.0
    both = [[i for i, p in zip(mine, peaks, strict=True) if (p >= middle) == strong]
            for strong in (False, True)]  # fmt: skip
    return [some for some in both if some]


def _excess(case: Case, some: list[int], s: np.ndarray, sigma: float) -> np.ndarray:
    """Averaged FRFs (F, 3, 3) of nonlinear hits less those of the same hits without the law."""
    total, counts = np.zeros((len(s), 3, 3), complex), np.maximum(_counts(case, some), 1)
    for i in some:
        hit, motion = case.hits[i], case.motions[i]
        extra = _transform(case, motion.motion[:3] - case.linear[i].motion[:3], s, sigma)
        ratio = extra / _transform(case, motion.force, s, sigma)
        total[:, :, hit.axis] += hit.sign * ratio.T / counts[hit.axis]
    return total


def _transform(case: Case, signal: np.ndarray, s: np.ndarray, sigma: float) -> np.ndarray:
    """Transform of samples (…, n) at lines s, which are lines of the record moved by sigma."""
    t = np.arange(case.clock.samples) / case.clock.rate
    lines = np.round(s.imag / (2 * np.pi) * case.clock.samples / case.clock.rate).astype(int)
    return np.fft.rfft(signal * np.exp(-sigma * t), axis=-1)[..., lines]


def _variance(case: Case, some: list[int], s: np.ndarray) -> np.ndarray:
    """(F, 3, 3) of the axis-wise average: the case's noise over each hit's force."""
    total, counts = np.zeros((len(s), 3, 3)), np.maximum(_counts(case, some), 1)
    power = np.mean([np.abs(_transform(case, n, s, 0.0)) ** 2 for n in case.noises], axis=0)
    for i in some:
        axis, force = case.hits[i].axis, _transform(case, _force(case.motions[i]), s, 0.0)
        total[:, :, axis] += (power / np.abs(force) ** 2).T / counts[axis] ** 2
    return total + 1e-30


def _force(motion: Motion) -> np.ndarray:
    return motion.force


def _counts(case: Case, some: list[int]) -> np.ndarray:
    """Hits by axis."""
    return np.bincount([case.hits[i].axis for i in some], minlength=3)
