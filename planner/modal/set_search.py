"""Sets whose poles Gauss-Newton has left in a wrong place are searched again.

Of two close modes that drift by more than they lie apart, a set may be fitted with one pole on the
other's peak, or with the two exchanged. Such a set fits worse than the others around these modes,
or its residues do not go with how the modes take part at the references, which all sets share. Its
poles are then looked for on a grid, one mode after the other, each mode excited as in all sets.
"""

from functools import cached_property

import numpy as np

from planner.modal.fit_data import Data
from planner.modal.mac import grouped
from planner.modal.pole_fit import FARTHEST, PoleFit
from planner.modal.residues import basis, response, stack

# Poles are looked for up to so many sds of the sets' poles, and half bandwidths, from the common
# ones; the lines looked at reach so many half bandwidths farther.
FAR, FAR_HALVES, REACH = 4.0, 2.0, 4.0
FINE = (0.2, 0.06, 0.02)  # half bandwidths: steps of the refinement


def reestimated_sets(data: Data, fit: PoleFit) -> np.ndarray | None:
    """Poles (k, m) of all sets, those of badly fitted sets as found anew; None where none are."""
    shares = _participation(data, fit)[data.column]
    off = _off(data, fit) | _apart(data, fit, shares)
    own, moved = fit.own.copy(), False
    # Modes among the lines, in groups whose peaks may overlap
    omega, far, imag = 2 * np.pi * data.frequency_hz[[0, -1]], _reach(fit), fit.poles.imag
    order = (int(k) for k in np.argsort(imag) if omega[0] < imag[k] < omega[1])
    for group in grouped(order, lambda a, b: imag[b] - imag[a] < far[a] + far[b]):
        modes = np.array(group)
        for s in np.flatnonzero(off[:, modes].any(axis=1)):
            found = _Neighbourhood(data, fit, shares, int(s), modes).best()
            if found is not None:
                own[s, modes] = found
                moved = True
    return own if moved else None


def _participation(data: Data, fit: PoleFit) -> np.ndarray:
    """(columns, m) how modes take part at the references, of unit length.

    Most sets agree on it: rows count the less the worse they fit.
    """
    tables = np.moveaxis(data.table(fit.residue), -1, 0)
    usual = np.median(np.linalg.norm(tables, axis=2), axis=1, keepdims=True)
    weight, right = np.ones(tables.shape[:2]), np.zeros(tables.shape[::2], complex)
    for _ in range(5):  # robust rounds
        right = np.linalg.svd(weight[..., None] * tables, full_matrices=False)[2][:, 0]
        off = tables - (tables @ right[..., None].conj()) * right[:, None]
        weight = 1 / np.sqrt(np.linalg.norm(off, axis=2) + 0.1 * usual + 1e-300)
    return right.T


def _reach(fit: PoleFit) -> np.ndarray:
    """(m,) how far (rad/s) a set's pole is looked for."""
    m = fit.poles.size
    far = FAR * np.sqrt(fit.spread[m:]) + FAR_HALVES * np.abs(fit.poles.real)
    return np.minimum(far, FARTHEST * fit.poles.imag)


def _near(data: Data, fit: PoleFit, mode: int) -> np.ndarray:
    """(F,) bool: lines around a mode, wherever a set may have it."""
    far = _reach(fit)[mode] + REACH * np.abs(fit.poles[mode].real)
    return np.abs(2 * np.pi * data.frequency_hz - fit.poles[mode].imag) < far


def _off(data: Data, fit: PoleFit) -> np.ndarray:
    """(k, m) bool: sets whose error around a mode is half as much again as that of the usual."""
    square = np.abs(fit.error) ** 2 / fit.variance
    off = np.zeros((len(data.sets), fit.poles.size), bool)
    for j in range(fit.poles.size):
        lines = _near(data, fit, j)
        if lines.any():
            each = np.mean(square[:, lines], axis=1)
            error = np.array([np.mean(each[chosen]) for chosen in data.sets])
            off[:, j] = error > 1.5 * np.median(error)
    return off


def _apart(data: Data, fit: PoleFit, theirs: np.ndarray) -> np.ndarray:
    """(k, m) bool: sets whose residues do not go with how the mode takes part (e, m)."""
    weight = 1 / np.maximum(2 * fit.residue_variance, 1e-300)
    along = data.table(weight * theirs.conj() * fit.residue).sum(axis=1)
    power = data.table(weight * np.abs(theirs) ** 2).sum(axis=1).real
    left = fit.residue - (along / np.maximum(power, 1e-300))[data.row] * theirs
    square = weight * np.abs(left) ** 2
    apart = np.array([np.mean(square[chosen], axis=0) for chosen in data.sets])
    # Beyond so many times their variance, and what is usual.
    return apart > 9.0 * np.maximum(np.median(apart, axis=0), 1.0)


