"""Modes of a matrix of FRFs as files for other programs: universal file, tables."""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from planner.errors import writing
from planner.export.uff import Dataset, function, mode_set, write_sets
from planner.frf.matrix import FrfMatrix
from planner.modal.matrix_modes import MatrixModes
from planner.recording.points import Dof
from planner.recording.records import AXES
from planner.recording.uff import Geometry
from planner.version import __version__

MODES = ("mode", "frequency_hz", "frequency_sd_hz", "scatter_hz", "damping_ratio",
         "damping_sd", "mpc", "mpd_deg", "modal_mass_kg", "probability")  # fmt: skip
VALUES = "mode", "node", "direction", "re", "im", "sd"
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
        write_sets(files[0], [_header(what), *_geometry(what), *_shapes(what)])
        write_sets(files[1], [_header(what), *_frfs(what)])
        _table(files[2], MODES, _mode_rows(what.found))
        shapes = [(k, "", what.found.dofs, m.shape, m.shape_sd)
                  for k, m in enumerate(what.found.modes, 1) if m.shape_sd is not None]  # fmt: skip
        _table(files[3], VALUES, [(k, *values) for k, _, *values in _rows(shapes)])
        if apart := _vectors(what):
            files += [folder / name for name in ("vectors.uff", "vectors.csv")]
            write_sets(files[4], [_header(what), *_geometry(what), *_vector_sets(what, apart)])
            _table(files[5], ("mode", "side", *VALUES[1:]), _rows(apart))
    return files


def _header(what: Exported) -> Dataset:
    mark = "simulated recordings" if what.matrix.simulated else "measured"
    return {
        "type": 151, "model_name": "modal analysis", "description": mark, "db_app": "planner",
        "program": f"planner {__version__}", "version_db1": "0", "version_db2": "0",
        "file_type": "0",
    }  # fmt: skip


def _geometry(what: Exported) -> list[Dataset]:
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


def _traces(what: Exported, numbers: dict[str, int]) -> list[Dataset]:
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


def _shapes(what: Exported) -> list[Dataset]:
    sets = []
    for k, mode in enumerate(what.found.modes, 1):
        nodes, motion = _motion(what.found.dofs, mode.shape, what.numbers)
        a = 2j * mode.pole.imag if mode.scaled else 0j
        said = "unit modal mass, kg^-1/2" if mode.scaled else "not scaled"
        texts = _named(k, mode.frequency_hz), said
        one = mode_set(k, mode.pole, texts, nodes, motion.real if what.real else motion, a)
        if what.real:
            one |= {
                "analysis_type": 2, "data_type": 2, "freq": mode.frequency_hz,
                "modal_m": 1.0 if mode.scaled else 0.0, "modal_damp_vis": mode.damping_ratio,
                "modal_damp_his": 0.0,
            }  # fmt: skip
        sets.append(one)
    return sets


def _named(k: int, frequency_hz: float) -> str:
    return f"mode {k}: {frequency_hz:.6g} Hz"


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


def _vector_sets(what: Exported, apart: Vectors) -> list[Dataset]:
    """The format knows no left vectors: the second line of each set says which it is."""
    sets = []
    for k, side, dofs, vector, _ in apart:
        mode, (nodes, motion) = what.found.modes[k - 1], _motion(dofs, vector, what.numbers)
        texts = _named(k, mode.frequency_hz), f"{side} vector: R = right left^T / (2 i w_d)"
        sets.append(mode_set(k, mode.pole, texts, nodes, motion, 2j * mode.pole.imag))
    return sets


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


def _frfs(what: Exported) -> list[Dataset]:
    matrix, numbers = what.matrix, what.numbers
    title = "simulated" if matrix.simulated else "FRF"
    felt, hit = ([(numbers[dof.node], dof) for dof in of] for of in
                 (matrix.responses, matrix.references))  # fmt: skip
    return [
        function(matrix.accelerance[o, i], matrix.frequency_hz, felt[o], hit[i], title,
                 matrix.scaled)
        for o, i in zip(*np.nonzero(matrix.measured), strict=True)
    ]  # fmt: skip


def _mode_rows(found: MatrixModes) -> list[tuple[Any, ...]]:
    return [
        (k, m.frequency_hz, m.frequency_sd_hz, m.scatter_hz, m.damping_ratio, m.damping_sd,
         m.collinearity, m.deviation_deg, m.modal_mass_kg if m.scaled else "", m.probability)
        for k, m in enumerate(found.modes, 1)
    ]  # fmt: skip


def _rows(vectors: Vectors) -> list[tuple[Any, ...]]:
    """Of vectors (n,) mode, side, degrees of freedom, real and imaginary part, and sd."""
    return [
        (k, side, dof.node, dof.direction, float(value.real), float(value.imag), float(error))
        for k, side, dofs, vector, sd in vectors
        for dof, value, error in zip(dofs, vector, sd, strict=True)
    ]


def _table(path: Path, names: tuple[str, ...], rows: list[tuple[Any, ...]]) -> None:
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(rows)
