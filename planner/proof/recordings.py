"""Recordings as files: one UFF a hit, tables of poses that were hit or are wanted."""

import csv
import warnings
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from planner.proof.hits import AXES, Hammer, SimulatedHit, signed, simulate_hit
from planner.proof.model import Truth

READBACK_MM = 0.1  # by which joints that slide scatter around the setpoint


def write_uff(
    path: Path,
    hit: SimulatedHit,
    hammer: Hammer,
    *text: str,
    nodes: Mapping[str, int] | None = None,
) -> None:
    """One hit as UFF 58b, labelled as simulated; up to 4 lines of text go into the header.

    `nodes` are those of the points by name, 1 where there is none.
    """
    axis, sense = signed(hit.axis)
    direction = int(sense) * (axis + 1)
    at = dict(nodes or {})
    struck = at.get(hit.hit_point, 1), direction
    said: dict[str, Any] = {f"id{k}": line[:80] for k, line in enumerate(text[:4], 2)}
    rate = hammer.sampling_rate_hz
    sets = [uff_channel(hit.force_n, rate, struck, struck, True, rsp_ent_name="hammer", **said)]
    for i, samples in enumerate(hit.acceleration_m_s2):
        sensor, axis = hit.sensors[i // 3], i % 3
        felt, name = (at.get(sensor, 1), axis + 1), f"{sensor} {AXES[axis]}".replace(" ", "_")
        sets.append(uff_channel(samples, rate, felt, struck, rsp_ent_name=name, **said))
    write_sets(path, sets)


def uff_channel(
    samples: np.ndarray, rate_hz: float, felt: tuple[int, int], hit: tuple[int, int],
    force: bool = False, **more: Any,
) -> dict[str, Any]:  # fmt: skip
    """Dataset 58b of a channel: force in N or acceleration in m/s² at a node in a direction."""
    kind, unit = (13, "N") if force else (12, "m/s^2")
    return {
        "type": 58, "binary": 1, "func_type": 1, "id1": "SIMULATED, not measured",
        "rsp_node": felt[0], "rsp_dir": felt[1], "ref_node": hit[0], "ref_dir": hit[1],
        "ord_data_type": 4, "num_pts": samples.size, "abscissa_spacing": 1, "abscissa_min": 0.0,
        "abscissa_inc": 1 / rate_hz, "abscissa_spec_data_type": 17, "abscissa_axis_units_lab": "s",
        "ordinate_spec_data_type": kind, "ordinate_axis_units_lab": unit,
        "orddenom_spec_data_type": 0, "z_axis_spec_data_type": 0,
        "data": np.asarray(samples, dtype=float), "x": np.arange(samples.size) / rate_hz, **more,
    }  # fmt: skip


def write_sets(path: Path, sets: Iterable[dict[str, Any]]) -> Path:
    """A universal file of these alone."""
    import pyuff

    path.unlink(missing_ok=True)  # and "add": pyuff's "overwrite" loses sets before the last
    file = pyuff.UFF(str(path))
    for one in sets:
        with warnings.catch_warnings():
            # pyuff leaves closing the file to the garbage collector, which does so right here.
            warnings.simplefilter("ignore", ResourceWarning)
            file.write_sets(one, "add")
    return path


def record_poses(
    truth: Truth,
    poses: Sequence[tuple[str, np.ndarray]],
    folder: Path,
    hits: Sequence[str] = ("+x", "+y", "+z"),
    repeats: int = 4,
    hammer: Hammer | None = None,
    seed: int = 0,
) -> Path:
    """A recordings folder of poses (name, q in rad); returns its path.

    Angles in recordings.csv are the readback, and it is there that the truth is evaluated.
    """
    hammer = hammer or Hammer()
    rows, slides, shift = [], truth.slides, np.array(truth.slides or False)
    for number, (pose, q) in enumerate(poses):
        rng = np.random.default_rng([seed, number])
        scatter = np.where(shift, READBACK_MM, hammer.readback_deg)
        readback = np.round(stated(q, slides) + scatter * rng.uniform(-1, 1, len(q)), 4)
        there = np.where(shift, 1e-3 * readback, np.deg2rad(readback))
        shots = [axis for axis in hits for _ in range(repeats)]
        rows.append((pose, readback, [simulate_hit(truth, there, a, hammer, rng) for a in shots]))
    return write_recordings(
        folder, truth.joint_names, rows, hammer, truth.description, slides=slides
    )


def stated(q: np.ndarray, slides: Sequence[bool]) -> np.ndarray:
    """As tables of recordings state q (dof,): degrees, millimetres of joints that slide."""
    return np.where(np.array(slides or False), 1e3 * q, np.rad2deg(q))


def _columns(joint_names: Sequence[str], slides: Sequence[bool]) -> list[str]:
    units = ["mm" if slide else "deg" for slide in slides or [False] * len(joint_names)]
    return [f"{name}_{unit}" for name, unit in zip(joint_names, units, strict=True)]


def write_recordings(
    folder: Path,
    joint_names: Sequence[str],
    visits: Sequence[tuple[str, np.ndarray, Sequence[SimulatedHit]]],
    hammer: Hammer,
    description: str,
    nodes: Mapping[str, int] | None = None,
    slides: Sequence[bool] = (),
) -> Path:
    """recordings.csv and one UFF file a hit of visits: pose, readback (dof,) in ° (mm), hits.

    Where other points than the tool's are hit or heard, the table names them.
    """
    (folder / "data").mkdir(parents=True, exist_ok=True)
    made = [(pose, readback, hit) for pose, readback, hits in visits for hit in hits]
    elsewhere = any((h.hit_point, h.sensors) != ("tcp", ("sensor",)) for *_, h in made)
    rows, repeats = [], Counter[tuple]()
    for pose, readback, hit in made:
        sign = "m" if hit.axis[0] == "-" else "p"
        at = f"_{hit.hit_point}_{'_'.join(hit.sensors)}" if elsewhere else ""
        repeats[pose, hit.axis, at] += 1
        repeat = repeats[pose, hit.axis, at]
        name = f"data/{pose}_{sign}{hit.axis[1]}_{repeat}{at}.uff"
        what = f"pose {pose}, hit {hit.axis}, repeat {repeat}"
        write_uff(folder / name, hit, hammer, description, what, nodes=nodes)
        points = [hit.hit_point, " ".join(hit.sensors)] if elsewhere else []
        rows.append([pose, *(f"{v:.4f}" for v in readback), hit.axis, repeat, name, *points])
    points = ["hit_point", "response_points"] if elsewhere else []
    head = ["pose", *_columns(joint_names, slides), "hit", "repeat", "file", *points]
    _write_table(folder / "recordings.csv", head, rows)
    return folder


def _write_table(path: Path, head: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    with open(path, "w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([head, *rows])


def write_predict(
    folder: Path,
    joint_names: Sequence[str],
    poses: Sequence[tuple[str, np.ndarray]],
    peak_force_n: float | None = None,
    slides: Sequence[bool] = (),
) -> Path:
    """`predict.csv`: poses (name, q in rad) of which the FRF is wanted."""
    path = folder / "predict.csv"
    force = [] if peak_force_n is None else [f"{peak_force_n:g}"]
    head = ["pose", *_columns(joint_names, slides), *(["peak_force_n"] if force else [])]
    rows = [[pose, *(f"{v:.4f}" for v in stated(q, slides)), *force] for pose, q in poses]
    _write_table(path, head, rows)
    return path
