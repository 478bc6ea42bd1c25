"""FRFs of any points: exported by an analyser, or estimated here from hits of any points."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from planner.dataset.measure import DEFAULT_BAND_HZ, MeasuredPose
from planner.dataset.screened_files import Source, in_parts, told_of_files
from planner.errors import InputError, PlannerError, RefusedError, RefusedFile
from planner.frf.matrix import FrfMatrix, matrix_of, matrix_of_hits
from planner.recording.points import ANYWHERE
from planner.recording.read import read
from planner.recording.records import FrfRecord, Hit, Record, TimeRecord
from planner.recording.screening import excited_band
from planner.recording.uff import read_geometry


@dataclass(frozen=True, eq=False)
class FrfSet:
    """FRFs, and what became of the files that they are from.

    `band_hz` is where modes are looked for, None: wherever there are lines. `records` are FRFs that
    were exported; `matrix` is None of those that state neither where nor along which directions
    they were measured.
    """

    records: tuple[FrfRecord, ...]
    files: tuple[Path, ...]
    accepted: tuple[str, ...]
    refused: tuple[RefusedFile, ...]
    band_hz: tuple[float, float] | None
    matrix: FrfMatrix | None
    remarks: tuple[str, ...] = ()


def frf_set(
    sources: Sequence[Source],
    band_hz: tuple[float, float] | None,
    estimator: str = "h1",
    window_rate_1_s: float = 0.0,
    quantity: str | None = None,
) -> FrfSet | None:
    """The FRFs of files; None where they are of one point with all its three responses.

    That is a pose, be it hits or FRFs, and read elsewhere. The first file that can be read says
    which of both is meant. `quantity` says what FRFs are whose file does not. Raises RefusedError
    where no hit can be used, and as `matrix_of`.
    """
    held, refused = _read(sources)
    records = [record for _, own in held for record in own]
    if records and isinstance(records[0], TimeRecord):
        times = [record for record in records if isinstance(record, TimeRecord)]
        if _one_sensor(times) and not any(s.stated.hit_point for s in sources):
            return None
        return _struck(sources, band_hz, estimator, window_rate_1_s)
    given, used = [], []
    for source, own in held:
        frfs = [record for record in own if isinstance(record, FrfRecord)]
        given += frfs
        if frfs:
            used.append(source.name)
        else:
            why = f"{source.name} holds time histories, other files FRFs; name one kind only."
            refused.append(RefusedFile(source.name, why))
    placed, one_sensor = _placed(given)
    if not given or one_sensor:
        return None
    if not placed and window_rate_1_s:
        raise InputError("--window-rate is for hits, and for FRFs that state their directions.")
    matrix = matrix_of(given, quantity) if placed else None
    matrix = matrix and replace(matrix, exponential_rate_1_s=window_rate_1_s)
    files = tuple(source.path for source in sources)
    return FrfSet(tuple(given), files, tuple(used), tuple(refused), band_hz, matrix)


def _read(
    sources: Sequence[Source],
) -> tuple[list[tuple[Source, tuple[Record, ...]]], list[RefusedFile]]:
    """Records of every file, and why others are refused; geometry alone is no reason."""
    held, refused = [], []
    for source in sources:
        try:
            own = (source.placed(r) if isinstance(r, FrfRecord) else r for r in read(source.path))
            held.append((source, tuple(own)))
        except PlannerError as error:
            if read_geometry((source.path,)) is None:
                refused.append(RefusedFile(source.name, str(error)))
    return held, refused


def _one_sensor(times: Sequence[TimeRecord]) -> bool:
    """Whether hits are those of a pose: at one point, heard along x, y and z by one sensor.

    So it is, too, where nothing is a hit, and where single files lack a direction: what is wrong
    with them is said where poses are read.
    """
    places, whole = set(), False
    for record in times:
        force = [_node(c.node) for c in record.channels if c.quantity == "force"]
        heard = [c for c in record.channels if c.quantity == "acceleration"]
        if len(force) == 1 and heard:
            places.add((force[0], frozenset(_node(c.node) for c in heard)))
            whole = whole or sorted(abs(c.direction) for c in heard) == [1, 2, 3]
    return not places or (len(places) == 1 and whole)


def _node(name: str) -> str:
    return "" if name == "0" else name


def _struck(
    sources: Sequence[Source],
    band_hz: tuple[float, float] | None,
    estimator: str,
    window_rate_1_s: float,
) -> FrfSet:
    """FRFs of hits, screened and averaged as those of a pose are."""
    named = (replace(s, stated=replace(s.stated, names=ANYWHERE)) for s in sources)
    parts = in_parts(tuple(s for s in named if read_geometry((s.path,)) is None))
    band = band_hz or _band(parts)
    measured = MeasuredPose(parts, band, estimator, window_rate_1_s)
    verdicts, frf, ended = measured.verdicts, measured.whole, measured.ended_frf
    refused = tuple(RefusedFile(v.source.name, v.reason) for v in verdicts if not v.accepted)
    if frf is None or ended is None:
        reasons = [file.reason for file in refused] or list(measured.averaged.remarks)
        raise RefusedError(f"No modes could be identified: {reasons[0]}")
    used = [v for v in verdicts if v.accepted]
    path, simulated = used[0].source.path, any(v.simulated for v in used)
    plain, windowed = (matrix_of_hits(one, path, simulated) for one in (frf, ended))
    files, accepted = (tuple(s.path for s in sources), tuple(v.source.name for v in used))
    matrix = replace(plain, ended=windowed)
    return FrfSet((), files, accepted, refused, band, matrix, told_of_files(verdicts))


def _placed(frfs: Sequence[FrfRecord]) -> tuple[bool, bool]:
    """Whether FRFs state places or directions, and whether they are all three responses of one
    point, or of a format without points.
    """
    every = ((*felt, *hit) for record in frfs for felt, hit in record.places)
    pairs = {(felt, abs(along), hit, abs(struck)) for felt, along, hit, struck in every}
    one_point = len({(felt, hit) for felt, _, hit, _ in pairs}) < 2
    heard = ({i for _, i, _, along in pairs if along == j} for *_, j in pairs)
    placed = not one_point or any(along for _, along, *_ in pairs)
    return placed, one_point and any({1, 2, 3} <= axes for axes in heard)


def _band(parts: Sequence[Source]) -> tuple[float, float]:
    """Which the hits excite."""
    hits: list[Hit] = []
    for part in parts:
        with suppress(PlannerError):  # said again, where it is read in earnest
            hits += part.read()[0]
    return excited_band(hits) if hits else DEFAULT_BAND_HZ
