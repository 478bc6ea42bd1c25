"""Inertias of bodies as numbers with normal priors, such that a common scale costs nothing.

Of each body one number scales all it has, mass, first moments and moments, by e^σφ; the others are
relative to that: where its centre is, its moments. A link that bends is two halves, which differ by
the split of its mass, the distance of their centres, and moments, about those of a uniform beam.
Bodies stay what matter can form by the log-determinant divergence of their pseudo-inertia (Lee,
Wensing & Park 2020, eq. 24).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.robot.robot import Robot
from planner.robot.urdf_inertias import affine_map
from planner.robot.virtual_joints import OUTER, cut_at, halves_moved, inertia_basis

HALVES = float(np.sqrt(2.0))  # independent halves scatter by more than their sum
# Of halves: sd of their centres' distance, of the share of mass that is moved, of moments.
APART, SPLIT, MOMENTS = 0.5, 0.2, 0.25


def pseudo_inertia(inertia: np.ndarray) -> np.ndarray:
    """(..., 4, 4) of (m, m·c, moments xx xy yy xz yz zz) (..., 10) about the frame's origin."""
    m, x, y, z, xx, xy, yy, xz, yz, zz = np.moveaxis(inertia, -1, 0)
    half = (xx + yy + zz) / 2
    rows = [[half - xx, -xy, -xz, x], [-xy, half - yy, -yz, y], [-xz, -yz, half - zz, z],
            [x, y, z, m]]  # fmt: skip
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


