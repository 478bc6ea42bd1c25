"""The hits of a case: planned pose by pose, and written as recordings."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.truth.fault_injection import HitVisit, InjectedFaults, windowed
from planner.truth.hits import AXES, Hammer, SimulatedHit, noisy, write_recordings
from planner.truth.measurement_errors import MeasurementErrors
from planner.truth.model import Truth

LEVELS = (0.4, 1.0, 2.5)  # of the middling peak force
TWICE = 0.5  # how often the first pose is hit again at the end


@dataclass(frozen=True, eq=False)
class Visits:
    """What is done, and what recordings.csv says of it: pose's number and angles (dof,) in °."""

    visits: Sequence[HitVisit]
    poses: Sequence[int]
    readbacks_deg: Sequence[np.ndarray]

    @classmethod
    def planned(
        cls,
        poses: np.ndarray,
        hammer: Hammer,
        errors: MeasurementErrors,
        rng: np.random.Generator,
        own: np.random.Generator,
    ) -> "Visits":
        """Three axes and three force levels at each pose (n, dof) in rad.

        `own` draws what `errors` leaves open, so that all else is the same in the laboratory.
        """
        numbers = list(range(len(poses))) + ([0] if rng.random() < TWICE else [])
        shots = [(f"{rng.choice(['+', '-'])}{a}", hammer.peak_n * k) for a in "xyz" for k in LEVELS]
        planned, readbacks = [], []
        common, axes = errors.common(own), [AXES.index(axis[1]) for axis, _ in shots]
        for number, index in enumerate(numbers):
            scatter = hammer.readback_deg * rng.uniform(-1, 1, len(poses[index]))
            readbacks.append(np.round(np.rad2deg(poses[index]) + scatter, 4))
            off = np.deg2rad(errors.readback_deg) * own.standard_normal(len(poses[index]))
            aims = errors.aims(axes, own, common)
            there = np.deg2rad(readbacks[-1]) + off
            planned.append(HitVisit(there, shots, number / max(len(numbers) - 1, 1), aims))
        return cls(planned, numbers, readbacks)


def record(
    folder: Path,
    truth: Truth,
    injected: InjectedFaults,
    visits: Visits,
    quiet: Sequence[Sequence[SimulatedHit]],
    hammer: Hammer,
    rng: np.random.Generator,
) -> None:
    """Write the hits `quiet` of all visits, with noise and with the window left on them."""
    rows = []
    counts: dict[tuple[int, str], int] = {}
    for index, readback, hits in zip(visits.poses, visits.readbacks_deg, quiet, strict=True):
        for hit in hits:
            heard = windowed(injected.artefact, noisy(hit, hammer, rng), hammer)
            repeat = counts[index, hit.axis] = counts.get((index, hit.axis), 0) + 1
            rows.append((f"P{index + 1:02d}", readback, repeat, heard))
    write_recordings(folder, truth.joint_names, rows, hammer, "concealed case")
