"""Receptances at the tip of a tested tool, rotations among them, from files and from a simulation.

A TOML with modes holds `lines_hz = [from, to, how many]` and, mode by mode, `frequency_hz`,
`damping_ratio`, and `right` and `left`: [[re, im], …] of motion and of force at (tip x, tip y,
second point x, second point y), with H = Σ right·leftᵀ / (iω − λ) + conjugate; `from_tip_m` is
where the second point was for that mode (Lei et al. 2023, eq. 15).

Finite differences of two points (Duarte and Ewins, Mech. Syst. Signal Process. 14, 2000; Lei et
al. 2023, appendix A) take the tool between them for rigid. With C the tip's receptances and the
tool's own transfer from the tip to the other point, u' = T_uu u + T_uf f, reciprocity of that piece
gives, without that assumption, all that is measured as V C Vᵀ + W.

Where only motions were measured, with G the simulation's receptances and H the measured ones from
force to motion, all six by six are taken as G + Θ (H − G) Θᵀ, where Θ = G_6h G_sh⁻¹ says how the
tip turns as it moves: exact where the simulation is, and H itself for the motions. Near
antiresonances of G the inverse would blow up what H and G differ by: it is regularised.
"""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np

from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import receptance, solve_poles
from planner.errors import InputError
from planner.frf import synthesis
from planner.frf.matrix import labelled_frfs
from planner.milling.coupling import TipReceptance
from planner.milling.cutter_frf import CutterFrf, read_npz, row_of
from planner.milling.tool import Point, Tool
from planner.modal.estimate_modes import identify
from planner.modal.fit_data import Data
from planner.modal.rank_one_fit import Entries
from planner.modal.shape_fit import shape_fit
from planner.recording.joints import JointUnits
from planner.recording.read import read_frfs
from planner.recording.records import AXES, FrfRecord
from planner.toml_file import limited, load_toml

# How far behind: rotations of rotations are second differences. With 1 % noise, of twenty machines
# 20 mm left two 8 and 12 % off at a peak, where 30 mm left none beyond 5 %.
MEASURE = (
    "measure FRFs at two points of the tested tool, its tip and one some 30 mm behind it, both "
    "across its axis, and give them as UFF 58 with --reference naming the points"
)


def read_tip(
    path: Path, tool: Tool | None, pose: str | None, noise: float, from_names: bool = False
) -> TipReceptance | CutterFrf:
    """What a file holds; `tool` is the tested one, `noise` a relative sd where it states none.

    `from_names` as in `read_frfs`, of FRFs. Raises InputError in one sentence.
    """
    if path.suffix.lower() == ".npz":
        return _npz(path, pose)
    if path.suffix.lower() == ".toml":
        return _modes(path, noise)
    return _frfs(path, read_frfs(path, from_names), tool, noise)


def _npz(path: Path, pose: str | None) -> TipReceptance | CutterFrf:
    """With rotations where the file holds them for this pose, else motions alone."""
    names, stored = read_npz(path)
    if not stored.get("sensor_at_tcp", True):
        raise InputError(
            f"{path} holds FRFs of a sensor beside the tip; give the campaign in its place, whose "
            f"FRFs are carried to the tip."
        )
    row = row_of(path, names, pose)
    keep = stored["frequency_hz"] > 0
    frequency = stored["frequency_hz"][keep]
    for kind in ("frf6", "frf"):
        if f"{kind}_mean" not in stored:
            continue
        if f"{kind}_sd" not in stored:
            raise InputError(f"{path} lacks {kind}_sd; write it with planner predict --out.")
        s2 = (2j * np.pi * frequency) ** 2
        h = stored[f"{kind}_mean"][row][..., keep] / s2
        spread = np.abs(stored[f"{kind}_sd"][row][..., keep] / s2)
        kept = (
            tuple(int(k) for k in stored.get("motions", range(6))) if kind == "frf6" else (0, 1, 2)
        )
        h, spread = h[np.ix_(kept, kept)], spread[np.ix_(kept, kept)]
        if np.all(np.isfinite(h)) and np.all(np.isfinite(spread)):
            if kind == "frf6":
                return TipReceptance.known(frequency, h, spread, kept)
            joints = None  # rad and m; None where the file does not say
            if "joints_deg" in stored:
                stated = stored["joints_deg"][row]
                units = stored.get("joint_units", msgspec.UNSET)
                joints = JointUnits.declared_as([""] * len(stated), units).internal(stated)
            return CutterFrf(names[row], frequency, h, spread, joints_rad=joints)
    raise InputError(f"{path}: FRFs of {names[row]} are not finite; measure what lacks.")


