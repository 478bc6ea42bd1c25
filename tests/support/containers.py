"""Hits in containers as programs other than planner write them, by format and layout.

Each writer takes a path and hits; its file states everything that a hit needs but planner's own
names. Accelerations in g where it says so.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io

from planner.recording.records import Hit

G = 9.80665
NAMES = ("Hammer", "acc X", "acc Y", "acc Z")


def lvm(
    hits: Sequence[Hit],
    x: str = "One",
    decimal: str = ".",
    separator: str = "\t",
    between: str = "",
    late: int = 0,
) -> str:
    """A LabVIEW measurement file, a segment a hit; accelerations begin `late` samples after."""
    head = f"""LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\t{"Tab" if separator == chr(9) else "Comma"}
Multi_Headings\tYes
X_Columns\t{x}
Time_Pref\tRelative
hit\t{hits[0].axis}
Date\t2026/03/01
Time\t08:00:00.5
***End_of_Header***\t
\t
"""
    blocks = [_lvm_segment(hit, f"08:0{k}:30.25", x, late) for k, hit in enumerate(hits)]
    text = (head + f"\n{between}\n".join(blocks)).replace(".", decimal)
    return text.replace("\t", separator)


def _lvm_segment(hit: Hit, stamp: str, x: str, late: int) -> str:
    step, many = 1 / hit.sampling_rate_hz, x == "Multi"
    columns = [
        v[late if k else 0 :] for k, v in enumerate([hit.force_n, *hit.acceleration_m_s2 / G])
    ]
    starts = [late * step if k else 0.0 for k in range(4)]
    tags = {"Channels": [4], "Samples": [len(v) for v in columns], "Date": ["2026/03/01"] * 4,
            "Time": [stamp] * 4, "Y_Unit_Label": ["N", "g", "g", "g"], "X_Dimension": ["Time"] * 4,
            "X0": [f"{s:.16E}" for s in starts], "Delta_X": [f"{step:.6f}"] * 4}  # fmt: skip
    gap = "\t\t" if many else "\t"
    lines = [f"{tag}\t{gap.join(map(str, cells))}{gap}" for tag, cells in tags.items()]
    lines += ["***End_of_Header***\t"]
    lines += [
        "\t".join([f"X_Value\t{n}" for n in NAMES] if many else ["X_Value", *NAMES]) + "\tComment"
    ]
    for row in range(max(map(len, columns))):
        cells = [f"{v[row]:.9g}" if row < len(v) else "" for v in columns]
        at = [f"{s + row * step:.6f}" if c else "" for s, c in zip(starts, cells, strict=True)]
        pairs = [c for pair in zip(at, cells, strict=True) for c in pair]
        lines.append("\t".join(pairs if many else ["" if x == "No" else at[0], *cells]))
    return "\n".join([*lines, ""])


Writer = Callable[[Path, Sequence[Hit]], object]
UNITS = ("N", "m/s^2", "m/s^2", "m/s^2")


def signals(hit: Hit) -> list[np.ndarray]:
    return [hit.force_n, *hit.acceleration_m_s2]


def times(hit: Hit) -> np.ndarray:
    return np.arange(hit.force_n.size) / hit.sampling_rate_hz


def cells(values: Sequence[Any]) -> np.ndarray:
    made = np.empty(len(values), dtype=object)
    made[:] = list(values)
    return made


def structs(values: Sequence[dict[str, Any]]) -> np.ndarray:
    kind = [(name, object) for name in values[0]]
    return np.array([tuple(v.values()) for v in values], dtype=kind)


def mat(make: Callable[[Hit], dict[str, Any]], **options: Any) -> Writer:
    return lambda path, hits: scipy.io.savemat(path, make(hits[0]), **options)


def _nested(hit: Hit) -> dict[str, Any]:
    felt = {
        name: {"data": v, "unit": "g"}
        for name, v in zip("xyz", hit.acceleration_m_s2 / G, strict=True)
    }
    force = {"data": hit.force_n / 1000, "unit": "kN"}
    return {"test": {"hit": hit.axis, "time": times(hit), "force": force, "acc": felt}}


def _axes_of_one(hit: Hit) -> dict[str, Any]:
    """Fields named x, y, z beside a field y that is the force's value."""
    felt = dict(zip("xyz", hit.acceleration_m_s2 / G, strict=True))
    force = {"y": hit.force_n, "unit": "N"}
    return {
        "rec": {"Fs": hit.sampling_rate_hz, "F": force, "A": {**felt, "unit": "g"}},
        "hit": hit.axis,
    }


