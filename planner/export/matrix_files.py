"""Modes of a matrix of FRFs as files for other programs: universal file, tables."""

import csv
import io
import warnings
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from planner.errors import writing
from planner.frf.matrix import FrfMatrix
from planner.modal.matrix_modes import MatrixModes
from planner.modal.modes import Mode
from planner.recording.dof import Dof
from planner.recording.geometry import Geometry
from planner.version import __version__

AXES = ("x", "y", "z")
TRACE = 240  # nodes of a trace line: the format allows 250


@dataclass(frozen=True, eq=False)
class Exported:
    """What is written: FRFs as they were measured, modes, and where the points lie."""

    matrix: FrfMatrix
    found: MatrixModes
    geometry: Geometry | None
    real: bool = False  # shapes are real normal modes

    @property
    def numbers(self) -> dict[str, int]:
        """Number of every node; names that are no number count on from the largest."""
        names = [dof.node for dof in (*self.matrix.responses, *self.matrix.references)]
        names += [dof.node for dof in self.found.dofs]
        names += list(self.geometry.nodes) if self.geometry else []
        known = {name: int(name) for name in names if name.isdigit()}
        last = max(known.values(), default=0)
        others = dict.fromkeys(name for name in names if name not in known)
        return known | {name: last + 1 + k for k, name in enumerate(others)}


def export(what: Exported, folder: Path) -> list[Path]:
    """Write modes.uff (151, 164, 15, 2411, 82, 55), frfs.uff (58), modes.csv and shapes.csv.

    And vectors.uff (55) and vectors.csv: right and left vectors, where rows and columns are tied.
    """
    with writing(folder, "another folder"):
        folder.mkdir(parents=True, exist_ok=True)
        files = [folder / name for name in ("modes.uff", "frfs.uff", "modes.csv", "shapes.csv")]
        _universal(files[0], [_header(what), *_geometry(what), *_shapes(what)])
        _universal(files[1], [_header(what), *_frfs(what)])
        _modes_table(what.found, files[2])
        _shapes_table(what.found, files[3])
        if apart := _vectors(what):
            files += [folder / name for name in ("vectors.uff", "vectors.csv")]
            _universal(files[4], [_header(what), *_geometry(what), *_vector_sets(what, apart)])
            _vectors_table(apart, files[5])
    return files


def _universal(path: Path, sets: list[dict[str, Any]]) -> None:
    """One dataset after the other; pyuff reads the whole file again after each it appends."""
    import pyuff

    with TemporaryDirectory() as aside, open(path, "wb") as file:
        for k, one in enumerate(sets):
            piece = Path(aside) / f"{k}.uff"
            with warnings.catch_warnings(), redirect_stdout(io.StringIO()):
                warnings.simplefilter("ignore")
                pyuff.UFF(str(piece)).write_sets([one], "add")
            file.write(piece.read_bytes())


def _header(what: Exported) -> dict[str, Any]:
    mark = "simulated recordings" if what.matrix.simulated else "measured"
    return {
        "type": 151, "model_name": "modal analysis", "description": mark, "db_app": "planner",
        "program": f"planner {__version__}", "version_db1": "0", "version_db2": "0",
        "file_type": "0",
    }  # fmt: skip


def _geometry(what: Exported) -> list[dict[str, Any]]:
    units = {
        "type": 164, "units_code": 1, "units_description": "SI: Meter (newton)", "temp_mode": 1,
        "length": 1.0, "force": 1.0, "temp": 1.0, "temp_offset": 273.15,
    }  # fmt: skip
    if what.geometry is None:
        return [units]
    numbers = what.numbers
    nodes = [numbers[name] for name in what.geometry.nodes]
    zero = [0] * len(nodes)
    x, y, z = what.geometry.position_m.T.tolist()
    place = {"node_nums": nodes, "def_cs": zero, "disp_cs": zero, "color": zero,
             "x": x, "y": y, "z": z}  # fmt: skip
    return [units, {"type": 15, **place}, {"type": 2411, **place}, *_traces(what, numbers)]


def _traces(what: Exported, numbers: dict[str, int]) -> list[dict[str, Any]]:
    """Trace lines; neighbours that follow one another are drawn without lifting the pen."""
    assert what.geometry is not None
    found: list[list[int]] = [[]]
    for a, b in what.geometry.lines:
        nodes = found[-1]
        first, second = numbers[a], numbers[b]
        more = (
            [second] if nodes and nodes[-1] == first else ([0] if nodes else []) + [first, second]
        )
        if len(nodes) + len(more) > TRACE:
            found.append([first, second])
        else:
            nodes += more
    return [
        {"type": 82, "trace_num": k + 1, "n_nodes": len(nodes), "color": 0,
         "id": f"lines {k + 1}", "nodes": np.array(nodes)}
        for k, nodes in enumerate(found) if nodes
    ]  # fmt: skip


def _shapes(what: Exported) -> list[dict[str, Any]]:
    sets = []
    for k, mode in enumerate(what.found.modes, 1):
        nodes, motion = _motion(what.found.dofs, mode.shape, what.numbers)
        a = 2j * mode.pole.imag if mode.scaled else 0j
        said = "unit modal mass, kg^-1/2" if mode.scaled else "not scaled"
        one = _complex_mode(k, mode, said, nodes, motion.real if what.real else motion, a)
        if what.real:
            one |= {
                "analysis_type": 2, "data_type": 2, "freq": mode.frequency_hz,
                "modal_m": 1.0 if mode.scaled else 0.0, "modal_damp_vis": mode.damping_ratio,
                "modal_damp_his": 0.0,
            }  # fmt: skip
        sets.append(one)
    return sets


