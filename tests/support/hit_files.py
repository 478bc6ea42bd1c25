"""Time histories as files, from named columns (n,): each format that planner reads, once."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io

from planner.proof.hits import SimulatedHit
from planner.recording.records import Hit

Columns = dict[str, np.ndarray]
NAMES = ("force_n", *(f"acceleration_{axis}_m_s2" for axis in "xyz"))


def columns(hit: Hit | SimulatedHit, rate_hz: float, every: int = 1) -> Columns:
    """A hit of the tool at a sampling rate; of its samples one of `every` so many."""
    return named(np.vstack([hit.force_n, hit.acceleration_m_s2])[:, ::every], rate_hz)


def named(samples: np.ndarray, rate_hz: float) -> Columns:
    """Force and accelerations (4, n) with their times."""
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


def write_tdms(path: Path, table: Columns, axis: str = "+x", **more: Any) -> None:
    """With properties of channels as LabVIEW has them; `force_…` are the force's alone."""
    from nptdms import ChannelObject, RootObject, TdmsWriter

    own = {k.removeprefix("force_"): v for k, v in more.items() if k.startswith("force_")}
    common = {k: v for k, v in more.items() if not k.startswith("force_")}
    made = [
        ChannelObject("hit", name, values, {**common, **(own if name == "force_n" else {})})
        for name, values in table.items()
    ]
    with TdmsWriter(str(path)) as writer:
        writer.write_segment([RootObject({"hit": axis}), *made])


WRITERS: dict[str, Callable[..., None]] = {
    ".csv": write_csv, ".mat": write_mat, ".h5": write_h5, ".tdms": write_tdms,
}  # fmt: skip