def _channels(hit: Hit) -> dict[str, Any]:
    each = [
        {"name": n, "unit": u, "data": v, "samplerate": hit.sampling_rate_hz}
        for n, u, v in zip(NAMES, UNITS, signals(hit), strict=True)
    ]
    return {"channels": structs(each), "hit": hit.axis}


def _program(hit: Hit) -> dict[str, Any]:
    x = {"start_value": 0.0, "increment": 1 / hit.sampling_rate_hz,
         "number_of_values": hit.force_n.size, "quantity": {"label": "s"}}  # fmt: skip
    made: dict[str, Any] = {"hit": hit.axis}
    for number, (name, unit, v) in enumerate(zip(NAMES, UNITS, signals(hit), strict=True)):
        y = {
            "values": v[:, None],
            "quantity": {"label": unit, "unit_transformation": {"factor": 1.0}},
        }
        made[f"Signal_{number}"] = {"x_values": x, "y_values": y, "function_record": {"name": name}}
    return made


def _program_matrix(hit: Hit) -> dict[str, Any]:
    x = {"start_value": 0.0, "increment": 1 / hit.sampling_rate_hz}
    y = {"values": np.column_stack(signals(hit)), "quantity": {"label": cells(UNITS)}}
    return {"Signal": {"x_values": x, "y_values": y, "function_record": {"name": cells(NAMES)}},
            "hit": hit.axis}  # fmt: skip


def _scope(hit: Hit) -> dict[str, Any]:
    """Each channel with times of its own."""
    each = [{"t": times(hit) + 1.0, "y": v, "label": f"{n} ({u})"}
            for n, u, v in zip(NAMES, UNITS, signals(hit), strict=True)]  # fmt: skip
    return {"trace": structs(each), "hit": hit.axis}


def _program_times(hit: Hit) -> dict[str, Any]:
    """Each signal with its times as numbers."""
    made: dict[str, Any] = {"hit": hit.axis}
    for number, (name, unit, v) in enumerate(zip(NAMES, UNITS, signals(hit), strict=True)):
        x = {"values": 1e3 * times(hit), "quantity": {"label": "ms"}}
        y = {"values": v, "quantity": {"label": unit}}
        made[f"S{number}"] = {"x_values": x, "y_values": y, "function_record": {"name": name}}
    return made


def _array_of_hits(path: Path, hits: Sequence[Hit]) -> None:
    each = [{"hit": h.axis, "force_n": h.force_n, "a": np.column_stack(h.acceleration_m_s2),
             "a_names": cells(["a_x_m_s2", "a_y_m_s2", "a_z_m_s2"])} for h in hits]  # fmt: skip
    scipy.io.savemat(path, {"Fs": hits[0].sampling_rate_hz, "hits": structs(each)})


def _cell_of_hits(path: Path, hits: Sequence[Hit]) -> None:
    each = [
        {"hit": h.axis, "dt": 1 / h.sampling_rate_hz, "force_n": h.force_n}
        | dict(zip(("ax_g", "ay_g", "az_g"), h.acceleration_m_s2 / G, strict=True))
        for h in hits
    ]
    scipy.io.savemat(path, {"taps": cells(each)}, do_compression=True)


def _cell_columns(hit: Hit) -> dict[str, Any]:
    return {"data": cells([times(hit), *signals(hit)]), "names": cells(["Time", *NAMES]),
            "units": cells(["s", *UNITS]), "hit": hit.axis}  # fmt: skip


def _cell_table(hit: Hit) -> dict[str, Any]:
    table = np.empty((2, 5), dtype=object)
    named = [f"{n} [{u}]" for n, u in zip(NAMES, UNITS, strict=True)]
    table[:] = [["Time [s]", *named], [times(hit), *signals(hit)]]
    return {"table": table, "hit": hit.axis}


def _char_names(hit: Hit) -> dict[str, Any]:
    return {"data": np.column_stack(signals(hit)), "labels": np.array(NAMES), "hit": hit.axis,
            "units": np.array(UNITS), "fs": hit.sampling_rate_hz}  # fmt: skip


