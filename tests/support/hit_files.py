"""Time histories as files, from named columns (n,): each format that planner reads, once."""

import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyuff
import scipy.io

from planner.recording.records import Hit
from planner.truth.hits import SimulatedHit

Columns = dict[str, np.ndarray]
NAMES = ("force_n", *(f"acceleration_{axis}_m_s2" for axis in "xyz"))
KINDS = {"force": (13, "N"), "acceleration": (12, "m/s^2")}  # of universal files


def columns(hit: Hit | SimulatedHit, rate_hz: float, every: int = 1) -> Columns:
    """A hit of the tool at a sampling rate; of its samples one of `every` so many."""
    samples = np.vstack([hit.force_n, hit.acceleration_m_s2])[:, ::every]
    time_s = np.arange(samples.shape[1]) / rate_hz
    return {"time_s": time_s, **dict(zip(NAMES, samples, strict=True))}


def write_table(path: Path, table: Columns, *head: str) -> Path:
    """Text below lines such as "hit = +x"."""
    header = "\n".join([*head, ",".join(table)])
    rows = np.column_stack(list(table.values()))
    np.savetxt(path, rows, delimiter=",", header=header, comments="", fmt="%.9g")
    return path


def write_hit(path: Path, hit: Hit, rate_hz: float | None = None, stated: bool = True) -> Path:
    """Text of a hit at about a whole part of its rate; its axis is `stated` or not."""
    rate = rate_hz or hit.sampling_rate_hz
    table = columns(hit, rate, round(hit.sampling_rate_hz / rate))
    return write_table(path, table, *([f"# hit: {hit.axis}"] if stated else []))


def write_csv(path: Path, table: Columns, axis: str = "+x") -> None:
    write_table(path, table, f"hit = {axis}")


def write_mat(path: Path, table: Columns, axis: str = "+x") -> None:
    scipy.io.savemat(path, {**table, "hit": axis})


def write_h5(path: Path, table: Columns, axis: str = "+x") -> None:
    with h5py.File(path, "w") as file:
        file.attrs["hit"] = axis
        for name, values in table.items():
            file[name] = values


def write_tdms(path: Path, table: Columns, axis: str = "+x") -> None:
    from nptdms import ChannelObject, RootObject, TdmsWriter

    with TdmsWriter(str(path)) as writer:
        root = RootObject(properties={"hit": axis})
        writer.write_segment([root, *(ChannelObject("hit", n, v) for n, v in table.items())])


WRITERS: dict[str, Callable[..., None]] = {
    ".csv": write_csv, ".mat": write_mat, ".h5": write_h5, ".tdms": write_tdms,
}  # fmt: skip


def history(
    samples: np.ndarray, rate_hz: float, what: str, felt: tuple[int, int],
    hit: tuple[int, int] = (0, 0), said: str = "simulated",
) -> dict[str, Any]:  # fmt: skip
    """Dataset 58 of a force or an acceleration: nodes and signed directions 1 to 3."""
    kind, unit = KINDS[what]
    return {
        "type": 58, "binary": 1, "func_type": 1, "id1": said, "rsp_node": felt[0],
        "rsp_dir": felt[1], "ref_node": hit[0], "ref_dir": hit[1], "data": samples,
        "x": np.arange(samples.size) / rate_hz, "abscissa_spacing": 1,
        "abscissa_spec_data_type": 17, "ordinate_spec_data_type": kind,
        "ordinate_axis_units_lab": unit, "orddenom_spec_data_type": 0,
    }  # fmt: skip


def write_sets(path: Path, sets: Iterable[dict[str, Any]]) -> Path:
    """A new universal file."""
    path.unlink(missing_ok=True)
    with warnings.catch_warnings():  # pyuff leaves closing the file to the garbage collector
        warnings.simplefilter("ignore", ResourceWarning)
        pyuff.UFF(str(path)).write_sets(list(sets), "add")
    return path
