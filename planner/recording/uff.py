"""Universal files: time histories and FRFs (datasets 58 and 58b), and where points lie."""

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.errors import ForeignFileError, InputError
from planner.recording.column_names import MOTIONS, Unit, lookup, lookup_ratio
from planner.recording.records import (
    MAX_BYTES,
    Channel,
    End,
    FrfRecord,
    Record,
    TimeRecord,
    check_numbers,
)
from planner.recording.sampling import Axis, aligned, sampling_rate

if TYPE_CHECKING:
    import pyuff

# UFF 58, record 8 and 9: specific data types.
_QUANTITY = {8: "displacement", 11: "velocity", 12: "acceleration", 13: "force", 9: "force",
             15: "pressure", 21: "pressure"}  # fmt: skip
_SI = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s^2", "force": "N",
       "pressure": "Pa"}  # fmt: skip
_FUNCTIONS = {0: "general data", 1: "time histories", 2: "auto-spectra", 3: "cross-spectra",
              4: "FRFs", 5: "transmissibilities", 6: "coherences", 9: "power spectral densities",
              12: "spectra"}  # fmt: skip
HEAD = 1 << 16  # bytes in which a first dataset begins
_NONE = ("", "NONE", "NULL")
# Dataset 164, record 1 and 2: how many of a system's units of length and of force are one of SI's.
_SYSTEMS = {1: (1.0, 1.0), 2: (3.28084, 0.224809), 3: (1.0, 0.101972), 4: (3.28084, 7.23301),
            5: (1e3, 1e3), 6: (1e2, 1e2), 7: (39.3701, 0.224809), 8: (1e3, 0.101972),
            10: (1e3, 1.0)}  # fmt: skip
# Datasets: nodes (15 and 2411), trace lines (82), units (164).
NODES, TRACES, UNITS = (15, 2411), 82, 164
SUFFIXES = (".uff", ".unv", ".uf58", ".txt")
LAST_LINE = 6  # values: a last line may be filled up


def read_uff(path: Path) -> tuple[Record, ...]:
    """Records of a universal file. Raises InputError saying what it holds instead."""
    sets = [s for s in _sets(path) if s.get("type") == 58]
    if not sets:
        raise InputError(f"{path} holds no dataset 58; export time histories as UFF 58 or 58b.")
    kinds = {int(s["func_type"]) for s in sets}
    times = [s for s in sets if s["func_type"] == 1]
    frfs = [s for s in sets if s["func_type"] == 4]
    if not times and not frfs:
        names = ", ".join(_FUNCTIONS.get(k, f"function type {k}") for k in sorted(kinds))
        raise InputError(
            f"{path} holds {names}, neither time histories nor FRFs; export one of these."
        )
    for number, s in enumerate(times + frfs, 1):
        data = np.asarray(s["data"])
        if len(data) != int(s["num_pts"]) or len(data) < 2:
            raise InputError(
                f"{path}: dataset {number} states {s['num_pts']} points and holds {len(data)}; "
                f"the file is cut off, export it again."
            )
        check_numbers(path, f"dataset {number}", data)
    records: list[Record] = [_time_record(path, hit) for hit in _by_hit(times)]
    if frfs:
        coherences = [s for s in sets if s["func_type"] == 6]
        records.append(_frf_record(path, frfs, coherences))
    return tuple(records)


@contextmanager
def quiet() -> Iterator[None]:
    """Without the chatter of the library that reads and writes universal files."""
    with warnings.catch_warnings(), redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        yield


@contextmanager
def opened(path: Path) -> Iterator[tuple["pyuff.UFF", list[int]]]:
    """A universal file and the kinds of its datasets."""
    import pyuff

    with quiet():
        file = pyuff.UFF(str(path))
        yield file, [int(kind) for kind in file.get_set_types()]


