"""Reading a recording, whatever its format: one reader per format, chosen by the file's name."""

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.recording.named_columns import Named, to_records
from planner.recording.records import FrfRecord, Record
from planner.recording.text_tables import read_text
from planner.recording.uff import read_uff

MAX_BYTES = 512 * 1024 * 1024


def _columns(path: Path, entries: dict[str, object]) -> Named:
    """Vectors among the entries are columns; single values are attributes."""
    columns: dict[str, np.ndarray] = {}
    attributes: dict[str, str] = {}
    for name, entry in entries.items():
        value = np.squeeze(np.asarray(entry))
        if value.ndim == 1 and value.dtype.kind in "fiuc" and value.size > 1:
            columns[name] = value if value.dtype.kind == "c" else value.astype(float)
        elif value.ndim == 0:
            item = value.item()
            attributes[name] = item.decode() if isinstance(item, bytes) else str(item)
    if not columns:
        shapes = ", ".join(f"{n} {np.asarray(e).shape}" for n, e in list(entries.items())[:5])
        raise InputError(
            f"{path} holds no named vectors ({shapes or 'nothing'}); name them time_s, force_n, "
            f"acceleration_x_m_s2 and so on."
        )
    return Named(columns, {}, attributes)


def read_mat(path: Path) -> tuple[Record, ...]:
    """MATLAB files up to v7; v7.3 is HDF5."""
    import scipy.io

    try:
        entries = scipy.io.loadmat(str(path), squeeze_me=True)
    except NotImplementedError:
        return read_hdf5(path)
    except Exception as error:
        raise InputError(
            f"{path} is not a readable MAT file ({type(error).__name__}); export it again."
        ) from None
    visible = {name: value for name, value in entries.items() if not name.startswith("__")}
    if {"yspec", "npts", "freq", "tfun"} <= set(visible):
        return (_logged_spectra(path, visible),)
    return to_records(path, _columns(path, visible))


def _logged_spectra(path: Path, entries: dict[str, object]) -> FrfRecord:
    """Transfer functions as the Cambridge data logger (now pydvma) saves them.

    `yspec` (lines, channels) is the half spectrum of `npts` samples at `freq` Hz; `tfun` tells
    that it is a transfer function. The format knows no units, directions or coherence.
    """
    values = np.atleast_2d(np.asarray(entries["yspec"]).T).astype(complex)
    samples, rate_hz = (float(np.asarray(entries[name])) for name in ("npts", "freq"))
    whole = values.shape[1] == int(samples) // 2 + 1 and rate_hz > 0 and np.isfinite(values).all()
    if not (np.all(np.asarray(entries["tfun"]) == 1) and whole):
        raise InputError(
            f"{path} holds spectra of {values.shape[1]} lines that are not the transfer functions "
            f"of {samples:g} samples at {rate_hz:g} Hz; export transfer functions."
        )
    unknown = (0,) * len(values)
    return FrfRecord(
        path,
        np.arange(values.shape[1]) * rate_hz / samples,
        values,
        unknown,
        unknown,
        "unknown",
        "",
        np.full(values.shape, np.nan),
        ("The file states no units, directions or coherence.",),
    )


def read_hdf5(path: Path) -> tuple[Record, ...]:
    """HDF5 files with one dataset per channel; attributes of the file and its root count too."""
    import h5py

    entries: dict[str, object] = {}
    units: dict[str, str] = {}
    try:
        with h5py.File(path, "r") as file:
            entries.update(file.attrs.items())

            def visit(name: str, item: object) -> None:
                if isinstance(item, h5py.Dataset):
                    entries[name.rsplit("/", maxsplit=1)[-1]] = item[()]
                    if "unit" in item.attrs:
                        units[name.rsplit("/", maxsplit=1)[-1]] = str(item.attrs["unit"])

            file.visititems(visit)
    except Exception as error:
        raise InputError(
            f"{path} is not a readable HDF5 file ({type(error).__name__}); export it again."
        ) from None
    named = _columns(path, entries)
    return to_records(path, Named(named.columns, units, named.attributes))


def read_tdms(path: Path) -> tuple[Record, ...]:
    """TDMS files; unit and increment as LabVIEW writes them (unit_string, wf_increment)."""
    from nptdms import TdmsFile

    # The library only warns of a file that is cut off, and then gives what there is.
    warnings = _Warnings()
    logger = logging.getLogger("nptdms")
    logger.addHandler(warnings)
    for name in list(logging.root.manager.loggerDict):
        if name.startswith("nptdms"):
            for handler in logging.getLogger(name).handlers:
                handler.setLevel(logging.CRITICAL if handler is not warnings else logging.WARNING)
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    try:
        file = TdmsFile.read(path)
        attributes = {str(k): str(v) for k, v in file.properties.items()}
        for group in file.groups():
            attributes |= {str(k): str(v) for k, v in group.properties.items()}
            for channel in group.channels():
                columns[channel.name] = np.asarray(channel[:], dtype=float)
                if channel.properties.get("unit_string"):
                    units[channel.name] = str(channel.properties["unit_string"])
                if channel.properties.get("wf_increment"):
                    rate = 1 / float(channel.properties["wf_increment"])
                    attributes.setdefault("sampling_rate_hz", repr(rate))
    except Exception as error:
        raise InputError(
            f"{path} is not a readable TDMS file ({type(error).__name__}); export it again."
        ) from None
    finally:
        logger.removeHandler(warnings)
    if warnings.texts:
        raise InputError(f"{path} is cut off ({warnings.texts[0]}); export it again.")
    return to_records(path, Named(columns, units, attributes))


class _Warnings(logging.Handler):
    """Keeps what a library warns of."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.texts.append(record.getMessage())


def _read_txt(path: Path) -> tuple[Record, ...]:
    """Universal files are often named .txt."""
    with open(path, "rb") as file:
        head = file.read(200)
    lines = [line.strip() for line in head.splitlines()[:2]]
    is_uff = len(lines) == 2 and lines[0] == b"-1" and lines[1][:2] in (b"58", b"15", b"16")
    return read_uff(path) if is_uff else read_text(path)


READERS: dict[str, Callable[[Path], tuple[Record, ...]]] = {
    ".uff": read_uff,
    ".unv": read_uff,
    ".uf58": read_uff,
    ".mat": read_mat,
    ".h5": read_hdf5,
    ".hdf5": read_hdf5,
    ".tdms": read_tdms,
    ".csv": read_text,
    ".tsv": read_text,
    ".txt": _read_txt,
    ".gz": read_text,
}


def read(path: Path) -> tuple[Record, ...]:
    """All records of a file. Raises InputError with one sentence if it cannot be read right."""
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(
            f"{path} has no known format; recordings are {', '.join(READERS)}: export one of these."
        )
    try:
        size = path.stat().st_size
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}); check the path.") from None
    if size == 0:
        raise InputError(f"{path} is empty; export it again.")
    if size > MAX_BYTES:
        raise InputError(f"{path} is larger than {MAX_BYTES >> 20} MiB; split it.")
    return reader(path)
