"""Universal files: FRFs and coherences as dataset 58, modes as dataset 55, by pyuff."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from planner.campaign.events import MeasuredMode
from planner.frf.synthesis import pole
from planner.recording.points import Dof
from planner.recording.records import AXES
from planner.recording.uff import quiet

HIT, SENSOR = (1, "HIT"), (2, "SENSOR")  # nodes of the tool: numbers and names
FRF, COHERENCE = 4, 6  # function types of dataset 58
ACCELERANCE = {"ordinate_spec_data_type": 12, "ordinate_axis_lab": "Acceleration",
               "ordinate_axis_units_lab": "m/s^2", "orddenom_spec_data_type": 13,
               "orddenom_axis_lab": "Force", "orddenom_axis_units_lab": "N"}  # fmt: skip
Dataset = dict[str, Any]


def write_sets(path: Path, sets: Iterable[Dataset]) -> None:
    """One dataset after the other; pyuff reads the whole file again after each it appends."""
    import pyuff

    with TemporaryDirectory() as aside, open(path, "wb") as file:
        for k, one in enumerate(sets):
            piece = Path(aside) / f"{k}.uff"
            with quiet():
                pyuff.UFF(str(piece)).write_sets([one], "add")
            file.write(piece.read_bytes())


def _line(text: str) -> str:
    """As much of a text as a line of the format holds."""
    return text.encode("ascii", "replace").decode()[:80]


def function(
    values: np.ndarray, frequency_hz: np.ndarray, felt: tuple[int, Dof], hit: tuple[int, Dof],
    title: str, scaled: bool = True, names: tuple[str, str] = ("NONE", "NONE"),
) -> Dataset:  # fmt: skip
    """Dataset 58 of an FRF (F,), complex, in m/s²/N where it is `scaled`, or of a coherence (F,).

    `felt` and `hit` are node number and degree of freedom, `names` those of the nodes; lines (F,)
    in Hz.
    """
    steps, frf = np.diff(frequency_hz), np.iscomplexobj(values)
    return {
        "type": 58, "binary": 0, "func_type": FRF if frf else COHERENCE,
        "id1": _line(title), "id2": f"response {felt[1]}, hit {hit[1]}",
        "rsp_ent_name": names[0], "ref_ent_name": names[1],
        "rsp_node": felt[0], "rsp_dir": felt[1].number, "ref_node": hit[0],
        "ref_dir": hit[1].number, "data": values, "x": frequency_hz,
        "abscissa_spacing": int(np.allclose(steps, steps[0], rtol=1e-6)),
        "abscissa_spec_data_type": 18, "abscissa_axis_lab": "Frequency",
        "abscissa_axis_units_lab": "Hz", "orddenom_spec_data_type": 0,
        **(ACCELERANCE if frf and scaled else {}),
    }  # fmt: skip


def mode_set(
    k: int, pole: complex, texts: Sequence[str], nodes: Sequence[int], motion: np.ndarray,
    a: complex = 0j,
) -> Dataset:  # fmt: skip
    """Dataset 55 of the k-th mode: pole in rad/s, modal a, and motion (n, 3), complex, of nodes."""
    columns = map(np.ascontiguousarray, motion.T)
    return {
        "type": 55, **{f"id{i}": _line(text) for i, text in enumerate(texts, 1)}, "model_type": 1,
        "data_ch": 2, "spec_data_type": 8, "load_case": 0, "mode_n": k, "node_nums": nodes,
        "n_data_per_node": 3, "analysis_type": 3, "data_type": 5, "eig": pole, "modal_a": a,
        "modal_b": -pole * a, **dict(zip(("r1", "r2", "r3"), columns, strict=True)),
    }  # fmt: skip


def tool_frfs(
    frequency_hz: np.ndarray, accelerance: np.ndarray, title: str,
    coherence: np.ndarray | None = None,
) -> list[Dataset]:  # fmt: skip
    """Every FRF of a matrix (3, 3, F) in m/s²/N; columns that are NaN are left out.

    The node of the hits is 1, that of the sensor 2. `coherence` (3, 3, F) follows each FRF where it
    is known.
    """
    names = SENSOR[1], HIT[1]
    return [
        function(of[i, j], frequency_hz, (SENSOR[0], Dof("", AXES[i])), (HIT[0], Dof("", AXES[j])),
                 title, names=names)
        for i, j in np.ndindex(3, 3) if np.isfinite(accelerance[i, j]).all()
        for of in (accelerance, coherence) if of is not None and np.isfinite(of[i, j]).all()
    ]  # fmt: skip


def tool_modes(modes: Sequence[MeasuredMode], title: str) -> list[Dataset]:
    """Each mode with its complex eigenvalue and its shape at the sensor's node."""
    sets = []
    for k, mode in enumerate(modes, 1):
        shape = np.array(mode.shape, dtype=float) @ [1, 1j]
        said = f"mode {k}: {mode.frequency_hz:.6g} Hz, damping ratio {mode.damping_ratio:.4g}"
        at = complex(pole(mode.frequency_hz, mode.damping_ratio))
        sets.append(mode_set(k, at, (title, said), [SENSOR[0]], shape[None]))
    return sets
