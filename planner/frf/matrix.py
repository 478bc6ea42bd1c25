"""FRFs of files with their places, checked before any is used: a pose's, or between any points.

A matrix of responses × references is as complete as it was measured.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.errors import PlannerError, RefusedError
from planner.frf.frf import Frf
from planner.frf.synthesis import DERIVATIVE, convert
from planner.recording.points import NOT_STATED, SENSOR, TCP, TOOL, Dof, Layout
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


@dataclass(frozen=True, eq=False)
class FrfMatrix:
    """Accelerance between degrees of freedom; NaN where it was not measured.

    `accelerance[o, i]` is the response at `responses[o]` to a force at `references[i]`, both along
    positive axes: what was measured along negative ones is turned. In m/s²/N where `scaled`.
    `exponential_rate_1_s` and `tail_s` as in `Frf`; `ended` are the same FRFs under a window by
    which decays are over, None where there is none.
    """

    frequency_hz: np.ndarray  # (F,) increasing, > 0
    responses: tuple[Dof, ...]
    references: tuple[Dof, ...]
    accelerance: np.ndarray  # (o, i, F) complex
    scaled: bool
    remarks: tuple[str, ...] = ()
    simulated: bool = False
    exponential_rate_1_s: float = 0.0
    tail_s: float = np.inf
    ended: "FrfMatrix | None" = None

    @property
    def measured(self) -> np.ndarray:
        """(o, i) bool: which entries were measured."""
        return np.all(np.isfinite(self.accelerance), axis=-1)

    @property
    def count(self) -> int:
        """How many FRFs there are."""
        return int(np.count_nonzero(self.measured))

    @property
    def both(self) -> list[tuple[int, int]]:
        """(response, reference) of the points that were felt and hit."""
        felt = {dof: o for o, dof in enumerate(self.responses)}
        return [(felt[dof], i) for i, dof in enumerate(self.references) if dof in felt]

    @property
    def driving(self) -> tuple[tuple[int, int], ...]:
        """(response, reference) of the driving points: entries hit where they were felt."""
        return tuple(pair for pair in self.both if self.measured[pair])

    @property
    def hit(self) -> bool:
        """Whether points were hit one after the other (a roving hammer), and few of them felt."""
        return len(self.responses) < len(self.references)

    @property
    def roved(self) -> "FrfMatrix":
        """The same with the longer side as responses, be they felt or hit."""
        if not self.hit:
            return self
        return replace(
            self, responses=self.references, references=self.responses,
            accelerance=np.swapaxes(self.accelerance, 0, 1), ended=self.ended and self.ended.roved,
        )  # fmt: skip


# Where an FRF was felt and hit, along which signed directions, and its values (F,).
Entry = tuple[Dof, Dof, np.ndarray]


def matrix_of(records: Sequence[FrfRecord], quantity: str | None = None) -> FrfMatrix:
    """One matrix of all FRFs of all files, by node and direction.

    `quantity` says what FRFs are whose file does not. An FRF that is there several times is
    averaged. Raises RefusedError for lines that differ, InputError for an unknown direction or
    quantity.
    """
    frequency = common_lines(records, RefusedError)
    remarks = [r for record in records for r in record.remarks]
    scaled, keep = True, frequency > 0
    entries: list[Entry] = []
    for record in records:
        kind, known = _kind(record, quantity, remarks)
        scaled &= known
        values = convert(frequency[keep], record.values[:, keep], kind, "accelerance")
        each = zip(record.places, values, strict=True)
        entries += [(Dof.of_uff(*felt), Dof.of_uff(*hit), held) for (felt, hit), held in each]
    found = _matrix(frequency[keep], entries, remarks, records[0].source)
    simulated = any(record.simulated for record in records)
    return replace(found, scaled=scaled, simulated=simulated)


def matrix_of_hits(frf: Frf, source: Path, simulated: bool) -> FrfMatrix:
    """The same of FRFs that were estimated here; `source` is named where they are refused."""
    entries: list[Entry] = [
        (_place(frf.layout.sensors, o, SENSOR), _place(frf.layout.hits, i, TCP),
         frf.accelerance[o, i])
        for o, i in np.argwhere(np.isfinite(frf.accelerance).all(axis=-1)).tolist()
    ]  # fmt: skip
    found = _matrix(frf.frequency_hz, entries, list(frf.remarks), source)
    rate, tail = frf.exponential_rate_1_s, frf.tail_s
    return replace(found, simulated=simulated, exponential_rate_1_s=rate, tail_s=tail)


def _place(points: tuple[str, ...], at: int, unnamed: str) -> Dof:
    """Of a row or column; points that no file names have no node."""
    name, direction = points[at // 3], at % 3 + 1
    if name.endswith(NOT_STATED):
        name, direction = name.removesuffix(NOT_STATED), 0
    return Dof.of_uff("" if name == unnamed else name, direction)


def _matrix(
    frequency: np.ndarray, entries: Sequence[Entry], remarks: list[str], source: Path
) -> FrfMatrix:
    seen: dict[tuple[Dof, Dof], list[np.ndarray]] = {}
    for felt, hit, values in entries:
        if np.any(values):
            turned = felt.sign * hit.sign * values
            seen.setdefault((felt.positive, hit.positive), []).append(turned)
    if not seen:
        raise RefusedError(f"{source}: all FRFs are zero; export them again.")
    dead = [f"{felt} hit at {hit}" for felt, hit, values in entries if not np.any(values)]
    if dead:
        named = ", ".join(dead[:3]) + (" …" if len(dead) > 3 else "")
        remarks.append(f"{len(dead)} FRFs are zero throughout and were left out: {named}.")
    twice = [key for key, found in seen.items() if len(found) > 1]
    if twice:
        remarks.append(
            f"{len(twice)} FRFs were measured more than once (the first: {twice[0][0]} hit at "
            f"{twice[0][1]}); their mean is used."
        )
    responses, references = (
        tuple(sorted(set(side), key=by_number)) for side in zip(*seen, strict=True)
    )
    h = np.full((len(responses), len(references), frequency.size), np.nan + 0j)
    for (felt, hit), found in seen.items():
        h[responses.index(felt), references.index(hit)] = np.mean(found, axis=0)
    told = tuple(dict.fromkeys(remarks))
    return FrfMatrix(frequency, responses, references, h, True, told)


def by_number(dof: Dof) -> tuple[int, int, str, int]:
    """Order of degrees of freedom: numbers by size, then names; x before y before z."""
    digits = dof.node.lstrip("-").isdigit()
    return not digits, int(dof.node) if digits else 0, dof.node, abs(dof.number)


def _kind(record: FrfRecord, quantity: str | None, remarks: list[str]) -> tuple[str, bool]:
    """What the FRFs are, and whether they are in SI units."""
    if record.quantity in DERIVATIVE:
        if not record.unit:
            remarks.append(f"{record.source.name}: the unit is not known, shapes are not scaled.")
        return record.quantity, bool(record.unit)
    if quantity is not None:
        return quantity, False
    remarks.append(
        f"{record.source.name} does not say whether its FRFs are accelerance, mobility or "
        "receptance; they are taken for accelerance and shapes are not scaled. Say --quantity."
    )
    return "accelerance", False
