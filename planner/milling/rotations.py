"""Rotations at the tip: from two points hit and measured on the tested tool.

Finite differences of two points (Duarte and Ewins, Mech. Syst. Signal Process. 14, 2000; Lei et
al. 2023, appendix A) take the tool between them for rigid. With C the tip's receptances and the
tool's own transfer from the tip to the other point, u' = T_uu u + T_uf f, reciprocity of that piece
gives, without that assumption, all that is measured as V C Vᵀ + W.
"""

from dataclasses import dataclass

import numpy as np

from planner.errors import InputError
from planner.milling.coupling import TipReceptance
from planner.milling.tool import Point, Tool
from planner.recording.records import AXES

AXIS = 1e-6  # by how much the cosine of a tool's axis with one of the FRFs' own may lack


@dataclass(frozen=True, eq=False)
class TwoPoints:
    """Receptances (m/N) between all directions of two points, the tip's first.

    `directions` are those measured at each (numbers of x, y, z in the FRFs' axes, d of them);
    `values` and `sd` (2d, 2d, F), response by hit, the tip's d directions first.
    """

    frequency_hz: np.ndarray
    directions: tuple[int, ...]
    values: np.ndarray
    sd: np.ndarray


def two_point_receptance(seen: TwoPoints, tool: Tool, back: Point) -> TipReceptance:
    """All receptances of the tip but those of twisting, from two points of a tool.

    `back` is the second point. Raises InputError where the directions measured are too few.
    """
    _check(seen, tool)
    omega = 2 * np.pi * seen.frequency_hz
    both = np.kron(np.eye(2), tool.frame)  # columns are the tool's axes at both points
    full = [3 * point + k for point in (0, 1) for k in seen.directions]
    values, variance = (np.zeros((len(omega), 6, 6), kind) for kind in (complex, float))
    grid = np.ix_(range(len(omega)), full, full)
    values[grid] = np.moveaxis(seen.values, -1, 0)
    variance[grid] = np.moveaxis(seen.sd, -1, 0) ** 2
    axial = len(seen.directions) == 3
    use = [0, 1, 2, 3, 4] if axial else [0, 1, 3, 4]
    kept = (0, 1, 2, 3, 4) if axial else (0, 1, 3, 4)
    here = np.ix_(range(len(omega)), use, use)
    measured = (both.T @ values @ both)[here]
    sd = np.sqrt((both.T**2 @ variance @ both**2)[here])
    v, w = _mapping(tool, back.from_tip, kept, omega)
    left = np.linalg.inv(v)
    right = np.swapaxes(left, 1, 2)
    c = left @ (measured - w) @ right
    spread = np.zeros(c.shape)
    if back.place_sd > 0:
        moved, shift = _mapping(tool, back.from_tip + back.place_sd, kept, omega)
        other = np.linalg.inv(moved)
        spread = np.abs(other @ (measured - shift) @ np.swapaxes(other, 1, 2) - c)
    offset = -left @ w @ right
    return TipReceptance(
        seen.frequency_hz, kept, measured, sd, left, right, offset, spread, tool.frame
    )


def _check(seen: TwoPoints, tool: Tool) -> None:
    if len(seen.directions) == 3:
        return
    along = int(np.argmax(np.abs(tool.axis)))
    across = tuple(k for k in range(3) if k != along)
    if abs(tool.axis[along]) < 1 - AXIS:
        raise InputError(
            f"The axis of {tool.name} is none of the FRFs' own; measure x, y and z at both points."
        )
    if not set(across) <= set(seen.directions):
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