def v73(path: Path, tree: dict[str, Any]) -> None:
    """A MAT file of version 7.3: HDF5 with MATLAB's classes, cells and structs by references."""
    with h5py.File(path, "w", userblock_size=512) as file:
        _v73_level(file, file.create_group("#refs#"), tree)
    head = b"MATLAB 7.3 MAT-file".ljust(116) + bytes(8) + b"\x00\x02IM"
    with open(path, "r+b") as file:
        file.write(head)


def _v73_level(group: h5py.Group, refs: h5py.Group, tree: dict[str, Any]) -> None:
    for name, value in tree.items():
        if isinstance(value, dict):
            inner = group.create_group(name)
            inner.attrs["MATLAB_class"] = np.bytes_("struct")
            _v73_level(inner, refs, value)
        elif isinstance(value, np.ndarray) and value.dtype.names:
            inner = group.create_group(name)
            inner.attrs["MATLAB_class"] = np.bytes_("struct")
            for key in value.dtype.names:
                inner[key] = _v73_refs(refs, list(value[key]))
        elif isinstance(value, np.ndarray) and value.dtype == object:
            group[name] = _v73_refs(refs, list(value))
            group[name].attrs["MATLAB_class"] = np.bytes_("cell")
        elif isinstance(value, str):
            group[name] = np.frombuffer(value.encode("utf-16-le"), "<u2")[:, None]
            group[name].attrs["MATLAB_class"] = np.bytes_("char")
        else:
            group[name] = np.atleast_2d(np.asarray(value, dtype=float).T)
            group[name].attrs["MATLAB_class"] = np.bytes_("double")


def _v73_refs(refs: h5py.Group, values: list[Any]) -> np.ndarray:
    made = np.empty((len(values), 1), dtype=h5py.ref_dtype)
    for number, value in enumerate(values):
        name = f"r{len(refs)}"
        _v73_level(refs, refs, {name: value})
        made[number, 0] = refs[name].ref
    return made


def h5(path: Path, hits: Sequence[Hit], how: Callable[[h5py.Group, Hit], object]) -> None:
    with h5py.File(path, "w") as file:
        for number, hit in enumerate(hits):
            group = file if len(hits) == 1 else file.create_group(f"run{number}")
            group.attrs["hit"] = hit.axis
            how(group, hit)


def _h5_each(unit_key: str, **axis: float) -> Callable[[h5py.Group, Hit], None]:
    def write(group: h5py.Group, hit: Hit) -> None:
        for name, unit, values in zip(NAMES, UNITS, signals(hit), strict=True):
            dataset = group.create_dataset(name, data=values)
            dataset.attrs[unit_key] = unit
            for key, value in axis.items():
                dataset.attrs[key] = value

    return write


def _h5_scope(group: h5py.Group, hit: Hit) -> None:
    """Each channel a group of its times and values."""
    for name, unit, values in zip(NAMES, UNITS, signals(hit), strict=True):
        group[f"{name}/Time"], group[f"{name}/Value"] = times(hit), values
        group[f"{name}/Time"].attrs["unit"], group[f"{name}/Value"].attrs["unit"] = "s", unit


def _h5_matrix(group: h5py.Group, hit: Hit) -> None:
    """Channels in rows, as acquisition programs store them."""
    data = group.create_dataset("data", data=np.array(signals(hit)))
    data.attrs["channel_names"], data.attrs["units"] = list(NAMES), list(UNITS)
    data.attrs["sampling_frequency"] = hit.sampling_rate_hz


def _h5_table(group: h5py.Group, hit: Hit) -> None:
    columns = {
        "Time (s)": times(hit),
        **{f"{n} ({u})": v for n, u, v in zip(NAMES, UNITS, signals(hit), strict=True)},
    }
    rows = np.empty(hit.force_n.size, dtype=[(name, "f8") for name in columns])
    for name, values in columns.items():
        rows[name] = values
    group["table"] = rows


def late_h5(path: Path, hit: Hit, by: int, said: Callable[[float], object]) -> None:
    """Accelerations begin `by` samples after the force, as the attribute start_time says."""
    with h5py.File(path, "w") as file:
        for k, (name, unit, values) in enumerate(zip(NAMES, UNITS, signals(hit), strict=True)):
            skip = by if k else 0
            file[name] = values[skip:]
            stated = {"unit": unit, "fs": f"{hit.sampling_rate_hz} Hz",
                      "start_time": said(skip / hit.sampling_rate_hz)}  # fmt: skip
            file[name].attrs.update(stated)