def two_points_of(path: Path, tool: Tool | None) -> tuple[Point, Point]:
    """The tip and the second point of the tested tool, of FRFs in `path`; InputError without."""
    if tool is None or len(tool.points) < 2:
        raise InputError(
            f"{path}: where its points are is not stated; give --reference with two [[point]] "
            f"(node, from_tip_m)."
        )
    tip, back = sorted(tool.points, key=lambda p: p.from_tip_m)[:2]
    if tip.from_tip_m > 0:
        raise InputError(f"No [[point]] of {tool.name} is at its tip; give one from_tip_m = 0.")
    return tip, back


def _frfs(
    path: Path, records: tuple[FrfRecord, ...], tool: Tool | None, noise: float
) -> TipReceptance:
    tip, back = two_points_of(path, tool)
    assert tool is not None
    ends = str(tip.node), str(back.node)
    frequency, frfs = labelled_frfs(records, "receptance", InputError, frozenset(ends))
    found = {(*felt, *hit): values for felt, hit, values, _ in frfs}
    directions = tuple(k for k in range(3) if any(key[1] == k for key in found))
    wanted = [(node, k) for node in ends for k in directions]
    lacking = [(a, b) for a in wanted for b in wanted if (*a, *b) not in found]
    if lacking or len(directions) < 2:
        raise InputError(f"{path}: {_lacks(lacking)}; {MEASURE}.")
    values = np.array([[found[(*a, *b)] for b in wanted] for a in wanted])
    seen = CutterFrf(str(path), frequency, values, noise * np.abs(values))
    found = two_point_receptance(seen, directions, tool, back)
    found = replace(found, simulated=any(record.simulated for record in records))
    if noise > 0:
        return smoothed(found)
    text = "The file gives no noise level, so results carry no sd; pass --noise PERCENT."
    return replace(found, remarks=(text,))


def _lacks(lacking: list[tuple]) -> str:
    if not lacking:
        return "directions and nodes are not stated, so there are no rotations"
    (response, i), (hit, j) = lacking[0]
    return (
        f"{len(lacking)} FRFs lack, first the one at node {response} along {AXES[i]} from a hit at "
        f"node {hit} along {AXES[j]}, so there are no rotations"
    )


Pair = tuple[float, float]
Four = Annotated[tuple[Pair, ...], msgspec.Meta(min_length=4, max_length=4)]


class TipModeTable(msgspec.Struct, forbid_unknown_fields=True):
    """[[mode]] of a file with modes of two points."""

    frequency_hz: Annotated[float, limited("Hz", gt=0)]
    damping_ratio: Annotated[float, limited(gt=0, lt=1)]
    right: Four
    left: Four
    from_tip_m: Annotated[float, limited("m", gt=0)]


class TipModesTable(msgspec.Struct, forbid_unknown_fields=True):
    """A whole file with modes of two points, along x and y of the FRFs."""

    lines_hz: tuple[float, float, int]
    mode: tuple[TipModeTable, ...]


def _modes(path: Path, noise: float) -> TipReceptance:
    table = load_toml(path, TipModesTable, "file of modes at two points")
    low, high, count = table.lines_hz
    # Most lines.
    if not (0 < low < high and 2 <= count <= 200_000):
        raise InputError(f"{path}: lines_hz has to be [from above 0, to, how many]; correct it.")
    frequency = np.linspace(low, high, count)
    stated = [(m.frequency_hz, m.damping_ratio) for m in table.mode]
    hertz, damping = np.reshape(stated, (-1, 2)).T
    poles = synthesis.pole(hertz, damping)
    right, left = (
        np.reshape([_tip_and_turn(getattr(m, side), m.from_tip_m) for m in table.mode], (-1, 4))
        for side in ("right", "left")
    )
    c = synthesis.receptance(frequency, poles, right[:, :, None] * left[:, None])
    return TipReceptance.known(frequency, c, noise * np.abs(c), (0, 1, 3, 4))


