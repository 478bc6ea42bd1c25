"""What is left of a concealed effect once the best robot without it is fitted, by any engine.

An engine says what a robot without the effect is at each pose (`Snapshot`) and what is seen with
the effect (`Observed`). The robot is refitted, nonlinearly, within twice its tolerances: springs,
dampers, loss factors, inertias, those of imperfections and of other effects alike; sensor's gains,
cross-axis, place, delay and the force's gain; and at each pose misses of hits, and readback.

    chi2 = |r - D x|² + |x|², in units of noise and of an error of |H|, x in tolerances (1 sd)

with |H| that of all nine FRFs at a line together. The error comes down in stages, so that far
modes are found.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from planner.proof.mechanics import cross_matrix

SPRING_SD, STATED_SD, DAMPING_SD, LOSS_SD = 0.5, 0.25, 0.5, 0.02
MASS_SD, CENTRE_SD, SECOND_SD = 0.06, 0.01, 0.08  # the centre's in units of the robot's reach
GAIN_SD, CROSS_SD, FORCE_SD, PLACE_M, DELAY_S = 0.02, 0.04, 0.02, 0.006, 6e-5
TILT_RAD, OFFSET_M, READBACK_RAD = np.radians(2.0), 0.005, np.radians(0.07)
CHAIN = 14  # numbers of the chain
WITHIN = 2.0  # tolerances: what lies beyond is no longer a robot as stated
FAR_OFF = (-0.8, -0.4, 0.4, 0.8)  # of what is within tolerance, where one spring's fit begins
STAGES = (0.5, 0.2, 0.07, 0.02, 0.01, 0.003)  # of |H|; at the last what imperfections come to
STEPS, LONGEST = 12, 1.5  # at most at each stage; tolerances a step
STEADY = 0.003  # a step that lowers chi2 by a smaller share is the last one of its stage
DAMPING, LEAST_DAMPING, GIVEN_UP = 1e-2, 1e-6, 1e4  # of Gauss-Newton's steps
RATES = 2 * np.pi * np.geomspace(0.5, 600.0, 6)  # 1/s, branches of which an even loss is made


@dataclass(frozen=True, eq=False)
class Spring:
    """A spring that can be moved: row (n,), law without damper (F,), damper, k, sd of ln k."""

    row: np.ndarray
    elastic: np.ndarray
    damping: float
    stiffness: float
    sd: float = SPRING_SD

    def changes(self, s: np.ndarray, moves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Change (F,) of the law by moves (3,) of stiffness, damper, loss; its slopes (3, F)."""
        stiff = np.exp(self.sd * moves[0]) * self.elastic
        taken = self.damping + abs(float(np.mean((self.elastic / s.imag).imag)))
        viscous = np.exp(DAMPING_SD * moves[1]) * taken * s
        loss = LOSS_SD * self.stiffness * _even_loss(s)
        change = stiff - self.elastic + viscous - taken * s + moves[2] * loss
        return change, np.array([self.sd * stiff, DAMPING_SD * viscous, loss])


def _even_loss(s: np.ndarray) -> np.ndarray:
    """Causal (F,), its imaginary part nearly 1 over all lines, its real part 0 at 20 Hz."""
    gain, middle = 2 * np.log(RATES[1] / RATES[0]) / np.pi, 2j * np.pi * 20.0
    ladder = gain * np.sum(s[:, None] / (s[:, None] + RATES), axis=1)
    return ladder - gain * float(np.sum(middle / (middle + RATES)).real)


