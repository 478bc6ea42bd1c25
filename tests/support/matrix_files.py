"""Universal files of a matrix of FRFs, as analysers export them."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from planner.export.uff import write_sets
from planner.frf.matrix import FrfMatrix
from planner.frf.synthesis import convert

KINDS = {"accelerance": (12, "m/s^2"), "mobility": (11, "m/s"), "receptance": (8, "m")}


def write_matrix(
    path: Path,
    matrix: FrfMatrix,
    kind: str = "accelerance",
    turned: Iterable[int] = (),
    before: Iterable[dict[str, Any]] = (),
    entries: Iterable[tuple[int, int]] | None = None,
    **fields: Any,
) -> Path:
    """Write FRFs of `entries` (default: all measured) as UFF 58b after the sets of `before`.

    Responses in `turned` (indices) are written along their negative direction.
    """
    number, unit = KINDS[kind]
    h = convert(matrix.frequency_hz, matrix.accelerance, "accelerance", kind)
    sets = list(before)
    pairs = zip(*np.nonzero(matrix.measured), strict=True) if entries is None else entries
    for o, i in pairs:
        felt, hit, sign = matrix.responses[o], matrix.references[i], -1 if o in turned else 1
        sets.append(
            {
                "type": 58, "binary": 1, "func_type": 4, "id1": "simulated",
                "rsp_node": int(felt.node), "rsp_dir": sign * felt.number,
                "ref_node": int(hit.node), "ref_dir": hit.number,
                "data": sign * h[o, i],
                "x": matrix.frequency_hz, "abscissa_spacing": 1, "abscissa_spec_data_type": 18,
                "ordinate_spec_data_type": number, "ordinate_axis_units_lab": unit,
                "orddenom_spec_data_type": 13, "orddenom_axis_units_lab": "N", **fields,
            }
        )  # fmt: skip
    write_sets(path, sets)
    return path


def transposed(matrix: FrfMatrix) -> FrfMatrix:
    """Responses and references exchanged, as Maxwell's reciprocity allows."""
    return replace(
        matrix,
        responses=matrix.references,
        references=matrix.responses,
        accelerance=np.swapaxes(matrix.accelerance, 0, 1),
    )