def _tip_and_turn(side: tuple[Pair, ...], distance: float) -> np.ndarray:
    """(x, y, θx, θy) at the tip, the second point lying at −z of it."""
    tip_x, tip_y, back_x, back_y = (complex(*pair) for pair in side)
    return np.array([tip_x, tip_y, -(tip_y - back_y) / distance, (tip_x - back_x) / distance])


def smoothed(tip: TipReceptance) -> TipReceptance:
    """The same from smoothed measured values, and a remark; as it is where no sd is stated.

    Also as it is, and said so, where no fit by common modes comes near the noise.
    """
    if not np.all(tip.sd > 0):
        return tip
    square = (2 * np.pi * tip.frequency_hz) ** 2
    accelerance = -np.moveaxis(tip.measured, 0, -1) * square
    variance = (np.moveaxis(tip.sd, 0, -1) * square) ** 2
    data = Data(tip.frequency_hz, accelerance, variance, above=True, steady=True)
    found, count = identify(data), len(accelerance)
    rows, columns = np.divmod(np.arange(count**2), count)
    fit = None if found is None else shape_fit(data, found.fit, Entries(rows, columns, count))
    if fit is None or fit.chi2 > 1.2:  # per degree of freedom: beyond, sds would not hold
        text = "The FRFs are used line by line: few common modes do not follow them to their noise."
        return replace(tip, remarks=(*tip.remarks, text))
    text = (
        f"The FRFs are those of {fit.poles.size} common modes fitted to them, "
        f"misfit {np.sqrt(fit.chi2):.2f} of their noise."
    )
    measured = np.moveaxis((-fit.response / square).reshape(accelerance.shape), -1, 0)
    errors = (-fit.errors / square).reshape(-1, *accelerance.shape)
    errors = np.moveaxis(errors, -1, 1)
    sd = np.sqrt(np.sum(np.abs(errors) ** 2, axis=0))
    return replace(tip, measured=measured, sd=sd, errors=errors, remarks=(*tip.remarks, text))


