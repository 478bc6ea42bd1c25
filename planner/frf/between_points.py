"""FRFs estimated from hits of points of no robot, as an analyser would have exported them."""

from pathlib import Path

import numpy as np

from planner.frf.frf import Frf
from planner.recording.points import SENSOR, TCP, UNTOLD
from planner.recording.records import FrfRecord


def exported(frf: Frf, source: Path, simulated: bool) -> FrfRecord:
    """Every FRF of the matrix with its nodes ("" where files state none) and directions.

    Directions are 1, 2, 3 for x, y, z, and 0 where files state none.
    """
    entries = np.argwhere(np.isfinite(frf.accelerance).all(axis=-1))
    response = [_place(frf.layout.sensors, int(row), SENSOR) for row, _ in entries]
    reference = [_place(frf.layout.hits, int(column), TCP) for _, column in entries]
    rows, columns = entries.T
    return FrfRecord(
        source,
        frf.frequency_hz,
        frf.accelerance[rows, columns],
        tuple(direction for _, direction in response),
        tuple(direction for _, direction in reference),
        "accelerance",
        "m/s^2/N",
        frf.coherence[rows, columns],
        frf.remarks,
        simulated,
        tuple(node for node, _ in response),
        tuple(node for node, _ in reference),
    )


def _place(points: tuple[str, ...], at: int, unnamed: str) -> tuple[str, int]:
    """Node and direction of a row or column."""
    name, direction = points[at // 3], at % 3 + 1
    if name.endswith(UNTOLD):
        name, direction = name.removesuffix(UNTOLD), 0
    return "" if name == unnamed else name, direction
