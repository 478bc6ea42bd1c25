"""FRFs that an analyser exported, as the FRF matrix of a pose."""

from pathlib import Path

import numpy as np

from planner.errors import RefusedError
from planner.frf.frf import Frf
from planner.frf.labelled import LabelledFrf, labelled_frfs
from planner.recording.points import SENSOR, TCP, TOOL, UNTOLD, Layout
from planner.recording.records import AXES, FrfRecord


def from_records(records: tuple[FrfRecord, ...], window_rate_1_s: float = 0.0) -> Frf:
    """FRF matrix from exported FRFs. Raises RefusedError where they do not make one.

    `window_rate_1_s` is that of an exponential window that the analyser laid over the records.
    """
    first = records[0]
    frequency, frfs = labelled_frfs(records, "accelerance", RefusedError)
    layout = _layout(frfs)
    shape = (*layout.shape, len(frequency))
    h, coherence = np.full(shape, np.nan + 0j), np.full(shape, np.nan)
    for one in frfs:
        row, column = layout.sensors.index(_sensor(one)), layout.hits.index(_hit_point(one))
        at = 3 * row + one.felt[1], 3 * column + one.hit[1]
        h[at], coherence[at] = one.values, one.coherence
    given = np.array([[bool(np.isfinite(one).all()) for one in row] for row in h])
    measured = np.array([c.all() if layout == TOOL else c.any() for c in given.T])
    if not measured.any():
        raise RefusedError(
            f"{first.source}: no hit axis has all three responses "
            f"({', '.join(AXES)}); export them together."
        )
    h[:, ~measured] = np.nan
    hits = tuple(int(m) for m in measured)
    unknown = np.full(shape, np.nan)
    band = float(frequency[0]), float(frequency[-1])
    return Frf(frequency, h, unknown, coherence, hits, band, window_rate_1_s, layout=layout)


def _sensor(one: LabelledFrf) -> str:
    return one.felt[0] or SENSOR


def _hit_point(one: LabelledFrf) -> str:
    return one.hit[0] or TCP


def _layout(frfs: list[LabelledFrf]) -> Layout:
    hits, sensors = dict.fromkeys(map(_hit_point, frfs)), dict.fromkeys(map(_sensor, frfs))
    return Layout(tuple(hits), tuple(sensors))


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
