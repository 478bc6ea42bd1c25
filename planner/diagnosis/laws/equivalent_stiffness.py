"""Equivalent stiffness of a joint against force level, from FRFs alone.

A joint that is not linear answers a hit about as a linear one of some complex stiffness k + Δ that
depends on how far it swings (equivalent linearisation; Worden & Tomlinson 2001, section 3.2). A
change Δ of one joint is of rank one, so that FRFs follow in closed form, and the differences
between force levels tell Δ for every hit: the joint that explains them all is the nonlinear one,
and the course of Δ over its swing tells of which kind it is.
"""

from dataclasses import dataclass

import numpy as np

from planner.dataset.dataset import Dataset
from planner.dataset.level_columns import Column
from planner.diagnosis.laws.open_misses import OpenMisses, Pair, lines_of, stronger
from planner.diagnosis.linear.fit import Fit
from planner.dynamics.simulation import Elasticity, Simulation

INSTANTS_S = np.linspace(0, 0.5, 257)
STARTS = (-0.5, -0.1, 0.1, 0.5, 1.5)  # of Δ, times the joint's stiffness
STEPS = 12
LEAST, MOST = -0.95, 5.0  # of Δ, times the joint's stiffness


@dataclass(frozen=True, eq=False)
class System:
    """The refitted simulation at the visits: M (n, e, e), C and K (e,), Jacobians (n, 3, e).

    `ports` are the joints with a spring about (or along) their own axis, `blocks` (J,) those
    springs; `slides` (J,) says which shift, none where it is empty.
    """

    mass: np.ndarray
    geometric: np.ndarray
    hit: np.ndarray
    sensor: np.ndarray
    elasticity: Elasticity
    ports: tuple[str, ...]
    blocks: np.ndarray
    slides: tuple[bool, ...] = ()


@dataclass(frozen=True, eq=False)
class Receptances:
    """Of a visit at s (F,): sensor/hit (F, 3, 3), sensor/port (F, 3, J), port/hit (F, J, 3).

    `between` (F, J, J) is ports on ports.
    """

    s: np.ndarray
    sensor_hit: np.ndarray
    sensor_port: np.ndarray
    port_hit: np.ndarray
    between: np.ndarray

    @property
    def port_port(self) -> np.ndarray:
        """(F, J): each port on itself."""
        return np.einsum("fjj->fj", self.between)


def system_of(plain: Fit, x: np.ndarray | None = None) -> System:
    """The simulation of a linear fit, at its best point or at another x."""
    misfit = plain.misfit
    x = plain.x if x is None else x
    a, b = misfit.split
    mass = misfit.matrices.mass + misfit.inertias.mass_change(x[a:b])
    m, simulation = misfit.matrices, misfit.setting.simulation
    ports, blocks = own_springs(simulation)
    slides = tuple(simulation.robot.config.compliance[block].slide for block in blocks)
    springs = misfit.parametrisation.elasticity(x[:a])
    return System(mass, m.geometric, m.hit, m.sensor, springs, ports, blocks, slides)


def own_springs(simulation: Simulation) -> tuple[tuple[str, ...], np.ndarray]:
    """Places joint_1, … that have a spring about (along) their own axis, and its number (J,)."""
    robot, ports, blocks = simulation.robot, [], []
    for number, (joint, axis) in enumerate(zip(robot.joint_names, robot.joint_axes, strict=True)):
        for block, compliance in enumerate(robot.config.compliance):
            own = abs(np.array(compliance.axis) @ axis) > 0.99 * np.linalg.norm(compliance.axis)
            if compliance.joint == joint and own and robot.is_own(compliance):
                ports.append(f"joint_{number + 1}")
                blocks.append(block)
                break
    return tuple(ports), np.array(blocks, dtype=int)


def receptances(system: System, visit: int, s: np.ndarray) -> Receptances:
    """Receptances (m/N, m/(N·m), rad/N, rad/(N·m)) of a visit at s (F,)."""
    springs = system.elasticity
    z = (s**2)[:, None, None] * system.mass[visit] + system.geometric[visit]
    diagonal = np.einsum("fii->fi", z)
    diagonal += springs.stiffness * (1 + 1j * springs.loss_factor) + s[:, None] * springs.damping
    e, ports = len(springs.stiffness), system.blocks
    rows = np.concatenate([system.hit[visit].T, np.eye(e)[:, ports]], axis=1)
    x = np.linalg.solve(z, np.broadcast_to(rows.astype(complex), (len(s), *rows.shape)))
    at_sensor = system.sensor[visit] @ x
    own = x[:, ports[:, None], :][:, :, 0]  # (F, J, 3 + J)
    return Receptances(
        s,
        at_sensor[..., :3],
        at_sensor[..., 3:],
        own[..., :3],
        own[..., 3:],
    )