def tdms(path: Path, hits: Sequence[Hit], extra: Sequence[Any] = (), **late: Any) -> None:
    """Waveforms; `late` are samples by which a channel began later, and how that is said."""
    from nptdms import ChannelObject, RootObject, TdmsWriter

    by, key = late.get("by", 0), late.get("key", "wf_start_time")
    first = np.datetime64("2026-03-01T08:00:00", "us")
    made = []
    for number, hit in enumerate(hits):
        for k, (name, unit, values) in enumerate(zip(NAMES, UNITS, signals(hit), strict=True)):
            skip = by if k else 0
            passed = skip / hit.sampling_rate_hz
            stated = {"unit_string": unit, "wf_increment": 1 / hit.sampling_rate_hz,
                      "wf_start_time": first, "wf_start_offset": 0.0}  # fmt: skip
            if key == "wf_start_time":
                stated[key] = first + np.timedelta64(round(passed * 1e6), "us")
            else:
                stated[key] = passed
            group = "hit" if len(hits) == 1 else f"hit {number}"
            made.append(ChannelObject(group, name, values[skip:], stated))
    with TdmsWriter(str(path)) as writer:
        writer.write_segment([RootObject({"hit": hits[0].axis}), *made, *extra])


def lvm_file(count: int = 1, **options: Any) -> Writer:
    return lambda path, hits: path.write_bytes(
        lvm(hits[:count], **options).replace("\n", "\r\n").encode("cp1252")
    )


ONE_HIT: dict[str, tuple[str, Writer]] = {
    "MAT: structs in structs": ("a.mat", mat(_nested)),
    "MAT: fields of one name in two structs": ("v.mat", mat(_axes_of_one)),
    "MAT: a list of channels": ("b.mat", mat(_channels)),
    "MAT: signals of a measuring program": ("c.mat", mat(_program, do_compression=True)),
    "MAT: one signal of many columns": ("d.mat", mat(_program_matrix)),
    "MAT: channels with times of their own": ("e.mat", mat(_scope)),
    "MAT: signals with times of their own": ("t.mat", mat(_program_times)),
    "HDF5: a group a channel": ("u.h5", lambda p, h: h5(p, h[:1], _h5_scope)),
    "MAT: a cell array of columns": ("f.mat", mat(_cell_columns)),
    "MAT: a cell array as a table": ("g.mat", mat(_cell_table)),
    "MAT: names in a matrix of characters": ("h.mat", mat(_char_names)),
    "MAT 4": ("i.mat", mat(_char_names, format="4")),
    "MAT 7.3: a list of channels": ("j.mat", lambda p, h: v73(p, _channels(h[0]))),
    "MAT 7.3: a cell array of columns": ("k.mat", lambda p, h: v73(p, _cell_columns(h[0]))),
    "HDF5: units and dt": ("l.h5", lambda p, h: h5(p, h[:1], _h5_each("units", dt=1 / 512))),
    "HDF5: unit and Fs": ("m.h5", lambda p, h: h5(p, h[:1], _h5_each("unit", Fs=512, t0=3.0))),
    "HDF5: channels in rows": ("n.h5", lambda p, h: h5(p, h[:1], _h5_matrix)),
    "HDF5: a table": ("o.h5", lambda p, h: h5(p, h[:1], _h5_table)),
    "LVM: one x column": ("p.lvm", lvm_file()),
    "LVM: no x column": ("q.lvm", lvm_file(x="No")),
    "LVM: many x columns, decimal commas": ("r.lvm", lvm_file(x="Multi", decimal=",")),
    "LVM: commas between": ("s.lvm", lvm_file(separator=",")),
}

# Three hits each.
SPECIAL = "***Start_Special***\nPacket_Notes\nname\tvalue\n1.0\t2.0\n\n***End_Special***"
MANY_HITS: dict[str, tuple[str, Writer]] = {
    "MAT: an array of structs": ("a.mat", _array_of_hits),
    "MAT: a cell array of structs": ("b.mat", _cell_of_hits),
    "HDF5: a group a hit": ("c.h5", lambda p, h: h5(p, h, _h5_each("units", dt=1 / 512))),
    "TDMS: a group a hit": ("d.tdms", tdms),
    "LVM: a segment a hit": ("e.lvm", lvm_file(3)),
    "LVM: special blocks between": ("f.lvm", lvm_file(3, between=SPECIAL)),
}