@dataclass(frozen=True)
class Body:
    """Of a link in its frame: kg, m, and second moment (3, 3) about the centre in kg·m²."""

    mass: float
    centre: np.ndarray
    second: np.ndarray

    def changes(self, reach_m: float) -> list[np.ndarray]:
        """Of the spatial inertia (6, 6) about the frame by a tolerance of each of ten numbers."""
        m, c, inner = self.mass, self.centre, self.second
        out = [MASS_SD * _spatial(m, m * c, inner + m * np.outer(c, c))]
        for unit in np.eye(3) * CENTRE_SD * reach_m:
            out.append(_spatial(0.0, m * unit, m * (np.outer(c, unit) + np.outer(unit, c))))
        for i, j in zip(*np.triu_indices(3), strict=True):
            change = np.zeros((3, 3))
            change[i, j] = change[j, i] = SECOND_SD * np.sqrt(inner[i, i] * inner[j, j])
            out.append(_spatial(0.0, np.zeros(3), change))
        return out


def _spatial(mass: float, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    c = cross_matrix(first)
    inertia = np.trace(second) * np.eye(3) - second
    return np.block([[mass * np.eye(3), -c], [c, inertia]])


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A robot at a pose: Z (F, n, n), springs, what wrenches at the tcp load (n, 6), sensors.

    `sense` (6, n): accelerations of the sensor, linear first, in its axes; `parts`: Jacobians
    (6, n) of links' frames in their axes.
    """

    z: np.ndarray
    springs: Sequence[Spring]
    load: np.ndarray
    sense: np.ndarray
    parts: Mapping[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Observed:
    """Averaged FRFs of one set of hits and their noise's variance (F, 3, 3); hits by axis (3,)."""

    frf: np.ndarray
    variance: np.ndarray
    hits: np.ndarray


@dataclass(frozen=True, eq=False)
class Pose:
    """A measured pose; `readback` (joints, F, 3, 3): changes of the FRFs by READBACK_RAD each."""

    robot: Snapshot
    readback: np.ndarray
    sets: Sequence[Observed]


@dataclass(frozen=True, eq=False)
class DetectionProblem:
    """What tells of one effect: lines s (F,) in 1/s, of which `share` of a record's are these.

    `aside`: poses that were not measured, with the true FRFs (F, 3, 3); none where an effect shows
    only in levels or in time, which is judged at the measured poses.
    """

    s: np.ndarray
    poses: Sequence[Pose]
    aside: Sequence[tuple[Snapshot, np.ndarray]]
    bodies: Mapping[str, Body]
    reach_m: float
    share: float


@dataclass(frozen=True)
class Detectability:
    """`nats`: how much the recordings tell of what is left; `size`: of it at poses set aside.

    Relative to |H|, of the stage that foretells these best: a refit can also take up too much.
    `change` is that without any refit.
    """

    nats: float
    size: float
    change: float


def detectability(question: DetectionProblem) -> Detectability:
    """Of an effect by the best robot without it."""
    first = question.poses[0].robot
    inertia = [(n, c) for n, b in question.bodies.items() for c in b.changes(question.reach_m)]
    moves = _begun(question, inertia, np.zeros(3 * len(first.springs) + len(inertia)))
    chi2, sizes = np.inf, [_size(question, inertia, 0 * moves, np.zeros(CHAIN))]
    for error in STAGES:
        moves, found = _descended(partial(_sums, question, inertia, error=error), moves)
        chi2 = found.chi2 - float(moves @ moves)
        chain = np.clip(found.chain, -WITHIN, WITHIN)
        sizes.append(_size(question, inertia, moves, chain))
    return Detectability(max(0.0, chi2) / 2, min(sizes), sizes[0])


def _begun(question: DetectionProblem, inertia: list, moves: np.ndarray) -> np.ndarray:
    """Moves, or with one stated spring far off: small steps don't find that past resonances."""
    springs = question.poses[0].robot.springs
    stated = [3 * i for i, spring in enumerate(springs) if spring.sd == STATED_SD]
    far = np.eye(len(moves))[stated]
    tried = [moves, *(moves + WITHIN * share * one for share in FAR_OFF for one in far)]
    return min(tried, key=lambda m: _size(question, inertia, m, np.zeros(CHAIN)))


def _size(question: DetectionProblem, inertia: list, moves: np.ndarray, chain: np.ndarray) -> float:
    """‖Δ‖/‖H‖ at poses set aside, hits and readback as they should be."""
    pairs = list(question.aside) or [(p.robot, o.frf) for p in question.poses for o in p.sets]
    off = whole = 0.0
    for robot, seen in pairs:
        frf = _moved(robot, question.s, inertia, moves)[1]
        shown = frf[:, :3, :3] + np.tensordot(chain, _chain_columns(frf, question.s), 1)
        off += float(np.sum(np.abs(seen - shown) ** 2))
        whole += float(np.sum(np.abs(seen) ** 2))
    return float(np.sqrt(off / whole))


def _moved(
    robot: Snapshot, s: np.ndarray, inertia: list, moves: np.ndarray, slopes: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """FRF changes (moves, F, 3, 3) by each move, if asked for, and FRFs (F, 6, 6) at `moves`."""
    z, count = robot.z.copy(), 3 * len(robot.springs)
    laws = [spring.changes(s, m) for spring, m in
            zip(robot.springs, moves[:count].reshape(-1, 3), strict=True)]  # fmt: skip
    rows = np.array([spring.row for spring in robot.springs])
    z += np.einsum("kf,ka,kb->fab", np.array([c for c, _ in laws]), rows, rows, optimize=True)
    mass = sum(v * robot.parts[link].T @ change @ robot.parts[link]
               for v, (link, change) in zip(moves[count:], inertia, strict=True))  # fmt: skip
    s2 = (s**2)[:, None, None]
    z += s2 * mass
    right = np.linalg.solve(z, robot.load[None].astype(complex))
    frf = s2 * (robot.sense @ right)
    if not slopes:
        return np.empty(0), frf
    felt = np.linalg.solve(np.swapaxes(z, 1, 2), robot.sense[:3].T[None].astype(complex))
    felt, right = np.swapaxes(felt, 1, 2), right[..., :3]
    found = []
    for spring, (_, by) in zip(robot.springs, laws, strict=True):
        both = (felt @ spring.row)[:, :, None] * (spring.row @ right)[:, None]
        found += [-s2 * change[:, None, None] * both for change in by]
    parts = {name: (felt @ part.T, part @ right) for name, part in robot.parts.items()}
    for link, change in inertia:
        found.append(-(s2**2) * (parts[link][0] @ change @ parts[link][1]))
    return np.array(found), frf


def _chain_columns(frf: np.ndarray, s: np.ndarray) -> np.ndarray:
    """(CHAIN, F, 3, 3): gains and cross-axis (9), sensor's place (3), force's gain, delay."""
    h, found = frf[:, :3, :3], []
    for i, j in np.ndindex(3, 3):
        unit = np.zeros((3, 3))
        unit[i, j] = GAIN_SD if i == j else CROSS_SD
        found.append(unit @ h)
    found += [PLACE_M * cross_matrix(unit) @ frf[:, 3:, :3] for unit in np.eye(3)]
    return np.array([*found, FORCE_SD * h, -DELAY_S * s[:, None, None] * h])


def _misses(frf: np.ndarray, hits: np.ndarray) -> np.ndarray:
    """(12, F, 3, 3): direction and place of the hits' average, half of it shared, by axis."""
    found = []
    for axis in range(3):
        sd = np.sqrt(1 / hits[axis] + 0.25) if hits[axis] else 0.0
        for lateral in np.delete(np.arange(3), axis):
            lever = np.cross(np.eye(3)[lateral], np.eye(3)[axis])
            for change in (TILT_RAD * frf[:, :3, lateral], OFFSET_M * frf[:, :3, 3:] @ lever):
                column = np.zeros((len(frf), 3, 3), complex)
                column[:, :, axis] = sd * change
                found.append(column)
    return np.array(found)


def _real(values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(…, rows): real and imaginary parts, each of variance 1 where it is noise."""
    flat = (values * weight).reshape(*values.shape[:-3], -1) * np.sqrt(2)
    return np.concatenate([flat.real, flat.imag], axis=-1)


@dataclass(frozen=True, eq=False)
class _Sums:
    """Normal equations over moves with the chain at its best, and chi2 there."""

    square: np.ndarray
    vector: np.ndarray
    chain: np.ndarray
    chi2: float


def _sums(question: DetectionProblem, inertia: list, moves: np.ndarray, error: float) -> _Sums:
    parts = [_at_pose(pose, question, inertia, moves, error) for pose in question.poses]
    square, vector, plain = (np.sum(np.array(of), axis=0) for of in zip(*parts, strict=True))
    n = len(moves)
    inner = np.eye(len(vector) - n) + square[n:, n:]
    chain = np.linalg.solve(inner, vector[n:])
    across = np.linalg.solve(inner, square[n:, :n])
    return _Sums(
        square[:n, :n] - square[:n, n:] @ across,
        vector[:n] - square[:n, n:] @ chain,
        chain,
        float(plain - vector[n:] @ chain + moves @ moves),
    )


def _at_pose(
    pose: Pose, question: DetectionProblem, inertia: list, moves: np.ndarray, error: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Normal equations of a pose over moves and chain; its hits and readback are eliminated."""
    shared, frf = _moved(pose.robot, question.s, inertia, moves, slopes=True)
    shared = np.concatenate([shared, _chain_columns(frf, question.s)])
    rows, local, residual = [], [], []
    for number, seen in enumerate(pose.sets):
        size2 = np.mean(np.abs(seen.frf) ** 2, axis=(1, 2), keepdims=True)
        variance = question.share * (seen.variance + error**2 * size2)
        weight = np.where(seen.hits > 0, 1 / np.sqrt(variance), 0.0)
        misses = _real(_misses(frf, seen.hits), weight)
        blocks = [misses if i == number else 0 * misses for i in range(len(pose.sets))]
        rows.append(_real(shared, weight))
        local.append(np.concatenate([*blocks, _real(pose.readback, weight)]))
        residual.append(_real(seen.frf - frf[:, :3, :3], weight))
    d, own, r = np.hstack(rows), np.hstack(local), np.concatenate(residual)
    inner = np.linalg.cholesky(np.eye(len(own)) + own @ own.T)
    cross, short = np.linalg.solve(inner, own @ d.T), np.linalg.solve(inner, own @ r)
    return d @ d.T - cross.T @ cross, d @ r - cross.T @ short, float(r @ r - short @ short)


def _descended(of: Callable[[np.ndarray], _Sums], moves: np.ndarray) -> tuple[np.ndarray, _Sums]:
    """Moves within tolerance after damped steps that each lower chi2."""
    best, damping = of(moves), DAMPING
    for _ in range(STEPS):
        before = best.chi2
        while damping < GIVEN_UP:
            there = _step(best, moves, damping)
            found = of(there)
            if found.chi2 < best.chi2:
                moves, best, damping = there, found, max(damping / 5, LEAST_DAMPING)
                break
            damping *= 6
        if best.chi2 > (1 - STEADY) * before:
            break
    return moves, best


def _step(sums: _Sums, moves: np.ndarray, damping: float) -> np.ndarray:
    """A damped Gauss-Newton step; what a bound holds and wants to go on beyond stays there."""
    downhill = sums.vector - moves
    free = ~((np.abs(moves) >= WITHIN) & (np.sign(downhill) == np.sign(moves)))
    curved = np.eye(len(moves)) + sums.square
    curved[np.diag_indices_from(curved)] *= 1 + damping
    step = np.zeros(len(moves))
    step[free] = np.linalg.solve(curved[np.ix_(free, free)], downhill[free])
    step *= min(1.0, LONGEST / max(float(np.max(np.abs(step))), 1e-12))
    return np.clip(moves + step, -WITHIN, WITHIN)
