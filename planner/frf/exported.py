"""FRFs that an analyser exported, as the FRF matrix of a pose."""

import numpy as np

from planner.errors import RefusedError
from planner.frf.frf import Frf
from planner.frf.quantities import convert
from planner.recording.points import SENSOR, TCP, TOOL, Layout
from planner.recording.records import AXES, FrfRecord


def from_records(records: tuple[FrfRecord, ...], window_rate_1_s: float = 0.0) -> Frf:
    """FRF matrix from exported FRFs. Raises RefusedError where they do not make one.

    `window_rate_1_s` is that of an exponential window that the analyser laid over the records.
    """
    first = records[0]
    frequency = np.asarray(first.frequency_hz, dtype=float)
    keep, layout = frequency > 0, _layout(records)
    shape = (*layout.shape, int(keep.sum()))
    h, coherence = np.full(shape, np.nan + 0j), np.full(shape, np.nan)
    for record in records:
        if record.quantity == "unknown" or not record.unit:
            raise RefusedError(
                f"{record.source}: it is not stated whether these FRFs are accelerance, mobility "
                f"or receptance, and in which unit; label them."
            )
        if len(record.frequency_hz) != len(frequency) or not np.allclose(
            record.frequency_hz, frequency
        ):
            raise RefusedError(f"{record.source} has other frequency lines; export one grid.")
        values = convert(frequency, record.values, record.quantity, "accelerance")
        for k, (sensor, hit_point, i, j) in enumerate(_places(record)):
            if not (1 <= abs(i) <= 3 and 1 <= abs(j) <= 3):
                raise RefusedError(
                    f"{record.source}: FRF {k + 1} does not state its directions; label them."
                )
            row, column = layout.sensors.index(sensor), layout.hits.index(hit_point)
            at = 3 * row + abs(i) - 1, 3 * column + abs(j) - 1
            h[at] = np.sign(i) * np.sign(j) * values[k][keep]
            coherence[at] = record.coherence[k][keep]
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
    band = float(frequency[keep][0]), float(frequency[keep][-1])
    return Frf(frequency[keep], h, unknown, coherence, hits, band, window_rate_1_s, layout=layout)


def _places(record: FrfRecord) -> list[tuple[str, str, int, int]]:
    """Sensor, hit point and their directions of each FRF."""
    count = len(record.values)
    return list(
        zip(
            record.response_node or (SENSOR,) * count,
            record.reference_node or (TCP,) * count,
            record.response_direction,
            record.reference_direction,
            strict=True,
        )
    )


def _layout(records: tuple[FrfRecord, ...]) -> Layout:
    places = [place for record in records for place in _places(record)]
    hits, sensors = dict.fromkeys(p[1] for p in places), dict.fromkeys(p[0] for p in places)
    return Layout(tuple(hits), tuple(sensors))