def two_point_receptance(
    seen: CutterFrf,
    directions: tuple[int, ...],
    tool: Tool,
    back: Point,
    errors: np.ndarray | None = None,
) -> TipReceptance:
    """All receptances of the tip but those of twisting, from two points of a tool.

    `seen` are those (2d, 2d, F) between all `directions` of both points, the tip's d first (numbers
    of x, y, z in the FRFs' axes). Where they err together `errors` (D, 2d, 2d, F) says how, as in
    `TipReceptance`. `back` is the second point. InputError where the directions are too few.
    """
    _check(directions, tool)
    omega = 2 * np.pi * seen.frequency_hz
    both = np.kron(np.eye(2), tool.frame)  # columns are the tool's axes at both points
    full = [3 * point + k for point in (0, 1) for k in directions]
    kept = (0, 1, 2, 3, 4) if len(directions) == 3 else (0, 1, 3, 4)
    rows = np.ix_(full, kept)

    def along(values: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """(…, F, k, k) in the tool's axes of values (…, 2d, 2d, F)."""
        return turn[rows].T @ np.moveaxis(values, -1, -3) @ turn[rows]

    assert seen.sd is not None
    measured, sd = along(seen.receptance, both), np.sqrt(along(seen.sd**2, both**2))
    v, w = _mapping(tool, back.from_tip_m, kept, omega)
    left = np.linalg.inv(v)
    right = np.swapaxes(left, 1, 2)
    c = left @ (measured - w) @ right
    spread = np.zeros(c.shape)
    if back.place_sd_m > 0:
        moved, shift = _mapping(tool, back.from_tip_m + back.place_sd_m, kept, omega)
        other = np.linalg.inv(moved)
        spread = np.abs(other @ (measured - shift) @ np.swapaxes(other, 1, 2) - c)
    return TipReceptance(
        seen.frequency_hz, kept, measured, sd, left, right, -left @ w @ right, spread, tool.frame,
        errors=None if errors is None else along(errors, both),
    )  # fmt: skip


def _check(directions: tuple[int, ...], tool: Tool) -> None:
    if len(directions) == 3:
        return
    along = int(np.argmax(np.abs(tool.axis)))
    across = tuple(k for k in range(3) if k != along)
    # By how much the cosine of a tool's axis with one of the FRFs' own may lack
    if abs(tool.axis[along]) < 1 - 1e-6:
        raise InputError(
            f"The axis of {tool.name} is none of the FRFs' own; measure x, y and z at both points."
        )
    if not set(across) <= set(directions):
        raise InputError(
            f"Of {tool.name} both directions across its axis are needed at both points, "
            f"{AXES[across[0]]} and {AXES[across[1]]}; measure them."
        )


def _mapping(
    tool: Tool, distance: float, kept: tuple[int, ...], omega: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """V (F, k, k) and W (F, k, k) of measured = V C Vᵀ + W, in the tool's own axes."""
    piece, lines = tool.above(distance).transfer(omega), range(len(omega))
    uu = piece[np.ix_(lines, (0, 1), kept)]
    uf = piece[np.ix_(lines, (0, 1), [6 + k for k in kept])]
    d, size = len(kept) - 2, len(kept)
    v = np.zeros((len(omega), size, size), complex)
    v[:, range(d), range(d)] = 1
    v[:, d:] = uu
    w = np.zeros(v.shape, complex)
    w[:, d:, :d] = uf[:, :, :d]
    w[:, :d, d:] = np.swapaxes(uf[:, :, :d], 1, 2)
    w[:, d:, d:] = uf @ np.swapaxes(uu, 1, 2)
    return v, w


def completed(motion: CutterFrf, simulation: Simulation, q: np.ndarray) -> TipReceptance:
    """All receptances of the tcp at q (dof,) in rad, from those of motion and a simulation."""
    g, seen = _simulated(simulation, q, motion.frequency_hz)
    own = np.moveaxis(motion.receptance, -1, 0)
    least = regularised_inverse(seen[:, :, :3])
    left = np.zeros((len(own), 6, 3), complex)
    left[:, :3] = np.eye(3)
    left[:, :3] += (g[:, :3, :3] - seen[:, :, :3]) @ least
    left[:, 3:] = g[:, 3:, :3] @ least
    right = np.zeros((len(own), 3, 6), complex)
    right[:, :, :3] = np.eye(3)
    right[:, :, 3:] = least @ seen[:, :, 3:]
    # A simulation that misses the motions misses the rotations too, by as much at least.
    off = np.linalg.norm(own - seen[:, :, :3], axis=(1, 2)) / np.linalg.norm(own, axis=(1, 2))
    # Relative sd of the simulation's rotations: links and flange that it takes for rigid bend too.
    relative = np.hypot(0.1, off)
    spread = relative[:, None, None] * np.abs(g)
    apart = np.abs(g[:, :3, :3] - seen[:, :, :3])  # sensor and tcp are not at the same place
    spread[:, :3, :3] = off[:, None, None] * apart
    assert motion.sd is not None
    return TipReceptance(
        motion.frequency_hz,
        tuple(range(6)),
        own,
        np.moveaxis(motion.sd, -1, 0),
        left,
        right,
        g - left @ seen[:, :, :3] @ right,
        spread,
        remarks=(
            "The robot turns at its tcp as its simulation does, bodies between joints rigid; "
            f"these rotations count with an sd of {100 * np.median(relative):.0f} % (median over "
            f"the lines).",
        ),
    )


def regularised_inverse(g: np.ndarray) -> np.ndarray:
    """(F, n, n) of matrices: their inverse, but for what is small beside their largest part."""
    largest = np.linalg.norm(g, 2, axis=(1, 2))
    conjugate = np.conj(np.swapaxes(g, 1, 2))
    # Of G's largest singular value at a line: what is smaller tells no rotation. Where H and G
    # differ by 1 % of that value, so do rotations by at most 1 % / (2 · 0.05) of theirs.
    ridge = (0.05 * largest)[:, None, None] ** 2 * np.eye(g.shape[-1])
    return conjugate @ np.linalg.inv(g @ conjugate + ridge)


def _simulated(
    simulation: Simulation, q: np.ndarray, frequency_hz: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Receptances of the tcp (F, 6, 6), and of the sensor's motion from the tcp (F, 3, 6)."""
    m = simulation.elastic.matrices(q)
    tip = np.concatenate([m.hit, m.hit_turn], axis=1)
    rows = np.concatenate([tip, m.sensor], axis=1)
    poles = solve_poles(m.mass, simulation.damping, simulation.stiffness + m.geometric, tip, rows)
    values = np.moveaxis(receptance(poles, frequency_hz)[0], -1, 0)
    return values[:, :6], values[:, 6:]
