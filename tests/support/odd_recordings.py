"""Recordings that crashed, hung or misled a reader once, by name: each is to be refused in words.

Values are (file name, function that writes it from a hit's named columns (n,)).
"""

import gzip
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io

from tests.support.hit_files import Columns, write_h5, write_mat, write_tdms


def _without_time(columns: Columns) -> Columns:
    return {name: values for name, values in columns.items() if name != "time_s"}


def _bomb_h5(path: Path, columns: Columns) -> None:
    """A few KB that unfold to 16 GiB."""
    with h5py.File(path, "w") as file:
        for k in range(8):
            file.create_dataset(f"c{k}", (2**28,), "f8", chunks=(2**20,), compression="gzip")


def _elsewhere(kind: str) -> Callable[[Path, Columns], None]:
    """HDF5 with its numbers in another file."""

    def write(path: Path, columns: Columns) -> None:
        other = path.with_name("other.dat")
        write_h5(other, columns)
        with h5py.File(path, "w") as file:
            file.attrs["hit"] = "+x"
            for name, values in columns.items():
                if kind == "link":
                    file[name] = h5py.ExternalLink(other.name, name)
                elif kind == "virtual":
                    layout = h5py.VirtualLayout(values.shape, "f8")
                    layout[:] = h5py.VirtualSource(other.name, name, values.shape)
                    file.create_virtual_dataset(name, layout)
                else:
                    raw = path.with_name(f"{name}.dat")
                    raw.write_bytes(values.tobytes())
                    place = [(str(raw), 0, h5py.h5f.UNLIMITED)]
                    file.create_dataset(name, values.shape, "f8", external=place)

    return write


def _flipped_gzip(path: Path, columns: Columns) -> None:
    rows = "\n".join(",".join(map(repr, map(float, row))) for row in zip(*columns.values()))  # noqa: B905
    data = bytearray(gzip.compress(f"hit = +x\n{','.join(columns)}\n{rows}\n".encode()))
    data[len(data) // 2] ^= 0x55
    path.write_bytes(bytes(data))


def _mat(**changes: Any) -> Callable[[Path, Columns], None]:
    """MAT with columns replaced; a function is applied to the column."""

    def write(path: Path, columns: Columns) -> None:
        made = {k: v(columns[k]) if callable(v) else v for k, v in changes.items()}
        write_mat(path, {**columns, **made})

    return write


def _frfs(**changes: Any) -> Callable[[Path, Columns], None]:
    lines = np.linspace(0.0, 100.0, 200)
    good = {"frequency_hz": lines, **{f"accelerance_{a}x": lines + 1j for a in "xyz"}}
    return lambda path, columns: scipy.io.savemat(path, {**good, **changes})


def _spectra(**changes: Any) -> Callable[[Path, Columns], None]:
    good = {"yspec": np.ones((129, 2)) * (1 + 1j), "npts": 256.0, "freq": 512.0, "tfun": 1.0}
    return lambda path, columns: scipy.io.savemat(path, {**good, **changes})


def _header(line: str) -> Callable[[Path, Columns], None]:
    body = "1,2,3,4,5\n" * 20
    return lambda path, columns: path.write_text(f"{line}\n{body}") and None


def one_sample(values: np.ndarray) -> np.ndarray:
    """A sample that no instrument gives."""
    spoilt = values.copy()
    spoilt[100] = 1e200
    return spoilt


ODD: dict[str, tuple[str, Callable[[Path, Columns], None]]] = {
    "rates that differ": ("rates.tdms", lambda path, c: write_tdms(
        path, _without_time(c), wf_increment=1 / 1280, force_wf_increment=1 / 640)),
    "a rate that its times contradict": ("contradicts.tdms", lambda path, c: write_tdms(
        path, c, wf_increment=1 / 1280)),
    "an increment of 1e-300": ("tiny.tdms", lambda path, c: write_tdms(
        path, _without_time(c), wf_increment=1e-300)),
    "unfolds to 16 GiB": ("bomb.h5", _bomb_h5),
    "an external link": ("link.h5", _elsewhere("link")),
    "a virtual dataset": ("virtual.h5", _elsewhere("virtual")),
    "external storage": ("storage.h5", _elsewhere("storage")),
    "a flipped byte in gzip": ("flip.csv.gz", _flipped_gzip),
    "an acceleration of 1e200": ("large.mat", _mat(acceleration_x_m_s2=one_sample)),
    "a force of 1e200": ("force.mat", _mat(force_n=one_sample)),
    "times in units of 1e-300 s": ("step.mat", _mat(time_s=lambda t: t * 1e-300)),
    "FRFs of unequal length": ("unequal.mat", _frfs(accelerance_yx=np.ones(50) + 1j)),
    "a coherence of another length": ("coherence.mat", _frfs(coherence_xx=np.ones(7))),
    "FRFs at 0 Hz only": ("zero.mat", _frfs(frequency_hz=np.zeros(200))),
    "an FRF of 1e200": ("frf.mat", _frfs(accelerance_xx=1e200 * np.ones(200) + 1j)),
    "spectra that are a word": ("word.mat", _spectra(yspec="abc")),
    "spectra of any objects": ("objects.mat", _spectra(yspec=np.array(["a", 2], dtype=object))),
    "spectra with three sizes": ("three.mat", _spectra(npts=np.array([1.0, 2.0, 3.0]))),
    "spectra without a size": ("nan.mat", _spectra(npts=np.nan)),
    "spectra without a rate": ("rate.mat", _spectra(freq=np.array([]))),
    "a header of blanks": ("blanks.csv", _header("a" + " " * 200_000 + "b")),
    "a header of digits": ("digits.csv", _header("1 " * 100_000)),
    "a header of brackets": ("brackets.csv", _header("(" * 100_000 + ",force_n,a,b,time_s")),
}  # fmt: skip