class _Neighbourhood:
    """Responses of one set around modes that lie together, weighted.

    `values` (e, 2F) real, then imaginary parts, free of a straight line (`far`, orthonormal);
    `level` (e,) their variance where `profile` (F,) is one; `rows` (e,) which rows they are of,
    `shares` (e, n) how the modes take part there. Poles (n,): `common` ones, the set's `own`, how
    far they are looked for, `spread` of their imaginary parts.
    """

    def __init__(
        self, data: Data, fit: PoleFit, shares: np.ndarray, s: int, modes: np.ndarray
    ) -> None:
        """Of set s around some modes (indices), which take part in all entries by shares (e, m)."""
        entries = data.sets[s]
        chosen = np.flatnonzero(np.any([_near(data, fit, j) for j in modes], axis=0))
        self.lines, self.rows = data.lines.part(chosen), data.row[entries]
        self.shares, self.reach = shares[np.ix_(entries, modes)], _reach(fit)[modes]
        self.common, self.own = fit.poles[modes], fit.own[s, modes]
        # In any case a pole may move by half its bandwidth.
        self.spread = np.maximum(fit.spread[fit.poles.size + modes], self.common.real**2)
        variance = fit.variance[np.ix_(entries, chosen)]
        self.level, self.profile = variance[:, 0] / 2, np.sqrt(variance[0, 0] / variance[0])
        line = np.stack([np.ones(chosen.size), np.linspace(-1, 1, chosen.size)]) * self.profile
        self.far = np.linalg.qr(stack(np.concatenate([line, 1j * line])).T)[0]
        others = np.setdiff1d(np.arange(fit.poles.size), modes)
        apart = response(self.lines, fit.own[s, others], fit.residue[np.ix_(entries, others)])
        values = stack((data.values[np.ix_(entries, chosen)] - apart) * self.profile)
        self.values = values - values @ self.far @ self.far.T

    def best(self) -> np.ndarray | None:
        """Poles (n,) that fit clearly better than those of now, None where there are none."""
        common, reach = self.common, self.reach
        poles, half = common, np.abs(common.real)
        # Sweeps over the modes of a set, on the coarse grid
        for _ in range(2 if poles.size > 1 else 1):
            before = poles
            for a in range(poles.size):
                # Trials lie half a half bandwidth apart, at most so many to either side.
                count = min(40, int(np.ceil(reach[a] / (0.5 * half[a]))))
                shift = np.linspace(-reach[a], reach[a], 2 * count + 1)
                poles = self._along(poles, a, common[a] - poles[a] + 1j * shift)
            if np.array_equal(poles, before):
                break
        for step in FINE:
            for a in range(poles.size):
                for way in (1j, 1.0):
                    poles = self._along(poles, a, way * step * half[a] * np.arange(-2, 3))
        last = np.stack([poles, self.own])
        (total, gram, cross), bound = self._sums(last), self._bound(last)
        free = total - _explained(gram, cross / np.sqrt(self.level))  # residues left free
        gain = bound[1] - bound[0]
        # Gain of χ², from which what was found takes the place of what was there
        # Share of that gain by which χ² with residues left free may rise: an FRF may be spoiled
        return poles if gain > 16.0 and free[0] - free[1] < 0.1 * gain else None

    def _along(self, poles: np.ndarray, a: int, shift: np.ndarray) -> np.ndarray:
        """The best of poles (n,) with one of them moved by each of `shift`."""
        trials = np.tile(poles, (shift.size, 1))
        trials[:, a] += shift
        trials = trials[trials[:, a].real < 0]
        return trials[np.argmin(self._bound(trials))] if trials.size else poles

    @cached_property
    def _turns(self) -> np.ndarray:
        """(e, 2n, 2n) from motions (real, then imaginary parts) to residues of modes that take
        part so."""
        real, imag = (
            each[:, None] * np.eye(each.shape[1]) for each in (self.shares.real, self.shares.imag)
        )
        return np.block([[real, -imag], [imag, real]])

    def _sums(self, poles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(t,) χ² without any mode, (t, 2n, 2n) and (t, 2n, e) products of the modes' columns."""
        columns = stack(basis(self.lines, poles, False) * self.profile)
        columns = columns - columns @ self.far @ self.far.T
        pull = np.sum((poles.imag - self.common.imag) ** 2 / self.spread, axis=1)
        total = pull + np.sum(self.values**2 / self.level[:, None])
        return total, columns @ columns.transpose(0, 2, 1), columns @ self.values.T

    def _bound(self, poles: np.ndarray) -> np.ndarray:
        """(t,) χ² of trials (t, n) excited as in all sets."""
        total, gram, cross = self._sums(poles)
        for row in np.unique(self.rows):
            here = np.flatnonzero(self.rows == row)
            turns = self._turns[here]
            back = turns.transpose(0, 2, 1) / self.level[here, None, None]
            normal = np.sum((back[:, None] @ gram) @ turns[:, None], axis=0)
            right = np.einsum("eab,tbe->ta", back, cross[:, :, here])
            total = total - _explained(normal, right[..., None])
        return total


def _explained(normal: np.ndarray, right: np.ndarray) -> np.ndarray:
    """(t,) fall of χ² by least squares from normal (t, c, c) and right (t, c, k)."""
    size = np.maximum(np.sqrt(np.einsum("taa->ta", normal)), 1e-300)
    ridge = 1e-9 * np.eye(size.shape[1])
    normal = normal / size[:, :, None] / size[:, None] + ridge
    right = right / size[..., None]
    return np.sum(right * np.linalg.solve(normal, right), axis=(1, 2))
