"""Roving-hammer sets of structures of three kinds, with everything that goes wrong at once.

Panels, welded frames (x, y, z at each node) and two pieces bolted together (close pairs of modes);
each of some 50 degrees of freedom. Noise, hits that miss (a gain for each row), drift from set to
set. Seeds 0 to 26 and 100 to 117 were looked at when constants of the analysis were chosen.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from planner.frf.matrix import FrfMatrix
from planner.frf.synthesis import accelerance
from planner.modal.estimate_modes import PoleIdentification
from planner.modal.mac import mac
from planner.modal.modes import Mode
from planner.recording.points import Dof
from planner.recording.uff import Geometry
from tests.support.hit_structures import dof_of, matrix_of, unit_mass_shapes
from tests.support.modal_systems import noisy
from tests.support.structures import Structure, plate

KINDS = ("panel", "frame", "pieces")
LINES = 800


@dataclass(frozen=True, eq=False)
class RoughSet:
    """FRFs with what is true: poles (m,), shapes of unit modal mass (n, m) of the modes in band."""

    kind: str
    structure: Structure
    references: list[int]
    matrix: FrfMatrix
    band_hz: tuple[float, float]
    poles: np.ndarray
    shapes: np.ndarray
    seen: np.ndarray  # (m,) bool: modes that at least one reference takes part in
    drift: float


def rough_set(seed: int, kind: str | None = None, **changes: float) -> RoughSet:
    """One set, all nuisances drawn from `seed`; `changes` state some of them.

    noise (of each FRF's rms) 0.5 to 3 %, gain (sd of rows) 0 to 3 %, drift (sd of frequencies from
    set to set) 0 to 0.5 %, missing (share of the matrix) 0.
    """
    rng = np.random.default_rng([seed, 25])
    kind = kind or KINDS[seed % 3]
    structure = {"panel": _panel, "frame": _frame, "pieces": _pieces}[kind](rng)
    drawn = {
        "noise": rng.uniform(0.005, 0.03), "gain": rng.uniform(0, 0.03),
        "drift": rng.uniform(0, 0.005), "missing": 0.0,
    } | changes  # fmt: skip
    poles, shapes = unit_mass_shapes(structure)
    hz = np.abs(poles) / (2 * np.pi)
    rigid = int(np.count_nonzero(hz < 0.2 * np.median(hz[:20]))) if kind != "frame" else 0
    # The band ends in the widest valley, as one would choose it.
    wanted = 9 + int(np.argmax(np.diff(hz[rigid + 8 : rigid + 16]) / hz[rigid + 8 : rigid + 15]))
    low, high = 0.7 * hz[rigid], (hz[rigid + wanted - 1] + hz[rigid + wanted]) / 2
    lines = np.linspace(0, 1.1 * high, LINES + 1)[1:]
    references = _references(rng, shapes[:, rigid : rigid + wanted])
    matrix = _struck(structure, references, lines, rng, **drawn)
    inside = (hz > low) & (hz < high)
    true = shapes[:, inside]
    part = np.max(np.abs(true[references]), axis=0) / np.max(np.abs(true), axis=0)
    truth = poles[inside], true, part > 0.1, drawn["drift"]
    return RoughSet(kind, structure, references, matrix, (low, high), *truth)


def _references(rng: np.random.Generator, shapes: np.ndarray) -> list[int]:
    """Three places that an engineer would take: of many drawn, where the least mode moves most."""
    size = np.abs(shapes) / np.max(np.abs(shapes), axis=0)
    tries = [rng.choice(len(shapes), 3, replace=False) for _ in range(12)]
    best = max(tries, key=lambda t: float(np.min(np.max(size[t], axis=0))))
    return sorted(int(i) for i in best)


def _struck(
    structure: Structure, references: list[int], frequency_hz: np.ndarray,
    rng: np.random.Generator, noise: float, gain: float, drift: float, missing: float,
) -> FrfMatrix:  # fmt: skip
    poles, shapes = structure.poles()
    nodes = list(dict.fromkeys(structure.nodes))
    # Half of the drift is common to all modes (warmth), half each mode's own (loading, clamps).
    common = drift / np.sqrt(2) * rng.normal(size=(len(nodes), 1))
    own = drift / np.sqrt(2) * rng.normal(size=(len(nodes), poles.size))
    factor = dict(zip(nodes, 1 + common + own, strict=True))
    h = np.zeros((len(structure.nodes), len(references), frequency_hz.size), complex)
    for o, node in enumerate(structure.nodes):
        residues = (shapes[o] * shapes[references]).T
        h[o] = accelerance(frequency_hz, poles * factor[node], residues) * (1 + gain * rng.normal())
    h, _ = noisy(h, noise, rng)
    gone = rng.random(h.shape[:2]) < missing
    gone[references, np.arange(len(references))] = False
    h[gone] = np.nan
    return matrix_of(structure, references, frequency_hz, h)


def _damped(structure: Structure, rng: np.random.Generator) -> Structure:
    """With a ratio for every mode (0.2 to 2 %) and a dashpot somewhere: shapes are complex."""
    mass, stiffness = structure.mass, structure.stiffness
    square, modes = scipy.linalg.eigh(stiffness, mass)
    ratio = 10 ** rng.uniform(np.log10(0.002), np.log10(0.02), square.size)
    loaded = mass @ modes
    w = np.sqrt(np.maximum(square, 1e-9))
    damping = (loaded * (2 * ratio * w)) @ loaded.T
    at = rng.integers(len(mass))
    damping[at, at] += rng.uniform(0, 0.02) * mass[at, at] * w[min(8, w.size - 1)]
    return replace(structure, damping=damping)


def _panel(rng: np.random.Generator) -> Structure:
    size = rng.uniform(0.4, 1.2), rng.uniform(0.2, 0.5)
    shape = [(10, 5), (9, 6), (7, 7), (13, 4)][rng.integers(4)]
    return _damped(plate(*shape, size, rng.uniform(0.002, 0.008)), rng)


def _beam(length: float, area: float, iy: float, iz: float, torsion: float) -> np.ndarray:
    """Stiffness (12, 12) of an Euler beam of steel along its own x."""
    e, g = 2.1e11, 8.1e10
    k = np.zeros((12, 12))
    for at, value in (((0, 6), e * area / length), ((3, 9), g * torsion / length)):
        k[np.ix_(at, at)] += value * np.array([[1, -1], [-1, 1]])
    for at, inertia, sign in (((1, 5, 7, 11), iz, 1), ((2, 4, 8, 10), iy, -1)):
        b, c = 6 * length * sign, length**2
        k[np.ix_(at, at)] += e * inertia / length**3 * np.array(
            [[12, b, -12, b], [b, 4 * c, -b, 2 * c], [-12, -b, 12, -b], [b, 2 * c, -b, 4 * c]]
        )  # fmt: skip
    return k


def _frame(rng: np.random.Generator) -> Structure:
    """A table frame of tubes: four posts on a floor, rails at the top, one brace."""
    lx, ly, lz = rng.uniform(0.6, 1.2), rng.uniform(0.4, 0.9), rng.uniform(0.5, 1.0)
    corners = [(0, 0), (lx, 0), (lx, ly), (0, ly)]
    place, members = [], []
    for x, y in corners:
        start = len(place)
        place += [(x, y, lz * k / 3) for k in range(4)]
        members += [(start + k, start + k + 1) for k in range(3)]
    for a in range(4):
        b, start = (a + 1) % 4, len(place)
        ends = np.array(place[4 * a + 3]), np.array(place[4 * b + 3])
        place += [tuple(ends[0] + (ends[1] - ends[0]) * t) for t in (1 / 3, 2 / 3)]
        members += [(4 * a + 3, start), (start, start + 1), (start + 1, 4 * b + 3)]
    members.append((2, 5))  # a brace between two posts
    width, wall = rng.uniform(0.02, 0.05), rng.uniform(0.001, 0.002)
    area = 4 * width * wall
    inertia = 2 / 3 * width**3 * wall
    n = len(place)
    k, m = np.zeros((6 * n, 6 * n)), np.zeros(6 * n)
    for a, b in members:
        axis = np.subtract(place[b], place[a])
        length = float(np.linalg.norm(axis))
        x = axis / length
        side = np.cross([0.0, 0.0, 1.0] if abs(x[2]) < 0.9 else [0.0, 1.0, 0.0], x)
        side /= np.linalg.norm(side)
        turn = np.kron(np.eye(4), np.stack([x, side, np.cross(x, side)]))
        soft = rng.uniform(0.85, 1.15)  # welds and tolerances
        local = _beam(length, area, inertia * soft, inertia / soft, width**3 * wall)
        at = np.r_[6 * a : 6 * a + 6, 6 * b : 6 * b + 6]
        k[np.ix_(at, at)] += turn.T @ local @ turn
        for end in (a, b):
            m[6 * end : 6 * end + 3] += 7850 * area * length / 2
    for corner in range(4):  # feet on the floor
        at = 6 * 4 * corner
        k[np.diag_indices(6 * n)] += np.isin(np.arange(6 * n), np.arange(at, at + 6)) * 1e10
    kept = [6 * i + d for i in range(n) if i % 4 or i >= 16 for d in range(3)]
    rest = np.setdiff1d(np.arange(6 * n), kept)
    stiffness = k[np.ix_(kept, kept)] - k[np.ix_(kept, rest)] @ np.linalg.solve(
        k[np.ix_(rest, rest)], k[np.ix_(rest, kept)]
    )
    names = tuple(i // 6 + 1 for i in kept)
    mass = np.diag(m[kept] * rng.uniform(0.9, 1.1, len(kept)).repeat(1))
    made = Structure(
        mass, mass, (stiffness + stiffness.T) / 2, names,
        tuple("xyz"[i % 6] for i in kept),
        {i + 1: tuple(map(float, place[i])) for i in range(n)},
        tuple((a + 1, b + 1) for a, b in members),
    )  # fmt: skip
    return _damped(made, rng)


def _pieces(rng: np.random.Generator) -> Structure:
    """Two nearly equal panels beside each other, held together by a few soft bolts."""
    size, thickness = (rng.uniform(0.4, 0.7), rng.uniform(0.25, 0.4)), rng.uniform(0.003, 0.006)
    first = plate(5, 5, size, thickness)
    second = plate(5, 5, size, thickness * (1 + rng.uniform(0.005, 0.03)))
    n = len(first.nodes)
    stiffness = scipy.linalg.block_diag(first.stiffness, second.stiffness)
    mass = scipy.linalg.block_diag(first.mass, second.mass)
    bolt = 10 ** rng.uniform(2.5, 4.5)
    for row in (0, 2, 4):
        a, b = 5 * row + 4, n + 5 * row
        stiffness[np.ix_([a, b], [a, b])] += bolt * np.array([[1, -1], [-1, 1]])
    place = dict(first.position_m)
    place |= {node + n: (x + size[0] * 1.05, y, z) for node, (x, y, z) in second.position_m.items()}
    lines = (*first.lines, *((a + n, b + n) for a, b in second.lines))
    made = Structure(
        mass, mass, stiffness, tuple(range(1, 2 * n + 1)), ("z",) * (2 * n), place, lines
    )
    return _damped(made, rng)


def geometry_of(structure: Structure) -> Geometry:
    """Places of the nodes and the lines between them, as files state them."""
    place = structure.position_m
    lines = tuple((str(a), str(b)) for a, b in structure.lines)
    return Geometry(tuple(str(n) for n in place), np.array(list(place.values())), lines)


@dataclass(frozen=True)
class Told:
    """One true mode beside the one that was found: MAC, scale error, z scores, shares covered."""

    mac: float
    scale: float
    frequency_z: float
    damping_z: float
    real: float
    imag: float


def tellable(case: RoughSet) -> np.ndarray:
    """(m,) bool: modes in which every point is felt by a reference that takes part (a tenth)."""
    part = np.abs(case.shapes[case.references]) > 0.1 * np.max(np.abs(case.shapes), axis=0)
    return np.all(case.matrix.measured.astype(int) @ part > 0, axis=0)[case.seen]


def told(case: RoughSet, modes: Sequence[Mode], dofs: Sequence[Dof]) -> list[Told | None]:
    """Every true mode that the references see, None where none was found."""
    names = [dof_of(case.structure, k) for k in range(len(case.structure.nodes))]
    rows = [names.index(dof) for dof in dofs]
    found: list[Told | None] = []
    for pole, shape in zip(case.poles[case.seen], case.shapes.T[case.seen], strict=True):
        hz, true = np.abs(pole) / (2 * np.pi), shape[rows]
        near = [m for m in modes if abs(m.frequency_hz / hz - 1) < 0.015]
        best = max(near, key=lambda m: mac(m.shape, true), default=None)
        if best is None or mac(best.shape, true) < 0.8:
            found.append(None)
            continue
        true = true * np.sign(np.vdot(best.shape, true).real)
        off = best.shape - true
        found.append(
            Told(
                mac(best.shape, true),
                float(np.linalg.norm(best.shape) / np.linalg.norm(true) - 1),
                (best.frequency_hz - hz) / best.frequency_sd_hz,
                (best.damping_ratio + pole.real / np.abs(pole)) / best.damping_sd,
                float(np.mean(np.abs(off.real) < 1.96 * best.shape_sd)),
                float(np.mean(np.abs(off.imag) < 1.96 * best.shape_sd)),
            )
        )
    return found


def spoiled(
    case: RoughSet, found: PoleIdentification, order: np.ndarray, sign: np.ndarray
) -> tuple[FrfMatrix, PoleIdentification]:
    """Matrix and poles with rows in another order and signs (n, 3) turned.

    Every row is fitted by itself and the poles do not know names: what would be found in the
    spoiled matrix is what was found, spoiled.
    """
    table = np.full((*sign.shape, found.fit.coefficients.shape[1]), np.nan)
    table[found.data.row, found.data.column] = found.fit.coefficients
    table = table[order] * sign[..., None]
    matrix = replace(case.matrix, accelerance=case.matrix.accelerance[order] * sign[..., None])
    rows, columns = np.nonzero(matrix.measured)
    fit = replace(found.fit, coefficients=table[rows, columns])
    return matrix, replace(found, data=replace(found.data, row=rows, column=columns), fit=fit)
