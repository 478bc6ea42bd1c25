"""FRFs of files with their places: what is checked before any of them is used; a pose's matrix."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.errors import PlannerError, RefusedError
from planner.frf.frf import Frf
from planner.frf.quantities import convert
from planner.recording.points import SENSOR, TCP, TOOL, Layout
from planner.recording.records import AXES, FrfRecord

# Where an FRF was felt and hit, as nodes ("" where the format knows none) and axes (0, 1, 2), and
# its values and coherence (F,) along positive axes.
LabelledFrf = tuple[tuple[str, int], tuple[str, int], np.ndarray, np.ndarray]


def labelled_frfs(
    records: Sequence[FrfRecord],
    quantity: str,
    refusal: type[PlannerError],
    nodes: frozenset[str] | None = None,
) -> tuple[np.ndarray, list[LabelledFrf]]:
    """Lines (F,) above 0 Hz that all records share, and every FRF as `quantity` in SI units.

    Raises `refusal`, in one sentence, where units, lines or directions do not allow it. With
    `nodes`, FRFs between other nodes, or along no axis, are left out instead.
    """
    for record in records:
        if record.quantity == "unknown" or not record.unit:
            raise refusal(
                f"{record.source}: it is not stated whether these FRFs are accelerance, mobility "
                f"or receptance, and in which unit; label them."
            )
    frequency = common_lines(records, refusal)
    keep, found = frequency > 0, []
    for record in records:
        values = convert(frequency[keep], record.values[:, keep], record.quantity, quantity)
        for k, ((felt, i), (hit, j)) in enumerate(record.places):
            along_axes = 1 <= abs(i) <= 3 and 1 <= abs(j) <= 3
            if nodes is not None and not (along_axes and {felt, hit} <= nodes):
                continue
            if not along_axes:
                raise refusal(
                    f"{record.source}: FRF {k + 1} does not state its directions; label them."
                )
            turned = np.sign(i) * np.sign(j) * values[k]
            ends = (felt, abs(i) - 1), (hit, abs(j) - 1)
            found.append((*ends, turned, record.coherence[k][keep]))
    return frequency[keep], found


def common_lines(records: Sequence[FrfRecord], refusal: type[PlannerError]) -> np.ndarray:
    """The frequency lines that all records have; `refusal` where they differ."""
    first = records[0]
    lines = np.asarray(first.frequency_hz, float)
    for record in records[1:]:
        other = np.asarray(record.frequency_hz, float)
        # Relative, of one line in two files: headers state the spacing to five digits or so.
        if other.size != lines.size or not np.allclose(other, lines, rtol=1e-4, atol=1e-9):
            if record.source == first.source:
                raise refusal(f"{record.source} mixes frequency lines; export one grid.")
            raise refusal(
                f"{record.source} has other frequency lines than {first.source}; export one grid."
            )
    return lines


def joined(records: Sequence[FrfRecord]) -> FrfRecord:
    """FRFs of several files as if of the first. Raises RefusedError where they do not go together.

    For files that state no directions: what differs are rows.
    """
    first = records[0]
    common_lines(records, RefusedError)
    other = next((r for r in records if (r.quantity, r.unit) != (first.quantity, first.unit)), None)
    if other is not None:
        raise RefusedError(
            f"{other.source} holds FRFs of kind {other.quantity}, {first.source} of kind "
            f"{first.quantity}; name files of one kind."
        )
    return replace(
        first,
        values=np.concatenate([record.values for record in records]),
        coherence=np.concatenate([record.coherence for record in records]),
        remarks=tuple(dict.fromkeys(told for record in records for told in record.remarks)),
        simulated=any(record.simulated for record in records),
        places=tuple(place for record in records for place in record.places),
    )


def from_records(records: tuple[FrfRecord, ...], window_rate_1_s: float = 0.0) -> Frf:
    """FRF matrix from exported FRFs. Raises RefusedError where they do not make one.

    `window_rate_1_s` is that of an exponential window that the analyser laid over the records.
    """
    first = records[0]
    frequency, frfs = labelled_frfs(records, "accelerance", RefusedError)
    sensors = dict.fromkeys(node or SENSOR for (node, _), *_ in frfs)
    layout = Layout(tuple(dict.fromkeys(node or TCP for _, (node, _), *_ in frfs)), tuple(sensors))
    shape = (*layout.shape, len(frequency))
    h, coherence = np.full(shape, np.nan + 0j), np.full(shape, np.nan)
    for (felt, i), (hit, j), *held in frfs:
        row, column = layout.sensors.index(felt or SENSOR), layout.hits.index(hit or TCP)
        at = 3 * row + i, 3 * column + j
        h[at], coherence[at] = held
    given = np.isfinite(h).all(axis=-1)
    measured = given.all(axis=0) if layout == TOOL else given.any(axis=0)
    if not measured.any():
        raise RefusedError(
            f"{first.source}: no hit axis has all three responses "
            f"({', '.join(AXES)}); export them together."
        )
    h[:, ~measured] = np.nan
    hits, band = tuple(measured.astype(int).tolist()), (float(frequency[0]), float(frequency[-1]))
    unknown = np.full(shape, np.nan)
    return Frf(frequency, h, unknown, coherence, hits, band, window_rate_1_s, layout=layout)
