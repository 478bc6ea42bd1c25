"""FRFs that an analyser exported, as the FRF matrix of a pose."""

import numpy as np

from planner.errors import RefusedError
from planner.frf.frf import Frf
from planner.frf.quantities import convert
from planner.recording.records import AXES, FrfRecord


def from_records(records: tuple[FrfRecord, ...], window_rate_1_s: float = 0.0) -> Frf:
    """FRF matrix from exported FRFs. Raises RefusedError where they do not make one.

    `window_rate_1_s` is that of an exponential window that the analyser laid over the records.
    """
    first = records[0]
    frequency = np.asarray(first.frequency_hz, dtype=float)
    keep = frequency > 0
    shape = (3, 3, int(keep.sum()))
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
        for k, (i, j) in enumerate(
            zip(record.response_direction, record.reference_direction, strict=True)
        ):
            if not (1 <= abs(i) <= 3 and 1 <= abs(j) <= 3):
                raise RefusedError(
                    f"{record.source}: FRF {k + 1} does not state its directions; label them."
                )
            at = abs(i) - 1, abs(j) - 1
            h[at] = np.sign(i) * np.sign(j) * values[k][keep]
            coherence[at] = record.coherence[k][keep]
    measured = [bool(np.all(np.isfinite(h[:, j]))) for j in range(3)]
    if not any(measured):
        raise RefusedError(
            f"{first.source}: no hit axis has all three responses "
            f"({', '.join(AXES)}); export them together."
        )
    for j in range(3):
        if not measured[j]:
            h[:, j] = np.nan
    counts = tuple(int(m) for m in measured)
    unknown = np.full(shape, np.nan)
    band = float(frequency[keep][0]), float(frequency[keep][-1])
    hits = counts[0], counts[1], counts[2]
    return Frf(frequency[keep], h, unknown, coherence, hits, band, window_rate_1_s)
