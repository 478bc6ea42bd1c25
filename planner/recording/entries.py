"""What files of named entries (MAT, HDF5, TDMS) have in common: vectors are columns."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.recording.named_columns import Named

# A small file may unfold to any size: a hit of 5 channels at 100 kHz over 60 s is 240 MB.
LARGEST_BYTES = 384 * 1024 * 1024


def columns_of(path: Path, entries: Mapping[str, object]) -> Named:
    """Vectors among the entries are columns; single values are attributes."""
    columns: dict[str, np.ndarray] = {}
    attributes: dict[str, str] = {}
    for name, entry in entries.items():
        value = np.squeeze(np.asarray(entry))
        if value.ndim == 1 and value.dtype.kind in "fiuc" and value.size > 1:
            columns[name] = value if value.dtype.kind == "c" else value.astype(float)
        elif value.ndim == 0:
            attributes[name] = text_of(value.item())
    if not columns:
        shapes = ", ".join(f"{n} {np.asarray(e).shape}" for n, e in list(entries.items())[:5])
        raise InputError(
            f"{path} holds no named vectors ({shapes or 'nothing'}); name them time_s, force_n, "
            f"acceleration_x_m_s2 and so on."
        )
    return Named(columns, {}, attributes)


def text_of(value: object) -> str:
    """An attribute as text; what is no UTF-8 is Latin-1, as older analysers write it."""
    if not isinstance(value, bytes):
        return str(value)
    try:
        return value.decode()
    except UnicodeDecodeError:
        return value.decode("latin-1")


def check_size(path: Path, unfolded: int) -> None:
    """Raise InputError where a file's numbers would take too many bytes, before they are read."""
    if unfolded > LARGEST_BYTES:
        raise InputError(
            f"{path} unfolds to {unfolded >> 20} MiB, no single hit does; export a hit a file."
        )