def _sets(path: Path) -> list[dict[str, Any]]:
    with open(path, "rb") as file:
        if b"-1" not in file.read(HEAD).split():
            raise ForeignFileError(f"{path} is no universal file (no dataset in it); export again.")
        file.seek(-min(path.stat().st_size, 256), 2)
        end = file.read().rstrip()
    if not end.endswith(b"-1"):  # the parser would leave out the dataset that is cut off
        raise InputError(f"{path} does not end with a whole dataset; export it again.")
    with opened(path) as (file, kinds):
        if not kinds:
            raise ForeignFileError(f"{path} is no universal file (no dataset in it); export again.")
        if 0 in kinds:  # bytes between two datasets are damaged
            raise InputError(f"{path} holds a dataset without a number; export it again.")
        sets: list[Any] = [file.read_sets(i) for i in range(len(kinds))]
        blocks = file._block_ind  # where datasets begin and end, which nothing public says
    system = None
    for kind, one, (first, end) in zip(kinds, sets, blocks, strict=True):
        if kind == 164:
            system = one
        elif kind == 58:
            one["system"] = system
            if one["binary"] and len(one["data"]) != int(one["num_pts"]):
                _read_mixed(path, one, int(first), int(end))
            count = int(one["num_pts"])  # holds: what fills up the last line of text is left out
            if not one["binary"] and 0 < len(one["data"]) - count < LAST_LINE:
                one["x"], one["data"] = one["x"][:count], one["data"][:count]
    return sets


def _system(path: Path, s: dict[str, Any] | None) -> tuple[float, float]:
    """Units of length and of force that are one of SI's, as a dataset 164 states them, if any."""
    if s is None:
        return _SYSTEMS[1]
    stated = float(s["length"]), float(s["force"])
    known = _SYSTEMS.get(int(s["units_code"]), stated)
    if not all(f > 0 and abs(f / k - 1) < 0.01 for f, k in zip(stated, known, strict=True)):
        raise InputError(
            f"{path}: dataset 164 states the system of units {s['units_code']} and factors "
            f"{stated[0]:g} (length) and {stated[1]:g} (force), which contradict it; correct it."
        )
    return stated


def _read_mixed(path: Path, s: dict[str, Any], first: int, end: int) -> None:
    """Values of double precision over an uneven abscissa of single precision (cases 6 and 8)."""
    with open(path, "rb") as file:
        file.seek(first)
        body = b"".join(file.read(end - first + 1).splitlines(keepends=True)[13:])
    order = "<" if s["byte_ordering"] == 1 else ">"
    parts = 2 if s["ord_data_type"] in (5, 6) else 1
    line = np.dtype([("x", f"{order}f4"), ("y", f"{order}f8", (parts,))])
    count = int(s["num_pts"])
    if s["abscissa_spacing"] == 0 and 0 <= len(body) - count * line.itemsize <= 2:
        values = np.frombuffer(body, line, count)
        s["x"] = values["x"].astype(float)
        s["data"] = values["y"] @ np.array([1.0, 1j][:parts])


def _simulated(sets: list[dict[str, Any]]) -> bool:
    texts = (str(s.get(f"id{i}", "")) for s in sets for i in range(1, 6))
    return any("simulated" in text.lower() for text in texts)


def _unit(path: Path, s: dict[str, Any], axis: str = "ordinate") -> Unit:
    """Unit of an axis: by its label, without one of the file's system of units, which is SI's."""
    stated = _QUANTITY.get(int(s[f"{axis}_spec_data_type"]))
    label = str(s[f"{axis}_axis_units_lab"]).strip()
    if label.upper() in _NONE:
        if stated is None:
            return Unit("unknown", "", 1.0)
        length, force = _system(path, s["system"])
        factor = {"force": 1 / force, "pressure": length**2 / force}.get(stated, 1 / length)
        return Unit(stated, _SI[stated], factor)
    known = lookup(label)
    if known is None:
        return Unit(stated or "unknown", "", 1.0)
    if stated and known.quantity != stated:
        raise InputError(
            f"{path} labels a record of {stated} with the unit {label}; correct the export."
        )
    return known


