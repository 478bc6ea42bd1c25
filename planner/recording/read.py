"""Reading a recording, whatever its format: one reader per format, chosen by the file's name.

For those who ask for it the name also says where FRFs were felt and hit: "anything_yx" is the
response along y to a hit along x, "H3_1" or "H31" that at node 3 to a hit at node 1, "3y_1x" both;
signs may stand before an axis.
"""

import hashlib
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from planner import file_content
from planner.errors import InputError
from planner.recording.channel_faults import without_filling
from planner.recording.column_names import hit_direction
from planner.recording.containers import read_hdf5, read_tdms
from planner.recording.entry_columns import check_size, tree_of
from planner.recording.entry_records import records_of
from planner.recording.folder import files_in
from planner.recording.lvm import read_lvm
from planner.recording.mat5 import is_version_5, read_mat5
from planner.recording.named_columns import Named, to_records
from planner.recording.records import MAX_BYTES, End, FrfRecord, Record, TimeRecord, check_records
from planner.recording.stream import cut_into_hits
from planner.recording.text_tables import read_text
from planner.recording.uff import read_uff
from planner.recording.wav import WAV, read_wav, scales_beside, self_contained


class ReadFile(NamedTuple):
    """The records of a file as they are, and cut into hits."""

    whole: tuple[Record, ...]
    hits: tuple[Record, ...]


# A file of many hits is read once, not once a hit.
_records: file_content.LastRead[ReadFile] = file_content.LastRead(256 << 20)


def read_mat(path: Path) -> tuple[Record, ...]:
    """MATLAB files up to v7; v7.3 is HDF5."""
    if is_version_5(path):
        entries = read_mat5(path)
    else:
        import scipy.io

        try:
            listed = scipy.io.whosmat(str(path))
            # Real or complex is not said before it is read.
            check_size(path, sum(8 * int(np.prod(shape, dtype=float)) for _, shape, _ in listed))
            entries = scipy.io.loadmat(str(path))
        except NotImplementedError:  # of version 7.3
            return read_hdf5(path)
    visible = {name: v for name, v in entries.items() if name and not name.startswith("__")}
    arrays = {name for name, value in visible.items() if isinstance(value, np.ndarray)}
    if {"yspec", "npts", "freq", "tfun"} <= arrays:
        return to_records(path, _logged_spectra(path, visible))
    return records_of(path, tree_of(visible))


def _logged_spectra(path: Path, entries: dict[str, object]) -> Named:
    """Transfer functions as the Cambridge data logger (now pydvma) saves them.

    `yspec` (lines, channels) is the half spectrum of `npts` samples at `freq` Hz; `tfun` tells
    that it is a transfer function. The format knows no units, directions or coherence.
    """
    single = [np.asarray(entries[name]) for name in ("npts", "freq")]
    spectra = np.atleast_2d(np.squeeze(np.asarray(entries["yspec"])).T)
    if any(v.size != 1 or v.dtype.kind not in "fiub" for v in single) or (
        spectra.ndim != 2 or spectra.dtype.kind not in "fiuc"
    ):
        raise InputError(
            f"{path} holds yspec of shape {spectra.shape}, or npts or freq that is not one "
            f"number; export transfer functions."
        )
    values = spectra.astype(complex)
    samples, rate_hz = (float(v.item()) for v in single)
    whole = values.shape[1] == samples // 2 + 1 and rate_hz > 0 and np.isfinite(values).all()
    if not (np.all(np.asarray(entries["tfun"]) == 1) and whole):
        raise InputError(
            f"{path} holds spectra of {values.shape[1]} lines that are not the transfer functions "
            f"of {samples:g} samples at {rate_hz:g} Hz; export transfer functions."
        )
    lines = np.arange(values.shape[1]) * rate_hz / samples
    columns = {f"channel {number}": row for number, row in enumerate(values, 1)}
    remarks = ("The file states no units, directions or coherence.",)
    return Named({"frequency_hz": lines, **columns}, remarks=remarks)


def _read_txt(path: Path) -> tuple[Record, ...]:
    """Universal files are often named .txt."""
    with open(path, "rb") as file:
        head = file.read(200)
    lines = [line.strip() for line in head.splitlines()[:2]]
    is_uff = len(lines) == 2 and lines[0] == b"-1" and lines[1][:2] in (b"58", b"15", b"16")
    return read_uff(path) if is_uff else read_text(path)


READERS: dict[str, Callable[[Path], tuple[Record, ...]]] = {
    **dict.fromkeys((".uff", ".unv", ".uf58"), read_uff),
    ".mat": read_mat,
    **dict.fromkeys((".h5", ".hdf5"), read_hdf5),
    ".tdms": read_tdms,
    ".lvm": read_lvm,
    **dict.fromkeys((".csv", ".tsv"), read_text),
    ".txt": _read_txt,
    ".gz": read_text,
    WAV: read_wav,
}


