"""Change of the FRFs by each effect, and what the recordings tell of it (nats.py)."""

import numpy as np

from planner.proof.tree.adjusted import gear_moves
from planner.proof.tree.case import Case, system_of
from planner.proof.tree.effects import Effect
from planner.proof.tree.nats import READBACK_SD, Observed, Pose, nats_of
from planner.proof.tree.records import Motion
from planner.proof.tree.system import System


def lines_of(case: Case) -> np.ndarray:
    """Frequencies (Hz) of a record's lines in the robot's band."""
    lines = np.fft.rfftfreq(case.clock.samples, 1 / case.clock.rate)
    some = lines[(lines >= case.robot.band[0]) & (lines <= case.robot.band[1])]
    return some[:: _stride(len(some))]


def _stride(lines: int) -> int:
    """Every how many lines are looked at: some 120 are left, each of which counts for more."""
    return max(1, round(lines / 120))


def sizes_of(case: Case) -> list[tuple[float, float, float]]:
    """(change, nats, nats at 1 %) of every effect of a case whose recordings have been written."""
    return [_sizes(case, effect) for effect in case.effects]


def _sizes(case: Case, effect: Effect) -> tuple[float, float, float]:
    rest = [e for e in case.effects if e is not effect]
    nonlinear = effect.law is not None
    sigma = 4.0 * case.clock.rate / case.clock.samples if nonlinear else 0.0
    s = sigma + 2j * np.pi * lines_of(case)
    poses, changed, plain = [], 0.0, 0.0
    for pose, q in enumerate(case.poses):
        before = system_of(case.truth, rest, q)
        h = before.frf(s)[:, :3, :3]
        sets, difference = _observed(case, effect, pose, before, s, sigma)
        changed, plain = changed + np.sum(np.abs(difference) ** 2), plain + np.sum(np.abs(h) ** 2)
        poses.append(Pose(before, _moved(case, rest, q, s, h), sets))
    length = case.clock.samples / case.clock.rate
    stride = max(1, round(float(np.diff(s.imag)[0]) / (2 * np.pi) * length))
    starts = _starts(case, rest, poses)
    return float(np.sqrt(changed / plain)), *nats_of(poses, case.robot, s, 1 / stride, starts)


def _starts(case: Case, rest: list[Effect], poses: list[Pose]) -> list[np.ndarray]:
    """The robot as it is without the effect, and with gears as stiff as with it on average."""
    middle = case.warmth(len(case.hits) / 2)
    with_it = [system_of(case.truth, case.effects, q, middle) for q in case.poses]
    moves = [gear_moves(p.system, w, case.robot) for p, w in zip(poses, with_it, strict=True)]
    mean = np.mean(moves, axis=0)
    return [0 * mean, mean] if mean.any() else [mean]


def _moved(
    case: Case, rest: list[Effect], q: np.ndarray, s: np.ndarray, h: np.ndarray
) -> np.ndarray:
    """Change of the FRFs by the readback's sd of each joint."""
    return np.array([
        system_of(case.truth, rest, q + READBACK_SD * unit).frf(s)[:, :3, :3] - h
        for unit in np.eye(len(q))
    ])  # fmt: skip


def _observed(
    case: Case, effect: Effect, pose: int, before: System, s: np.ndarray, sigma: float
) -> tuple[list[Observed], np.ndarray]:
    """What is seen at a pose, set by set, and the difference that counts as the change."""
    mine = [i for i, h in enumerate(case.hits) if h.pose == pose]
    variance = _variances(case, mine)
    if effect.law is None:
        after = _after(case, effect, pose, before, s)
        seen = Observed(after, _mean_variance(case, mine, variance), _counts(case, mine))
        return [seen], after - before.frf(s)[:, :3, :3]
    peaks = np.array([case.hits[i].peak for i in mine])
    middle = np.sqrt(peaks.min() * peaks.max()) if peaks.max() > 1.4 * peaks.min() else 0.0
    sets, residuals, h = [], [], before.frf(s)[:, :3, :3]
    for strong in (False, True):
        some = [i for i, p in zip(mine, peaks, strict=True) if (p >= middle) == strong]
        if not some:
            continue
        residual = _excess(case, some, s, sigma)
        residuals.append(residual)
        sets.append(
            Observed(h + residual, _mean_variance(case, some, variance), _counts(case, some))
        )
    return sets, residuals[-1] - residuals[0] if len(residuals) == 2 else 0 * residuals[0]


def _after(case: Case, effect: Effect, pose: int, before: System, s: np.ndarray) -> np.ndarray:
    """FRFs (lines, 3, 3) as the chain shows them with an effect, per nominal hit."""
    if effect.chain:
        window = effect.chain.get("window")
        length = case.clock.samples / case.clock.rate - case.clock.trigger
        faster = -np.log(window["end"]) / length if window else 0.0
        h = before.frf(s + faster)[:, :3, :3]
        h = effect.chain.get("matrix", np.eye(3)) @ h
        return h * np.exp(-s * effect.chain.get("delay", 0.0))[:, None, None]
    warm = np.mean([case.warmth(h.order) for h in case.of_pose(pose)])
    return system_of(case.truth, case.effects, case.poses[pose], float(warm)).frf(s)[:, :3, :3]


def _excess(case: Case, some: list[int], s: np.ndarray, sigma: float) -> np.ndarray:
    """Averaged FRFs (lines, 3, 3) of nonlinear hits less those of the same hits without the law."""
    total = np.zeros((len(s), 3, 3), complex)
    counts = np.maximum(_counts(case, some), 1)
    for i in some:
        force = _transform(case, case.motions[i].force, s, sigma)
        extra = _difference(case.motions[i], case.linear[i])
        hit = case.hits[i]
        total[:, :, hit.axis] += (
            hit.sign * (_transform(case, extra, s, sigma) / force).T / counts[hit.axis]
        )
    return total


def _difference(one: Motion, other: Motion) -> np.ndarray:
    return one.motion[:3] - other.motion[:3]


def _transform(case: Case, signal: np.ndarray, s: np.ndarray, sigma: float) -> np.ndarray:
    """Transform of samples (…, n) at lines s, which are lines of the record moved by sigma."""
    t = np.arange(case.clock.samples) / case.clock.rate
    lines = np.round(s.imag / (2 * np.pi) * case.clock.samples / case.clock.rate).astype(int)
    return np.fft.rfft(signal * np.exp(-sigma * t), axis=-1)[..., lines]


def _variances(case: Case, mine: list[int]) -> dict[int, np.ndarray]:
    """Variance (3, lines) of each hit's FRF: the case's noise over the hit's force."""
    s = 2j * np.pi * lines_of(case)
    power = np.mean([np.abs(_transform(case, n, s, 0.0)) ** 2 for n in case.noises], axis=0)
    return {i: power / np.abs(_transform(case, case.motions[i].force, s, 0.0)) ** 2 for i in mine}


def _mean_variance(case: Case, some: list[int], variance: dict[int, np.ndarray]) -> np.ndarray:
    """Variance (lines, 3, 3) of the axis-wise average of some hits."""
    total = np.zeros((*next(iter(variance.values())).T.shape, 3))
    counts = np.maximum(_counts(case, some), 1)
    for i in some:
        axis = case.hits[i].axis
        total[:, :, axis] += variance[i].T / counts[axis] ** 2
    return total + 1e-30


def _counts(case: Case, some: list[int]) -> np.ndarray:
    """Hits by axis."""
    return np.bincount([case.hits[i].axis for i in some], minlength=3)