def _by_hit(sets: list[dict[str, Any]]) -> list[list[dict[str, Any]]]:
    """Time histories hit by hit, where a file holds a whole run of them.

    The n-th force and the n-th history of each response are the n-th hit. Where responses are not
    equally many, as of a sensor that roves, a hit is a force and what follows it (or what it
    follows), if that is equally much each time; else all stay one record.
    """
    each: dict[tuple, list[dict[str, Any]]] = {}
    for s in sets:
        force = _QUANTITY.get(int(s["ordinate_spec_data_type"])) == "force"
        response = int(s["rsp_node"]), int(s["rsp_dir"])
        each.setdefault(("force",) if force else response, []).append(s)
    counts = {len(of_one) for of_one in each.values()}
    if ("force",) in each and len(counts) == 1:
        return [list(hit) for hit in zip(*each.values(), strict=True)]
    forces = {id(s) for s in each.get(("force",), [])}
    size = len(sets) // max(1, len(forces))
    runs = [sets[i : i + size] for i in range(0, len(sets), size)] if size > 1 else []
    for place in (0, -1):
        if runs and all({id(s) for s in run} & forces == {id(run[place])} for run in runs):
            return runs
    return [sets] if sets else []


def _time_record(path: Path, sets: list[dict[str, Any]]) -> TimeRecord:
    rates = {round(_rate(path, s), 6) for s in sets}
    if len(rates) > 1:
        raise InputError(f"{path} mixes records of different sampling; export one hit, one rate.")
    common = {int(s["ref_dir"]) for s in sets if int(s["ref_dir"])}
    hit_nodes = {int(s["ref_node"]) for s in sets if int(s["ref_dir"]) and int(s["ref_node"])}
    channels = []
    for s in sets:
        quantity, unit, factor = _unit(path, s)
        direction, node = int(s["rsp_dir"]), int(s["rsp_node"])
        if quantity == "force":
            direction = int(s["ref_dir"]) or (common.pop() if len(common) == 1 else direction)
            node = int(s["ref_node"]) or (hit_nodes.pop() if len(hit_nodes) == 1 else node)
        name = str(s["rsp_ent_name"]).strip()
        name = name if name.upper() != "NONE" else f"{quantity} {direction:+d}"
        samples = np.asarray(s["data"], dtype=float) * factor
        channels.append(Channel(name, quantity, unit, direction, samples, str(node)))
    rate = _rate(path, sets[0])
    together, cut = aligned(path, channels, [Axis(offset=float(s["x"][0])) for s in sets], rate)
    return TimeRecord(path, rate, together, cut, _simulated(sets))


def _rate(path: Path, s: dict[str, Any]) -> float:
    if int(s["abscissa_spacing"]) == 1:
        step = float(s["abscissa_inc"])
        if not 1e-9 < step < 1e6:
            raise InputError(f"{path} states a sampling step of {step} s; correct the export.")
        return 1 / step
    return sampling_rate(path, np.asarray(s["x"], dtype=float))


def _frf_record(
    path: Path, sets: list[dict[str, Any]], coherences: list[dict[str, Any]]
) -> FrfRecord:
    frequency = np.asarray(sets[0]["x"], dtype=float)
    values, coherence, kinds = [], [], set()
    found = {_place(c): c for c in coherences}
    for s in sets:
        if len(s["x"]) != len(frequency) or not np.allclose(s["x"], frequency):
            raise InputError(f"{path} mixes FRFs over different frequency lines; export one grid.")
        quantity, unit, factor = _unit_of_ratio(path, s)
        kinds.add((quantity, unit))
        values.append(np.asarray(s["data"], dtype=complex) * factor)
        own = np.real(found.get(_place(s), {}).get("data", ()))
        coherence.append(own if len(own) == len(frequency) else np.full(len(frequency), np.nan))
    if len(kinds) != 1:
        raise InputError(f"{path} mixes FRFs of different kinds; export accelerance only.")
    quantity, unit = kinds.pop()
    remarks = () if unit else ("The FRFs' unit is not stated.",)
    places = tuple(zip(_ends(sets, "rsp"), _ends(sets, "ref"), strict=True))
    return FrfRecord(
        path, frequency, np.array(values), places, quantity, unit, np.array(coherence), remarks,
        _simulated(sets),
    )  # fmt: skip


