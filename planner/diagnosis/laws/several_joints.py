"""One law at several joints at once, as of drives that all harden: fitted to the hits in time."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.dataset.dataset import Dataset
from planner.diagnosis.laws.equivalent_stiffness import System, receptances, system_of
from planner.diagnosis.laws.level_data import (
    LAID,
    Data,
    compared,
    data_of,
    linearised,
    own_parameter,
)
from planner.diagnosis.laws.level_refits import Refit, begin
from planner.diagnosis.laws.one_joint import LOG_ANGLE_SD, LOG_SHARE, LOG_SHARE_SD
from planner.diagnosis.laws.one_joint_response import Strokes, strokes
from planner.diagnosis.laws.several_joint_response import course, joints_of, rates
from planner.diagnosis.laws.torque_laws import Law
from planner.diagnosis.linear.fit import Fit

FINER, LASTS_S = 2, 0.7  # steps a sample, and how long hits are followed
MEAN, SD = (LOG_SHARE, 0.0), (LOG_SHARE_SD, LOG_ANGLE_SD)
LEAST, MOST, MOST_LACKING, FARTHEST = np.log(1e-3), np.log(20.0), np.log(0.95), 6.0
FIRST, HEAVIER, HEAVIEST = 1e-4, 30.0, 0.3  # damping of Levenberg and Marquardt
LEAST_LEFT = 0.05  # of a spring
ROUNDS, GAIN = 5, 0.03  # of a descent at most, and what a round must gain of the value
LONGEST = 0.7  # step, in logarithms of the law or in sds of the linear parameters


@dataclass(frozen=True, eq=False)
class Told:
    """Recordings as `data`, their hits in the steps that are integrated, the linear fit to them."""

    data: Data
    hits: Strokes
    plain: Fit


@dataclass(frozen=True, eq=False)
class Family:
    """A law at m joints, at linear parameters x (D,) and ν (2, m): ln of share and of angle.

    k is `sign` times the share of the joints' stiffness `scale` (m,); ln a is `middle` (m,) + ν.
    `chi2` is over complex values, `off` (c, 3, F) are the errors; `stiffer` (c, m) in N·m/rad is
    what the law adds to the joints' stiffness, on the whole, while a hit rings.
    """

    law: Law
    sign: int
    scale: np.ndarray
    middle: np.ndarray
    x: np.ndarray
    nu: np.ndarray
    chi2: float = np.inf
    value: float = np.inf
    damping: float = 1e-3
    normal: np.ndarray | None = None
    gradient: np.ndarray | None = None
    off: np.ndarray | None = None
    stiffer: np.ndarray | None = None

    @property
    def k(self) -> np.ndarray:
        """k (m,) in N·m/rad."""
        return self.sign * self.scale * np.exp(self.nu[0])

    @property
    def a(self) -> np.ndarray:
        """a (m,) in rad."""
        return np.exp(self.middle + self.nu[1])


def told_by(recorded: Dataset, plain: Fit) -> Told:
    """What laws are fitted to, and judged by."""
    places = [(n, c) for n, group in enumerate(recorded.columns_at(LAID)) for c in group]
    hits = strokes([n for n, _ in places], [c for _, c in places], FINER, LASTS_S)
    return Told(data_of(recorded, plain), hits, plain)


def beginning(seen: Sequence[Refit], law: Law, sign: int, plain: Fit) -> Family:
    """Where the refits of force levels say that the law lies."""
    system = system_of(plain)
    scale = system.elasticity.stiffness[system.blocks]
    middle = np.log(np.median(seen[-1].swing, axis=0))
    x = np.mean([level.plain.x for level in seen], axis=0)
    nu = np.zeros((2, len(scale)))
    for j, block in enumerate(system.blocks):
        own = own_parameter(plain, int(block))
        x[own], *nu[:, j] = begin(seen, law, sign, float(scale[j]), j, float(middle[j]))
    return Family(law, sign, scale, middle, x, nu)


def softened(data: Data, share: float) -> Data:
    """With errors of a share of the FRFs besides: so that fits find their way from afar."""
    weaker = (data.best != np.arange(len(data.h)))[:, None, None]
    square = np.abs(data.h) ** 2 + np.where(weaker, np.abs(data.h[data.best]) ** 2, 0.0)
    error = 1 / np.maximum(data.weight, 1e-300) + share**2 * square
    return replace(data, weight=np.where(data.weight > 0, 1 / error, 0.0))


def evaluate(told: Told, family: Family) -> Family:
    """χ² and the objective where the family is."""
    data, plain = told.data, told.plain
    system = system_of(plain, family.x)
    joints = joints_of(system, told.hits, data.fastest_hz)
    with np.errstate(over="ignore", invalid="ignore"):
        try:
            found = course(family.law, family.k, family.a, joints, told.hits, data.s)
        except np.linalg.LinAlgError:  # swings without bounds
            return replace(family, chi2=np.inf, value=np.inf)
        off = compared(data, data.h) - compared(data, _frfs(told, system, found.spectrum))
        chi2 = float(np.sum(data.weight * np.abs(off) ** 2))
    away, _ = _prior(plain, family)
    value = chi2 + 0.5 * float(away @ away)
    if not np.isfinite(value):
        return replace(family, chi2=np.inf, value=np.inf)
    return replace(family, chi2=chi2, value=value, off=off, stiffer=found.stiffer)


def sloped(told: Told, family: Family) -> Family:
    """With gradient and Gauss-Newton matrix too.

    Those by the law and by the joints' own springs follow the swings in time; those by all other
    parameters take the joints as springs that are stiffer by what each hit makes of them.
    """
    assert family.off is not None
    assert family.stiffer is not None
    data, plain = told.data, told.plain
    system = system_of(plain, family.x)
    joints = joints_of(system, told.hits, data.fastest_hz)
    moved = rates(family.law, family.k, family.a, joints, told.hits, data.s)
    ours = np.array(
        [compared(data, _frfs(told, system, one, 0.0)) for kind in moved for one in kind]
    )
    m, d = len(family.scale), len(plain.x)
    linear = linearised(data, plain, family.x, system.blocks, family.stiffer).slope
    linear = np.swapaxes(linear, 0, 1).copy()
    own = [own_parameter(plain, int(block)) for block in system.blocks]
    linear[own] = 0.0
    np.add.at(linear, own, ours[2 * m :])  # tied springs share a parameter
    root = np.sqrt(data.weight)
    jacobian = (np.concatenate([linear, ours[: 2 * m]]) * root).reshape(d + 2 * m, -1)
    flat = jacobian.view(float)
    away, sd = _prior(plain, family)
    full = flat @ flat.T + np.diag(0.5 / sd**2)
    gradient = 0.5 * away / sd - flat @ (root * family.off).ravel().view(float)
    return replace(family, normal=full, gradient=gradient)


def _prior(plain: Fit, family: Family) -> tuple[np.ndarray, np.ndarray]:
    """How far (x, ν) is from its middle, in sds, and the sds."""
    m = len(family.scale)
    sd = np.concatenate([plain.misfit.sd, np.repeat(SD, m)])
    middle = np.concatenate([plain.misfit.mean, np.repeat(MEAN, m)])
    return (np.concatenate([family.x, family.nu.ravel()]) - middle) / sd, sd


def _frfs(told: Told, system: System, spectrum: np.ndarray, share: float = 1.0) -> np.ndarray:
    """H = s² (share · G − G_ports T / F) of all columns (c, 3, F); spectra T (m, c, F)."""
    data = told.data
    out = np.empty_like(data.h)
    for visit in np.unique(data.hits.visit):
        g = receptances(system, int(visit), data.s)
        for c in np.flatnonzero(data.hits.visit == visit):
            part = (spectrum[:, c] / data.force[c]).T[..., None]
            h = share * g.sensor_hit[:, :, data.hits.axis[c]] - (g.sensor_port @ part)[..., 0]
            out[c] = (data.s[:, None] ** 2 * h).T
    return out


def step(plain: Fit, f: Family) -> Family:
    """Where Levenberg and Marquardt would go next; not far at once."""
    assert f.normal is not None
    assert f.gradient is not None
    m = len(f.scale)
    full = f.normal + f.damping * np.diag(np.diagonal(f.normal))
    move = -np.linalg.solve(full, f.gradient)
    nu = f.nu + np.clip(move[-2 * m :].reshape(2, m), -LONGEST, LONGEST)
    lacking = f.sign < 0 or f.law.effect == "backlash"
    nu[0] = np.clip(nu[0], LEAST, MOST_LACKING if lacking else MOST)
    nu[1] = np.clip(nu[1], -FARTHEST, FARTHEST)
    mean, sd = plain.misfit.mean, plain.misfit.sd
    x = f.x + np.clip(move[: -2 * m], -LONGEST * sd, LONGEST * sd)
    return replace(f, x=np.clip(x, mean - FARTHEST * sd, mean + FARTHEST * sd), nu=nu)


def settled(told: Told, family: Family, softness: Sequence[float]) -> Family:
    """Where the descent ends, errors being taken as softened by one share after the other."""
    for share in softness:
        now = replace(told, data=softened(told.data, share))
        family = _descended(now, evaluate(now, replace(family, damping=FIRST)))
        if not np.isfinite(family.value):
            break
    return family


def _descended(told: Told, family: Family) -> Family:
    for _ in range(ROUNDS):
        if not np.isfinite(family.value):
            break
        here = sloped(told, family)
        new = evaluate(told, step(told.plain, here))
        while not new.value < here.value and here.damping < HEAVIEST:
            here = replace(here, damping=HEAVIER * here.damping)
            new = evaluate(told, step(told.plain, here))
        if not new.value < here.value:
            return here
        family = replace(new, normal=here.normal, damping=here.damping / 10)
        if here.value - new.value < GAIN * new.value:
            break
    return family


def straightened(plain: Fit, family: Family, joint: int) -> Family:
    """With a spring in the stead of one joint's law, as stiff as that was in the mean."""
    assert family.stiffer is not None
    own = own_parameter(plain, int(system_of(plain).blocks[joint]))
    x, nu = family.x.copy(), family.nu.copy()
    added = float(np.median(family.stiffer[:, joint])) / float(np.exp(x[own]))
    x[own] += np.log(max(1 + added, LEAST_LEFT))
    nu[0, joint] = LEAST
    return replace(family, x=x, nu=nu)


def differences(told: Told, family: Family) -> tuple[float, float, float]:
    """Of the weaker hits' differences to the strongest: χ² with and without the law, and values."""
    data = told.data
    found = evaluate(told, family)
    weaker = (data.best != np.arange(len(data.h)))[:, None, None]
    weight = np.where(weaker, data.weight, 0.0)
    before = float(np.sum(weight * np.abs(data.h - data.h[data.best]) ** 2))
    if found.off is None or not np.isfinite(found.value):
        return np.inf, before, float(np.count_nonzero(weight))
    left = float(np.sum(weight * np.abs(found.off) ** 2))
    return left, before, float(np.count_nonzero(weight))