def read(path: Path) -> tuple[Record, ...]:
    """All records of a file. Raises InputError with one sentence if it cannot be read right."""
    return _read(path).whole


def read_hits(path: Path) -> tuple[Record, ...]:
    """The same, with time histories of several hits cut into hits."""
    return _read(path).hits


def hits_in(path: Path) -> tuple[float | None, ...]:
    """Of a file of several hits the time (s) of each in its record, None where each has its own.

    () where the file holds a single hit, or FRFs, or cannot be read.
    """
    try:
        hits = [one for one in read_hits(path) if isinstance(one, TimeRecord)]
    except InputError:
        return ()
    return tuple(hit.at_s for hit in hits) if len(hits) > 1 else ()


def version(path: Path) -> tuple[int, ...]:
    """What changes when a file does, or the table of scales beside it. Raises OSError."""
    if path.suffix.lower() == WAV and scales_beside(path).is_file():
        return *file_content.mark(path), *file_content.mark(scales_beside(path))
    return file_content.mark(path)


def content(path: Path) -> bytes:
    """A recording's bytes with all that reading it takes, so that it can be kept elsewhere.

    Raises InputError where what it needs is missing or wrong, OSError where it cannot be read.
    """
    data = file_content.read(path)
    return self_contained(path, data) if path.suffix.lower() == WAV else data


def digest(path: Path) -> str:
    """SHA-256 of `content`, and raises as that does."""
    if path.suffix.lower() == WAV:
        return hashlib.sha256(content(path)).hexdigest()
    return file_content.sha256(path)


def _read(path: Path) -> ReadFile:
    if path.suffix.lower() not in READERS:
        raise InputError(
            f"{path} has no known format; recordings are {', '.join(READERS)}: export one of these."
        )
    try:
        size, mark = path.stat().st_size, version(path)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}); check the path.") from None
    if size == 0:
        raise InputError(f"{path} is empty; export it again.")
    if size > MAX_BYTES:
        raise InputError(f"{path} is larger than {MAX_BYTES >> 20} MiB; split it.")
    return _records.of(path, mark, _read_anew)


def _read_anew(path: Path) -> ReadFile:
    try:
        records = READERS[path.suffix.lower()](path)
    except InputError:
        raise
    except Exception as error:  # libraries raise whatever the junk makes them raise
        raise InputError(
            f"{path} cannot be read as {path.suffix} ({type(error).__name__}); export it again."
        ) from error
    check_records(path, records)
    whole = tuple(without_filling(r) if isinstance(r, TimeRecord) else r for r in records)
    cut = (cut_into_hits(r) if isinstance(r, TimeRecord) else (r,) for r in whole)
    return ReadFile(whole, tuple(hit for hits in cut for hit in hits))


_AXES = re.compile(r"(?:^|[^a-z])()([+-]?[xyz])_?()([+-]?[xyz])$", re.IGNORECASE)
_NODES = re.compile(r"(?:^|[^a-z0-9])h?(\d+)([+-]?[xyz]?)[_,-](\d+)([+-]?[xyz]?)$", re.IGNORECASE)
_DIGITS = re.compile(r"(?:^|[^a-z0-9])h(\d)()(\d)()$", re.IGNORECASE)


def place_in_name(path: Path) -> tuple[str, str, str, str]:
    """Nodes and signed axes of the response, then of the hit, as a file's name says; "" unknown.

    Raises InputError where it says nothing.
    """
    stem = path.name.removesuffix(".gz").rpartition(".")[0]
    if found := _NODES.search(stem) or _DIGITS.search(stem) or _AXES.search(stem):
        return found[1], found[2], found[3], found[4]
    raise InputError(
        f"{path}: its name says neither axes nor nodes; call it such as tap_yx (response y, hit "
        f"x), H3_1 or 3y_1x (nodes), or leave out --from-names."
    )


def placed_by_name(record: FrfRecord, name: str) -> FrfRecord:
    """FRFs with what they do not state themselves from their file's name; of several the hit."""
    node, response, hit_node, hit = place_in_name(Path(name))
    if len(record.places) > 1:
        node, response = "", ""

    def completed(own: End, node: str, axis: str) -> End:
        named = node if own.node in ("", "0") else own.node
        return End(named, own.direction or hit_direction(axis))

    own = (
        (completed(felt, node, response), completed(struck, hit_node, hit))
        for felt, struck in record.places
    )
    return replace(record, places=tuple(own))


def read_frfs(path: Path, from_names: bool = False) -> tuple[FrfRecord, ...]:
    """FRFs of a file or folder; with `from_names` what they lack of places is in files' names.

    Raises InputError in one sentence, also where there are none.
    """
    files = files_in(path, READERS) if path.is_dir() else [path]
    found = [r for file in files for r in read(file) if isinstance(r, FrfRecord)]
    if not found:
        raise InputError(f"{path} holds no FRFs; export FRFs, or name hits to planner modes.")
    return tuple(placed_by_name(r, r.source.name) if from_names else r for r in found)