def _place(s: dict[str, Any]) -> tuple[int, ...]:
    """Where it was felt and hit: nodes and directions."""
    return tuple(int(s[f"{end}_{what}"]) for end in ("rsp", "ref") for what in ("node", "dir"))


def _ends(sets: list[dict[str, Any]], end: str) -> list[End]:
    """One end ("rsp", "ref") of each: nodes are numbers, else the entities' names."""
    nodes = [str(int(s[f"{end}_node"])) for s in sets]
    if set(nodes) == {"0"}:
        names = [str(s[f"{end}_ent_name"]).strip() for s in sets]
        nodes = ["0" if name.upper() in _NONE else name for name in names]
    return [End(node, int(s[f"{end}_dir"])) for node, s in zip(nodes, sets, strict=True)]


def _unit_of_ratio(path: Path, s: dict[str, Any]) -> Unit:
    """Kind and unit of an FRF: the ratio that its label states, else numerator and denominator."""
    ratio = lookup_ratio(str(s["ordinate_axis_units_lab"]))
    if ratio is None:
        top, bottom = _unit(path, s), _unit(path, s, "orddenom")
        if top.quantity not in MOTIONS or bottom.quantity != "force":
            return Unit("unknown", "", 1.0)
        unit = f"{top.si}/N" if top.si and bottom.si else ""
        return Unit(MOTIONS[top.quantity], unit, top.factor / bottom.factor)
    stated = MOTIONS.get(_QUANTITY.get(int(s["ordinate_spec_data_type"]), ""), ratio.quantity)
    if stated != ratio.quantity:
        raise InputError(
            f"{path} labels {stated} with {str(s['ordinate_axis_units_lab']).strip()}, which is "
            f"{ratio.quantity}; correct the export."
        )
    return ratio


@dataclass(frozen=True, eq=False)
class Geometry:
    """Points by name and what joins them: position_m (n, 3), lines as pairs of names."""

    nodes: tuple[str, ...]
    position_m: np.ndarray
    lines: tuple[tuple[str, str], ...] = ()

    def at(self, node: str) -> np.ndarray | None:
        """Position (3,) of a node, None where it is not known."""
        return self.position_m[self.nodes.index(node)] if node in self.nodes else None


def read_geometry(paths: tuple[Path, ...]) -> Geometry | None:
    """Nodes and trace lines that universal files hold, the later ones first; None without nodes.

    Lengths are in m where a file states its units (dataset 164), else as they stand.
    """
    position: dict[str, np.ndarray] = {}
    lines: list[tuple[str, str]] = []
    for path in paths:
        if path.suffix.lower() in SUFFIXES and path.stat().st_size <= MAX_BYTES:
            found: list[Any] = []  # what cannot be read is left out: it is no measurement
            with opened(path) as (file, kinds):
                for index, kind in enumerate(kinds):
                    if kind in (*NODES, TRACES, UNITS):
                        with suppress(Exception):
                            found.append(file.read_sets(index))
            factors = [float(s.get("length", 1.0)) for s in found if s["type"] == UNITS]
            # A dataset 164 states how many of the file's lengths make a metre.
            scale = 1 / factors[-1] if factors and factors[-1] > 0 else 1.0
            for s in found:
                if s["type"] in NODES:
                    places = scale * np.stack([np.asarray(s[axis], float) for axis in "xyz"], 1)
                    names = (str(int(number)) for number in s["node_nums"])
                    position |= dict(zip(names, places, strict=True))
                elif s["type"] == TRACES:
                    pairs = pairwise(int(n) for n in s["nodes"])  # 0 lifts the pen
                    lines += [(str(a), str(b)) for a, b in pairs if a and b and a != b]
    if not position:
        return None
    known = tuple(dict.fromkeys(line for line in lines if set(line) <= set(position)))
    return Geometry(tuple(position), np.array(list(position.values())), known)
