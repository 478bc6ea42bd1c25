"""Receptances between two points of the tested tool at a posture that was not hit.

From FRFs of other postures, without any simulation (Lei et al. 2023): modes with right and left
vectors, each followed over the postures, and a multi-task GP of each mode's parameters over the
joints. Vectors are those of the tip's motion and of how far the second point departs from it:
rotations are differences, and what both points have in common cancels in them.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.dataset.frf_set import frf_set
from planner.dataset.screened_files import Source
from planner.errors import InputError, RefusedError
from planner.frf.matrix import FrfMatrix
from planner.frf.synthesis import pole, receptance
from planner.milling.coupling import TipReceptance
from planner.milling.cutter_frf import CutterFrf
from planner.milling.tip_files import two_point_receptance, two_points_of
from planner.milling.tool import Tool
from planner.modal.matrix_modes import modes_of_matrix
from planner.modal.modes import Mode
from planner.modal.tracking import Guide, track
from planner.recording.folder import TABLE, joint_columns, read_poses, read_recordings
from planner.recording.points import ANYWHERE, Dof
from planner.recording.records import AXES
from planner.surrogate.models.multitask import RANK, fit_multitask

WANTED = "predict.csv"


# Of a mode: the postures x (n, d) that have it, and its parameters (n, 2 + 4m) at m directions: ln
# f, ln ζ, then right and left vector, real and imaginary part each; one entry of the left one is 1.
Parameters = tuple[np.ndarray, np.ndarray]


def posture_tip(folder: Path, tool: Tool | None, pose: str | None) -> TipReceptance:
    """At the row `pose` of predict.csv, from all poses of recordings.csv.

    Raises InputError in one sentence.
    """
    tip, back = two_points_of(folder, tool)
    assert tool is not None
    x, at, matrices = _hit(folder, pose)
    first, ends = next(iter(matrices.values())), (str(tip.node), str(back.node))
    directions = tuple(k for k in range(3) if Dof(ends[0], AXES[k]) in first.references)
    dofs = [Dof(node, AXES[k]) for node in ends for k in directions]
    for name, matrix in matrices.items():
        lacks = [d for d in dofs if d not in matrix.responses or d not in matrix.references]
        if lacks or not dofs:
            what = lacks[0].at if lacks else f"at node {tip.node}"
            raise InputError(f"Pose {name} lacks FRFs {what}; export those between both points.")
    hz, every = first.frequency_hz, list(matrices.values())
    values, errors = _predicted(_followed(every, dofs, x), at, hz)
    sd = np.sqrt(np.sum(np.abs(errors) ** 2, axis=0))
    seen = CutterFrf(str(pose), hz, values, sd)
    found = two_point_receptance(seen, directions, tool, back, errors)
    said = (
        f"From FRFs between two points at {len(x)} other postures; ± is that of the modes that "
        f"were followed, and too narrow: what other modes add is in neither value nor ±."
    )
    simulated = any(matrix.simulated for matrix in every)
    return replace(found, remarks=(*found.remarks, said), simulated=simulated)


def _hit(folder: Path, pose: str | None) -> tuple[np.ndarray, np.ndarray, dict[str, FrfMatrix]]:
    """Postures x (n, d) that were hit, the wanted one (d,), both scaled, and FRFs by pose."""
    joints = joint_columns(folder)
    rows = read_recordings(folder, joints, ANYWHERE)
    wanted = {row.pose: row.joints_deg for row in read_poses(folder / WANTED, joints)}
    if pose not in wanted:
        raise InputError(f"Name a pose of {folder / WANTED}: --pose {next(iter(wanted))}.")
    sources: dict[str, list[Source]] = {}
    for row in rows:
        assert row.file is not None
        # Nodes and directions as the files have them: each holds hits along several.
        sources.setdefault(row.pose, []).append(Source(row.file, str(row.file)))
    angles = {row.pose: row.joints_deg for row in rows}
    q = joints.internal([angles[name] for name in sources])
    there, low, span = joints.internal([wanted[pose]])[0], q.min(axis=0), np.ptp(q, axis=0)
    moves = span > 0
    if np.any(np.abs(there - low)[~moves] > 0):
        raise InputError(f"{pose} turns a joint that no pose of {folder / TABLE} turns; hit some.")
    x, at = ((each - low)[..., moves] / span[moves] for each in (q, there))
    matrices = {}
    for name, own in sources.items():
        given = frf_set(tuple(own), None)
        if given is None or given.matrix is None:
            raise InputError(f"Pose {name} has no FRFs between points; export those between two.")
        matrices[name] = given.matrix
    return x, at, matrices


def _followed(matrices: list[FrfMatrix], dofs: list[Dof], x: np.ndarray) -> list[Parameters]:
    """Every mode that most postures have."""
    found = [_modes(matrix, dofs) for matrix in matrices]
    if not any(found):
        raise InputError("No posture's FRFs show a mode; check that their band holds a resonance.")
    short = [[replace(m, shape=v[0][:3] / np.linalg.norm(v[0][:3])) for m, v in one]
             for one in found]  # fmt: skip
    both = zip(short, found, strict=True)
    pair_of = {id(m): pair for one, own in both for m, pair in zip(one, own, strict=True)}
    tracks = track(short, Guide.by_example(short), x, ordered=True)
    followed = []
    for label in range(tracks.probability.shape[1]):
        rows = [i for i, row in enumerate(tracks.modes) if row[label] is not None]
        if 2 * len(rows) <= len(x):
            continue
        pairs = [pair_of[id(tracks.modes[i][label])] for i in rows]
        followed.append((x[rows], _parameters(pairs)))
    if not followed:
        raise InputError("No mode is found in most postures; hit postures nearer to each other.")
    return followed


Found = tuple[Mode, tuple[np.ndarray, np.ndarray]]


def _modes(matrix: FrfMatrix, dofs: list[Dof]) -> list[Found]:
    """Modes with right and left vectors, (m,) each, of tip and departure; none where none is."""
    try:
        modes = modes_of_matrix(matrix).modes
    except RefusedError:
        return []
    felt = [matrix.responses.index(d) for d in dofs]
    hit = [matrix.references.index(d) for d in dofs]
    apart = _departure(len(dofs))
    return [
        (m, (apart @ m.vectors.right[felt], apart @ m.vectors.left[hit]))
        for m in modes
        if m.vectors is not None
    ]


def _departure(count: int) -> np.ndarray:
    """(m, m): of motions of tip and second point, those of the tip and their difference."""
    return np.kron([[1.0, 0.0], [1.0, -1.0]], np.eye(count // 2))


def _parameters(pairs: list[Found]) -> np.ndarray:
    left = np.array([vectors[1] for _, vectors in pairs])
    tip = left.shape[1] // 2
    # The direction in which the mode never comes near to rest is 1.
    share = np.abs(left[:, :tip]) / np.linalg.norm(left[:, :tip], axis=1, keepdims=True)
    reference = int(np.argmax(share.min(axis=0)))
    scale = left[:, reference, None]
    right = np.array([v[0] / (2j * mode.pole.imag) for mode, v in pairs]) * scale
    poles = np.array([[mode.frequency_hz, mode.damping_ratio] for mode, _ in pairs])
    both = np.concatenate([right, left / scale], axis=1)
    return np.concatenate([np.log(poles), both.real, both.imag], axis=1)


def _predicted(
    modes: list[Parameters], at: np.ndarray, hz: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Receptances (m, m, F) at one posture (d,), and by how much each parameter's sd moves them."""
    values, errors = 0.0, []
    for x, y in modes:
        mean, sd = (v[0] for v in fit_multitask(x, y, rank=RANK).predict(at[None]))
        here = _receptance(mean, hz)
        values = values + here
        for k in np.flatnonzero(np.ptp(y, axis=0) > 0):
            errors.append(_receptance(mean + sd[k] * np.eye(len(mean))[k], hz) - here)
    return np.asarray(values), np.array(errors)


def _receptance(parameters: np.ndarray, hz: np.ndarray) -> np.ndarray:
    """(m, m, F) of one mode between both points, tip first."""
    parts = parameters[2:].reshape(2, 2, -1)
    count = parts.shape[2]
    back = np.linalg.inv(_departure(count))
    right, left = (back @ (parts[0, k] + 1j * parts[1, k]) for k in (0, 1))
    f, zeta = np.exp(parameters[:2])
    return receptance(hz, pole(np.array([f]), min(zeta, 0.95)), np.outer(right, left)[None])