@dataclass(frozen=True, eq=False)
class Equivalent:
    """Of m pairs of force levels (the other one being the strongest) and J joints.

    `swing` (m, 2, J) in rad: the joint's largest angle at the two levels, were it linear. `delta`
    (m, J) N·m/rad complex: by how much it is stiffer (and lossier) than at the strongest level;
    `precision` (m, J) is 1/E|error|²; `chi2` (m, J) what is left, `before` (m,) without, over
    `count` (m,) values. `power` (m,) is what `before` would be were there nothing at one level.
    """

    visit: np.ndarray
    axis: np.ndarray
    level: np.ndarray  # the weaker one
    swing: np.ndarray
    delta: np.ndarray
    precision: np.ndarray
    chi2: np.ndarray
    before: np.ndarray
    count: np.ndarray
    power: np.ndarray


def telling(swings: np.ndarray) -> float:
    """Of largest angles (m,) of a joint the one that tells its law: half of all squares is beyond.

    Hits across its axis, or far from it, hardly swing a joint.
    """
    swings = np.sort(swings)
    squares = np.cumsum(swings**2)
    return float(swings[np.searchsorted(squares, squares[-1] / 2)])


def equivalent(recorded: Dataset, system: System, misses: OpenMisses | None = None) -> Equivalent:
    """Fit Δ of every joint, by itself, to every pair of levels.

    What `misses` of hits leave open is integrated out; without them hits are taken to be exact.
    """
    rows = []
    scale = system.elasticity.stiffness[system.blocks]
    for number, columns in enumerate(recorded.columns):
        if not columns:
            continue
        lines = lines_of(columns[0])
        s = 2j * np.pi * columns[0].frequency_hz + columns[0].rate_1_s
        full = receptances(system, number, s)
        missed = None if misses is None else misses.of_hits(number, columns, lines)
        for axis in range(3):
            group = [c for c in columns if c.axis == axis]
            swings = [swing(full, c) for c in group]
            for weaker, largest in zip(group[:-1], swings[:-1], strict=True):
                pair = Pair.of(weaker, group[-1], lines)
                pair = pair if missed is None else pair.opened(missed)
                found = _delta(full, axis, lines, pair, scale)
                before = float(pair.product(pair.change, pair.change))
                count = int(np.count_nonzero(pair.weight))
                whole = group[-1].accelerance[:, lines]
                power = float(pair.product(whole, whole))
                swung = np.array([largest, swings[-1]])
                rows.append((number, axis, weaker.level, swung, *found, before, count, power))
    parts = [np.array(part) for part in zip(*rows, strict=True)]
    return Equivalent(*parts)


def swing(full: Receptances, column: Column) -> np.ndarray:
    """Largest angle (J,) that the hit gives each joint, in the band."""
    spectrum = full.port_hit[:, :, column.axis] * column.force[:, None] * stronger(column)
    return np.max(np.abs((spectrum.T @ waves(full.s)).real), axis=1)


def waves(s: np.ndarray) -> np.ndarray:
    """(F, t) that turn spectra at evenly spaced s (F,) into their first half second."""
    step_hz = float((s[1] - s[0]).imag) / (2 * np.pi)
    return np.exp(np.outer(s, INSTANTS_S)) * 2 * step_hz


def _delta(
    full: Receptances, axis: int, lines: np.ndarray, pair: Pair, scale: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Δ (J,), precision (J,) and χ² (J,) of each joint: Gauss-Newton from several starts.

    Each Δ is one complex number, whose step solves two equations: all joints and starts go side
    by side as arrays, which a fit with a matrix at each (`inference.least_squares`) would not.
    """
    s2 = (full.s[lines] ** 2)[:, None, None]
    path = -s2 * full.sensor_port[lines] * full.port_hit[lines][:, None, :, axis]
    path = np.moveaxis(path, 0, 1)[:, :, :, None]  # (3, F, J, 1)
    own = full.port_port[lines][None, :, :, None]
    delta = np.array(STARTS) * scale[:, None] * (1 + 0j)  # (J, starts)

    def misfit(at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """χ², step and precision."""
        soft = 1 / (1 + at * own)
        residual = pair.change[:, :, None, None] - path * at * soft
        slope = path * soft**2
        a, b = pair.product(slope, slope), pair.product(1j * slope, 1j * slope)
        c = pair.product(slope, 1j * slope)
        right = pair.product(slope, residual), pair.product(1j * slope, residual)
        whole = a * b - c**2 + 1e-300
        step = (b * right[0] - c * right[1] + 1j * (a * right[1] - c * right[0])) / whole
        return pair.product(residual, residual), step, (a + b) / 2

    chi2, step, precision = misfit(delta)
    share = np.ones(delta.shape)
    for _ in range(STEPS):
        trial = delta + share * step
        real = np.clip(trial.real, LEAST * scale[:, None], MOST * scale[:, None])
        trial = real + 1j * np.clip(trial.imag, -scale[:, None], scale[:, None])
        new = misfit(trial)
        better = new[0] < chi2
        delta = np.where(better, trial, delta)
        chi2, step, precision = (
            np.where(better, n, o) for n, o in zip(new, (chi2, step, precision), strict=True)
        )
        share = np.where(better, 1.0, share / 4)
    best = np.argmin(chi2, axis=1)
    pick = np.arange(len(best)), best
    return delta[pick], precision[pick], chi2[pick]
