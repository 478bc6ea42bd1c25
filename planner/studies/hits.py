"""Hits as a careful hand makes them, at many poses of a true robot: to FRFs and modes, in memory.

Three axes, three force levels each; hits miss axis and point, the chain is within its tolerances,
joints stand beside their readback, the floor rumbles
(`planner.proof.measurement_errors.EVERYDAY`). Joints rub, so that damping depends on the force,
and their damping is another one at every visit.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.dataset.dataset import Dataset
from planner.dataset.visits import Visit
from planner.errors import InputError, RefusedError
from planner.frf.estimator import estimate
from planner.frf.frf import Frf
from planner.modal.estimate_modes import estimate_modes
from planner.modal.modes import Mode
from planner.progress import ProgressCallback
from planner.proof import inverse
from planner.proof.cases import planned
from planner.proof.fault_injection import DampingScatter, HitVisit, InjectedFaults, quiet_hits
from planner.proof.hits import Hammer, SimulatedHit, noisy
from planner.proof.laws import BoucWen
from planner.proof.measurement_errors import EVERYDAY
from planner.proof.model import Truth
from planner.proof.nonlinear import Port
from planner.recording.records import Hit

AT_ONCE = 12  # poses that are integrated together: what memory holds
# Chosen: friction's stiffness over a joint's own, the angle (rad) at which it slides, and the
# log-sd of damping from visit to visit. Damping ratios of robots scatter by some ten percent
# between visits and levels.
FRICTION, SLIDING_RAD, BRAKES = 0.06, 4e-6, 0.35


@dataclass(frozen=True, eq=False)
class HitPoses:
    """Readback angles q (n, dof) in rad; the FRF matrix and the hits of each pose."""

    q: np.ndarray
    frfs: tuple[Frf, ...]
    hits: tuple[tuple[Hit, ...], ...]

    def dataset(self, band_hz: tuple[float, float], which: np.ndarray | None = None) -> Dataset:
        """All hits, or those of some poses, as identification and diagnosis want them."""
        rows = np.arange(len(self.q)) if which is None else which
        visits = [
            Visit(f"P{i + 1:03d}", self.q[i], k / max(len(rows) - 1, 1), self.hits[i])
            for k, i in enumerate(rows.tolist())
        ]
        return Dataset.of_visits(visits, band_hz)

    def modes(
        self, band_hz: tuple[float, float], progress: ProgressCallback
    ) -> tuple[list[tuple[Mode, ...]], list[tuple[Mode, ...]]]:
        """Modes of every pose by modal analysis, and doubtful ones; none where it finds none."""
        found: list[tuple[Mode, ...]] = []
        doubtful: list[tuple[Mode, ...]] = []
        for i, frf in enumerate(self.frfs):
            progress(f"modal analysis of pose {i + 1} of {len(self.frfs)}", i / len(self.frfs))
            try:
                model = estimate_modes(frf, band_hz)
            except RefusedError:
                model = None
            found.append(model.modes if model else ())
            doubtful.append(model.doubtful if model else ())
        return found, doubtful


def upright_poses(
    truth: Truth, targets: Iterable[tuple[np.ndarray, float]], start_rad: np.ndarray, what: str,
    upper_rad: np.ndarray | None = None, follow: bool = True,
) -> np.ndarray:  # fmt: skip
    """Joint angles (n, dof) in rad, the tool downwards at places (3,) in m, turned by so many rad.

    Each is looked for from the one before, or (`follow` False) from the start. InputError if the
    robot cannot stand somewhere: `what` should be moved.
    """
    q: list[np.ndarray] = []
    for place, turn in targets:
        rotation = inverse.tool_rotation(np.array([0.0, 0.0, -1.0]), turn)
        near = q[-1] if q and follow else start_rad
        found = inverse.joint_angles(truth, rotation, place, near, upper_rad=upper_rad)
        if found is None:
            raise InputError(f"{truth.name} cannot reach {place} m; move {what}.")
        q.append(found)
    return np.array(q)


def everyday_faults(truth: Truth, seed: int, ports: tuple[Port, ...] = ()) -> InjectedFaults:
    """What is not as in the books: friction, damping that scatters, a chain within tolerance.

    Friction is in the first three joints: it gives stiffness at rest, and takes energy. `ports`
    are further laws of joints.
    """
    shares = ((joint, FRICTION * truth.stiffness(joint)) for joint in truth.joint_names[:3])
    friction = (Port(BoucWen(k, k * SLIDING_RAD), joint=joint) for joint, k in shares)
    chain = EVERYDAY.chain(np.random.default_rng([seed, 3]))
    drift = DampingScatter(BRAKES, seed)
    return InjectedFaults(truth.deviation, (*friction, *ports), drift=drift, chain=chain)


def simulate_hits(
    truth: Truth,
    injected: InjectedFaults,
    q: np.ndarray,
    hammer: Hammer,
    band_hz: tuple[float, float],
    seed: int,
    progress: ProgressCallback,
    axes: str = "xyz",
) -> HitPoses:
    """Hit a robot at poses q (n, dof) in rad, each once visited, along `axes` at three levels."""
    rng, own = np.random.default_rng([seed, 4]), np.random.default_rng([seed, 5])
    stops = planned(q, hammer, EVERYDAY, rng, own)[: len(q)]  # the first pose is not visited again
    visits = [_along(visit, axes) for *_, visit in stops]
    readback = np.deg2rad([readback_deg for _, readback_deg, _ in stops])
    floor: Hammer | None = None
    hits: list[tuple[Hit, ...]] = []
    for first in range(0, len(q), AT_ONCE):
        progress(f"hits at pose {first + 1} of {len(q)}", first / len(q))
        quiet = quiet_hits(truth, injected, visits[first : first + AT_ONCE], hammer, rng)
        if floor is None:
            floor = EVERYDAY.floor(hammer, [hit for hits in quiet for hit in hits], own)
        hits += [as_read([noisy(h, floor, rng) for h in each], hammer) for each in quiet]
    frfs = tuple(estimate(each, band_hz) for each in hits)
    return HitPoses(readback, frfs, tuple(hits))


def _along(visit: HitVisit, axes: str) -> HitVisit:
    """The visit with the hits along these axes only."""
    kept = [i for i, (axis, _) in enumerate(visit.shots) if axis[1] in axes]
    shots, aims = [visit.shots[i] for i in kept], [visit.aims[i] for i in kept]
    return replace(visit, shots=shots, aims=aims)


def as_read(hits: Sequence[SimulatedHit], hammer: Hammer) -> tuple[Hit, ...]:
    """Hits as the program would read them from files."""
    rate, source = hammer.sampling_rate_hz, Path("simulated")
    return tuple(
        Hit(source, h.axis, rate, h.force_n, h.acceleration_m_s2, simulated=True) for h in hits
    )