@dataclass(frozen=True, eq=False)
class BodyNumbers:
    """Names, nominal inertias (L, 10) and changes (L, R, 10) by each of R numbers in sds.

    `scaled` (L,) says which number scales a body, `sigma` (L,) by how much. `halves` says by outer
    halves' names where they are cut off, (3,) in m of the frame of the inner half, which precedes.
    """

    bodies: tuple[str, ...]
    names: tuple[str, ...]
    nominal: np.ndarray
    change: np.ndarray
    scaled: np.ndarray
    sigma: np.ndarray
    halves: dict[str, np.ndarray]

    @property
    def size(self) -> int:
        """R."""
        return len(self.names)

    @cached_property
    def mine(self) -> tuple[np.ndarray, ...]:
        """The numbers that move each body."""
        return tuple(np.flatnonzero(np.any(body != 0, axis=1)) for body in self.change)

    def factor(self, phi: np.ndarray) -> np.ndarray:
        """(L,) by which bodies are scaled."""
        return np.exp(self.sigma * phi[self.scaled])

    def difference(self, phi: np.ndarray) -> np.ndarray:
        """(L, 10): what the inertias differ from the nominal ones by, at φ (R,)."""
        f = self.factor(phi)[:, None]
        return (f - 1) * self.nominal + f * np.einsum("r,brk->bk", self._relative(phi), self.change)

    def slopes(self, phi: np.ndarray) -> list[np.ndarray]:
        """Of each body (m, 10): how its inertia changes with each of its m numbers (`mine`)."""
        f, relative = self.factor(phi), self._relative(phi)
        out = []
        for b, mine in enumerate(self.mine):
            own = f[b] * self.change[b, mine]
            at = int(np.flatnonzero(mine == self.scaled[b])[0])
            whole = self.nominal[b] + relative @ self.change[b]
            own[at] = self.sigma[b] * f[b] * whole
            out.append(own)
        return out

    def regrouped(self, phi: np.ndarray, other: "BodyNumbers", psi: np.ndarray) -> np.ndarray:
        """φ (R,) in which links that are cut, or whole, but not so in another robot's bodies have
        the mass, centre and moments that they have there at ψ; the rest as at `phi` (R,).

        Halves are the nominal ones under the one affine map that gives the whole what it has: their
        pseudo-inertias A P Aᵀ stay positive (Lee, Wensing & Park 2020).
        """
        out = phi.copy()
        there = dict(zip(other.bodies, other.nominal + other.difference(psi), strict=True))
        for outer in self.halves.keys() ^ other.halves.keys():
            cut = self if outer in self.halves else other
            moved = {cut.bodies[cut.bodies.index(outer) - 1]: np.eye(4), outer: np.eye(4)}
            moved[outer][:3, 3] = cut.halves[outer]
            mine = [self.bodies.index(n) for n in moved if n in self.bodies]
            to = np.array([moved[self.bodies[b]] for b in mine])
            nominal = to @ pseudo_inertia(self.nominal[mine]) @ np.swapaxes(to, 1, 2)
            known = [a @ pseudo_inertia(there[n]) @ a.T for n, a in moved.items() if n in there]
            weighs = np.sum(known, axis=0)
            affine = affine_map(nominal.sum(axis=0), weighs)
            wanted = affine @ nominal @ affine.T
            factor = wanted[:, 3, 3] / nominal[:, 3, 3]
            change = to @ np.swapaxes(pseudo_inertia(self.change[mine]), 0, 1)
            change = change @ np.swapaxes(to, 1, 2)
            change[self.scaled] = 0.0
            some = np.flatnonzero(change.any(axis=(1, 2, 3)))
            apart = wanted / factor[:, None, None] - nominal
            out[some] = np.linalg.lstsq(change[some].reshape(len(some), -1).T, apart.ravel())[0]
            out[self.scaled[mine]] = np.log(factor) / self.sigma[mine]
        return out

    def _relative(self, phi: np.ndarray) -> np.ndarray:
        relative = phi.copy()
        relative[self.scaled] = 0.0
        return relative

    @cached_property
    def _possible(self) -> np.ndarray:
        """(L, R, 4, 4): slopes of pseudo-inertias where the nominal ones are one; 0 of nothing."""
        out = np.zeros((*self.change.shape[:2], 4, 4))
        slopes = pseudo_inertia(self.change)
        for b, at in enumerate(pseudo_inertia(self.nominal)):
            if np.linalg.eigvalsh(at)[0] > 1e-12 * np.trace(at):
                root = np.linalg.inv(np.linalg.cholesky(at))
                out[b] = root @ slopes[b] @ root.T
        out[np.arange(len(out)), self.scaled] = 0.0
        return out

    @cached_property
    def _own(self) -> tuple[np.ndarray, np.ndarray]:
        """Numbers (L, m) of each body, and `_possible` by them; filled up by nothing's."""
        most = max(map(len, self.mine))
        mine = np.array([np.pad(one, (0, most - len(one))) for one in self.mine])
        own = self._possible[np.arange(len(mine))[:, None], mine]
        for b, one in enumerate(self.mine):
            own[b, len(one) :] = 0.0
        return mine, own

    def barrier(self, phi: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """Value, gradient (R,), Hessian (R, R) of the divergence; ∞ where no body can be so."""
        slope = self._possible
        at = np.eye(4) + np.einsum("r,brij->bij", phi, slope)
        gradient, hessian = np.zeros(len(phi)), np.zeros((len(phi), len(phi)))
        values, vectors = np.linalg.eigh(at)
        if values.min() <= 0:
            return np.inf, gradient, hessian
        inverse = (vectors / values[:, None]) @ np.swapaxes(vectors, 1, 2)
        mine, own = self._own
        moved = inverse[:, None] @ own
        pull = np.trace(own, axis1=2, axis2=3) - np.trace(moved, axis1=2, axis2=3)
        turned = np.swapaxes(moved, 2, 3).reshape(*mine.shape, -1)
        both = moved.reshape(*mine.shape, -1) @ np.swapaxes(turned, 1, 2)
        np.add.at(gradient, mine, pull)
        np.add.at(hessian, (mine[:, :, None], mine[:, None]), both)
        return float(np.sum(values - 1 - np.log(values))), gradient, hessian


def body_numbers(
    robot: Robot,
    bodies: Sequence[str],
    nominal: np.ndarray,
    sds: np.ndarray,
    names: Sequence[str],
) -> BodyNumbers:
    """Of bodies with nominal inertias (L, 10) and changes sds (L, 10, 10) by an sd each.

    A body named as an outer half follows the inner one.
    """
    per = sds.shape[1]
    halves = [b for b, name in enumerate(bodies) if name.endswith(OUTER)]
    extra = [row for b in halves for row in _halves(robot, bodies[b], nominal[b - 1], nominal[b])]
    total = len(bodies) * per + len(extra)
    change = np.zeros((len(bodies), total, 10))
    for b in range(len(bodies)):
        paired = b in halves or b + 1 in halves
        change[b, b * per : (b + 1) * per] = sds[b] * (HALVES if paired else 1.0)
    for number, (inner, outer) in enumerate(extra):
        at, b = len(bodies) * per + number, halves[number // (len(extra) // len(halves))]
        change[b - 1, at], change[b, at] = inner, outer
    scaled = per * np.arange(len(bodies))
    mass = nominal[:, 0]
    sigma = np.where(
        mass > 0, change[np.arange(len(bodies)), scaled, 0] / np.where(mass > 0, mass, 1), 0
    )
    more = [f"halves {k} of {bodies[b]}" for b in halves for k in range(len(extra) // len(halves))]
    cut = {bodies[b]: cut_at(robot, bodies[b].removesuffix(OUTER)) for b in halves}
    return BodyNumbers(tuple(bodies), (*names, *more), nominal, change, scaled, sigma, cut)


def _halves(
    robot: Robot, outer: str, first: np.ndarray, second: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray]]:
    """How each number of a pair changes the inner and the outer half, (10,) each."""
    link = outer.removesuffix(OUTER)
    far, slope = halves_moved(robot, link)
    rows = [(APART * far * slope[a][0], APART * far * slope[a][1]) for a in range(3)]
    rows.append((SPLIT * first, -SPLIT * first))
    mass, centre = first[0], first[1:4] / first[0]
    moments = first[[4, 6, 9]] - mass * (centre @ centre - centre**2)
    size = 4 * MOMENTS * float(np.max(np.abs(moments)))  # of the whole link, which is longer
    for k in (4, 6, 9):
        one = np.zeros(10)
        one[k] = size
        rows += [(one, -one), (one, one)]
    return rows


def spatial(inertia: np.ndarray) -> np.ndarray:
    """(…, 6, 6) of (…, 10)."""
    return np.einsum("...k,kij->...ij", inertia, inertia_basis())