def _complex_mode(
    k: int, mode: Mode, said: str, nodes: list[int], motion: np.ndarray, a: complex
) -> dict[str, Any]:
    """Dataset 55 of a vector (n, 3) of a mode, counted from 1; `said` is its second line."""
    columns = map(np.ascontiguousarray, motion.T)
    return {
        "type": 55, "id1": f"mode {k}: {mode.frequency_hz:.6g} Hz", "id2": said, "model_type": 1,
        "data_ch": 2, "spec_data_type": 8, "load_case": 0, "mode_n": k, "node_nums": nodes,
        "n_data_per_node": 3, "analysis_type": 3, "data_type": 5, "eig": mode.pole, "modal_a": a,
        "modal_b": -mode.pole * a, **dict(zip(("r1", "r2", "r3"), columns, strict=True)),
    }  # fmt: skip


Vectors = list[tuple[int, str, tuple[Dof, ...], np.ndarray, np.ndarray]]


def _vectors(what: Exported) -> Vectors:
    """Mode (from 1), side, its degrees of freedom, vector and sd: right before left."""
    matrix = what.matrix
    return [
        (k, side, dofs, vector, sd)
        for k, mode in enumerate(what.found.modes, 1)
        if (v := mode.vectors) is not None
        for side, dofs, vector, sd in (
            ("right", matrix.responses, v.right, v.right_sd),
            ("left", matrix.references, v.left, v.left_sd),
        )
    ]


def _vector_sets(what: Exported, apart: Vectors) -> list[dict[str, Any]]:
    """The format knows no left vectors: the second line of each set says which it is."""
    sets = []
    for k, side, dofs, vector, _ in apart:
        mode, (nodes, motion) = what.found.modes[k - 1], _motion(dofs, vector, what.numbers)
        said = f"{side} vector: R = right left^T / (2 i w_d)"
        sets.append(_complex_mode(k, mode, said, nodes, motion, 2j * mode.pole.imag))
    return sets


def _vectors_table(apart: Vectors, path: Path) -> None:
    rows = [
        (k, side, dof.node, dof.direction, float(value.real), float(value.imag), float(error))
        for k, side, dofs, vector, sd in apart
        for dof, value, error in zip(dofs, vector, sd, strict=True)
    ]
    _table(path, ("mode", "side", "node", "direction", "re", "im", "sd"), rows)


def _motion(
    dofs: tuple[Dof, ...], shape: np.ndarray, numbers: dict[str, int]
) -> tuple[list[int], np.ndarray]:
    """Node numbers (n,) and their motion along x, y and z (n, 3); scalars go along z."""
    nodes = list(dict.fromkeys(numbers[dof.node] for dof in dofs if not dof.is_turn))
    place = {node: k for k, node in enumerate(nodes)}
    motion = np.zeros((len(nodes), 3), complex)
    for dof, value in zip(dofs, shape, strict=True):
        if not dof.is_turn:
            axis = AXES.index(dof.direction) if dof.direction in AXES else 2
            motion[place[numbers[dof.node]], axis] = value
    return nodes, motion


def _frfs(what: Exported) -> list[dict[str, Any]]:
    matrix, numbers = what.matrix, what.numbers
    frequency = matrix.frequency_hz
    even = bool(np.allclose(np.diff(frequency), frequency[1] - frequency[0], rtol=1e-6))
    kind = {"ordinate_spec_data_type": 12, "ordinate_axis_lab": "Acceleration",
            "ordinate_axis_units_lab": "m/s^2", "orddenom_spec_data_type": 13,
            "orddenom_axis_lab": "Force", "orddenom_axis_units_lab": "N"}  # fmt: skip
    return [
        {
            "type": 58, "binary": 0, "func_type": 4,
            "id1": "simulated" if matrix.simulated else "FRF", "id2": "planner",
            "rsp_node": numbers[matrix.responses[o].node], "rsp_dir": matrix.responses[o].number,
            "ref_node": numbers[matrix.references[i].node], "ref_dir": matrix.references[i].number,
            "data": matrix.accelerance[o, i], "x": frequency, "abscissa_spacing": int(even),
            "abscissa_spec_data_type": 18, "abscissa_axis_lab": "Frequency",
            "abscissa_axis_units_lab": "Hz", **(kind if matrix.scaled else {}),
        }
        for o, i in zip(*np.nonzero(matrix.measured), strict=True)
    ]  # fmt: skip


def _modes_table(found: MatrixModes, path: Path) -> None:
    names = ("mode", "frequency_hz", "frequency_sd_hz", "scatter_hz", "damping_ratio",
             "damping_sd", "mpc", "mpd_deg", "modal_mass_kg", "probability")  # fmt: skip
    rows = [
        (k + 1, m.frequency_hz, m.frequency_sd_hz, m.scatter_hz, m.damping_ratio, m.damping_sd,
         m.collinearity, m.deviation_deg, m.modal_mass_kg if m.scaled else "", m.probability)
        for k, m in enumerate(found.modes)
    ]  # fmt: skip
    _table(path, names, rows)


def _shapes_table(found: MatrixModes, path: Path) -> None:
    names = "mode", "node", "direction", "re", "im", "sd"
    rows = [
        (k + 1, dof.node, dof.direction, float(value.real), float(value.imag), float(sd))
        for k, mode in enumerate(found.modes)
        if mode.shape_sd is not None
        for dof, value, sd in zip(found.dofs, mode.shape, mode.shape_sd, strict=True)
    ]
    _table(path, names, rows)


def _table(path: Path, names: tuple[str, ...], rows: list[tuple[Any, ...]]) -> None:
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(rows)
