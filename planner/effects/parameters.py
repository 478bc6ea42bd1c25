"""What is identified: logarithms of stiffness, damping and loss factor, and inertial nuisances."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from planner.dynamics.simulation import Elasticity, Simulation
from planner.errors import InputError
from planner.robot.config import Compliance, RobotConfig
from planner.robot.urdf_inertias import stated_shares

KINDS = ("stiffness", "damping", "loss_factor")
UNITS = {"stiffness": "N·m/rad", "damping": "N·m·s/rad", "loss_factor": "1"}
SLIDE_UNITS = {"stiffness": "N/m", "damping": "N·s/m", "loss_factor": "1"}
MOMENTS = [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)]  # of inertia, in Pinocchio's order
INERTIAL = ("mass", "com_x", "com_y", "com_z", *(f"i_{'xyz'[i]}{'xyz'[j]}" for i, j in MOMENTS))


@dataclass(frozen=True)
class Priors:
    """What is known before: log-normal around robot.toml's values, or within stated bounds.

    `stiffness_factor` and so on are e^sd of the logarithm. `bounds` maps the name of a parameter
    to its least and largest plausible value; the log-normal then has mean and sd of a log-uniform
    one. `bias_factor` is e^sd of what all stiffnesses
    have in common, those with bounds excepted. What robot.toml says of its stiffnesses goes before
    both factors. `mass`, `inertia` (relative) and `com_m` are sds of the inertias of robot and
    URDF; where all are 0, inertias are taken for exact. `elsewhere` is by how much of its radius of
    gyration a body's centre is off besides, and by how many rad its principal axes are: 1 cm is
    much of a wrist, and little of an arm.
    """

    stiffness_factor: float = 3.0
    damping_factor: float = 5.0
    loss_factor_factor: float = 3.0
    bias_factor: float = 1.0
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    mass: float = 0.0
    inertia: float = 0.0
    com_m: float = 0.0
    elsewhere: float = 0.0

    @property
    def inertial(self) -> bool:
        """Whether inertias are uncertain."""
        return max(self.mass, self.inertia, self.com_m) > 0


# What the inertial parameters of a CAD model err by: with cables, oil and covers left out.
CAD_INERTIAS = Priors(mass=0.08, inertia=0.08, com_m=0.01)


@dataclass(frozen=True)
class Parameter:
    """One number to identify, shared by [[compliance]] blocks (counted from 0).

    Its logarithm has a normal prior with mean ln `median` and standard deviation `log_sd`, of which
    `shared` is that of a deviation common to all stiffnesses. Where it is not `stated`, it is known
    to lie within bounds.
    """

    name: str
    kind: str
    blocks: tuple[int, ...]
    median: float
    log_sd: float
    shared: float = 0.0
    slide: bool = False
    stated: bool = True

    @property
    def unit(self) -> str:
        """SI unit of the parameter."""
        return unit_of(self.kind, self.slide)


@dataclass(frozen=True, eq=False)
class Parametrisation:
    """From θ (P,), logarithms of the parameters, to springs; and what inertias err by.

    All logarithms of springs together (3e or 2e: stiffness, damping, loss factor if there is any)
    are `held` + `spread` θ.
    """

    parameters: tuple[Parameter, ...]
    held: np.ndarray
    spread: np.ndarray  # (2e or 3e, P) of 0 and 1
    size: int
    nuisances: tuple[str, ...]
    inertia: np.ndarray  # (bodies, 10, 10): change of the inertia by one sd

    @property
    def mean(self) -> np.ndarray:
        """Prior mean of θ (P,)."""
        return np.log([p.median for p in self.parameters])

    @property
    def log_sd(self) -> np.ndarray:
        """Prior sd of θ (P,)."""
        return np.array([p.log_sd for p in self.parameters])

    @cached_property
    def covariance(self) -> np.ndarray:
        """Prior covariance of θ (P, P): springs stated too stiff may all be so."""
        shared = np.array([p.shared for p in self.parameters])
        return np.diag(self.log_sd**2 - shared**2) + np.outer(shared, shared)

    def elasticity(self, theta: np.ndarray) -> Elasticity:
        """Springs at θ (P,)."""
        values = np.exp(self.held + self.spread @ theta).reshape(-1, self.size)
        none = np.zeros(self.size)
        return Elasticity(values[0], values[1], values[2] if len(values) > 2 else none)


def parametrise(simulation: Simulation, priors: Priors) -> Parametrisation:
    """Parameters of a simulation; blocks with a common `tie` share theirs, zeros stay zeros.

    Raises InputError where `bounds` names no parameter or bounds nothing.
    """
    elasticity, config = simulation.elasticity, simulation.robot.config
    groups: dict[str, list[int]] = {}
    for number, block in enumerate(config.compliance):
        groups.setdefault(block.tie or f"\0{number}", []).append(number)
    kinds = KINDS if elasticity.loss_factor.any() else KINDS[:2]
    e = simulation.elastic.size
    values = np.concatenate([getattr(elasticity, kind) for kind in kinds])
    parameters, columns = [], []
    for k, kind in enumerate(kinds):
        for tie, blocks in groups.items():
            if values[k * e + blocks[0]] > 0:
                name = f"{kind} of {_place(simulation, tie, blocks)}"
                value = float(values[k * e + blocks[0]])
                if name in priors.bounds:
                    parameters.append(_bounded(name, kind, tuple(blocks), *priors.bounds[name]))
                else:
                    factors = _factors(config, kind, blocks[0], priors)
                    parameters.append(_stated(name, kind, tuple(blocks), value, *factors))
                slide = config.compliance[blocks[0]].slide
                parameters[-1] = replace(parameters[-1], slide=slide)
                columns.append(np.isin(np.arange(len(values)), k * e + np.array(blocks)))
    unknown = set(priors.bounds) - {p.name for p in parameters}
    if unknown:
        raise InputError(
            f"{simulation.robot.path}: bounds are given for {sorted(unknown)[0]!r}, which is no "
            f"parameter; there are {', '.join(p.name for p in parameters)}."
        )
    spread = np.array(columns, dtype=float).T
    free = spread.any(axis=1)
    with np.errstate(divide="ignore"):
        held = np.where(free, 0.0, np.log(np.where(free, 1.0, values)))
    names, inertia = _nuisances(simulation, priors)
    return Parametrisation(tuple(parameters), held, spread, e, names, inertia)


def _place(simulation: Simulation, tie: str, blocks: list[int]) -> str:
    if not tie.startswith("\0"):
        return tie
    block = simulation.robot.config.compliance[blocks[0]]
    return place_name(block)


def unit_of(kind: str, slide: bool) -> str:
    """Unit of a spring's "stiffness", "damping" or "loss_factor"."""
    return (SLIDE_UNITS if slide else UNITS)[kind]


def place_name(block: Compliance) -> str:
    """Where an elastic degree of freedom is: "joint_2 about z", "base along x"."""
    how = "along" if block.slide or block.lever_m else "about"
    return f"{block.joint} {how} {axis_name(block.axis)}"


def axis_name(axis: tuple[float, float, float]) -> str:
    """x, y or z, or the vector in words."""
    for i, letter in enumerate("xyz"):
        if abs(axis[i]) > 1 - 1e-9:
            return letter if axis[i] > 0 else f"−{letter}"
    return "(" + ", ".join(f"{round(a, 3) + 0.0:g}" for a in axis) + ")"


def _bounded(name: str, kind: str, blocks: tuple[int, ...], low: float, high: float) -> Parameter:
    if not 0 < low < high < float("inf"):
        raise InputError(f"Bounds {low}, {high} of {name} must rise from above 0; correct them.")
    log_sd = float(np.log(high / low) / np.sqrt(12))
    median = float(np.sqrt(low * high))
    return Parameter(name, kind, blocks, median, log_sd, stated=False)


def _stated(
    name: str, kind: str, blocks: tuple[int, ...], value: float, own: float, bias: float
) -> Parameter:
    """Around a stated value: factors of its own deviation and of what it shares with others."""
    shared = float(np.log(bias))
    log_sd = float(np.hypot(np.log(own), shared))
    return Parameter(name, kind, blocks, value, log_sd, shared)


def _factors(config: RobotConfig, kind: str, block: int, priors: Priors) -> tuple[float, float]:
    """e^sd of a parameter's own deviation and of the common one: robot.toml's, else `priors`'."""
    if kind != "stiffness":
        return getattr(priors, f"{kind}_factor"), 1.0
    own, bias = priors.stiffness_factor, priors.bias_factor
    of_block = config.compliance[block].stiffness_sd_percent
    percent = config.stiffness_sd_percent if of_block is None else of_block
    if percent is not None:
        own = 1 + percent / 100
    if config.stiffness_bias_sd_percent is not None:
        bias = 1 + config.stiffness_bias_sd_percent / 100
    return own, bias


def _nuisances(simulation: Simulation, priors: Priors) -> tuple[tuple[str, ...], np.ndarray]:
    """Per body: mass at a fixed gyration radius, the COM's place, and moments about the COM.

    The COM moves the moments by a term of second order too, which keeps M from being linear: it is
    left to the moments, whose sds are widened by as much. Links whose sd robot.toml states have
    their own; what else turns with them has the prior's.
    """
    bodies = simulation.elastic.bodies
    change = np.zeros((len(bodies), len(INERTIAL), 10))
    if not priors.inertial:
        return (), change[:, :0]
    for b, nominal in enumerate(simulation.elastic.inertia):
        m = nominal[0]
        com = nominal[1:4] / m if m > 0 else np.zeros(3)
        central = nominal[4:] - _point(m, com)
        size = np.sqrt(np.abs(central[[0, 2, 5]]))
        radius = np.sqrt(nominal[[4, 6, 9]].sum() / (2 * m)) if m > 0 else 0.0
        shares = stated_shares(simulation.robot, bodies[b])
        own = float(np.hypot.reduce([share * sd for share, sd in shares])) if shares else 0.0
        rest = max(0.0, 1 - sum(share for share, _ in shares))
        elsewhere = np.hypot(rest * priors.elsewhere, own)
        com_m = np.hypot(rest * priors.com_m, elsewhere * radius)
        change[b, 0] = np.hypot(rest * priors.mass, own) * nominal
        for axis in range(3):
            step = np.eye(3)[axis]
            change[b, 1 + axis, 1 + axis] = com_m * m
            slope = _point(m, com + step) - _point(m, com) - _point(m, step)
            change[b, 1 + axis, 4:] = com_m * slope
        for k, (i, j) in enumerate(MOMENTS, 4):
            turned = elsewhere * (size[i] ** 2 - size[j] ** 2)
            spread = np.hypot(rest * priors.inertia, own) * size[i] * size[j]
            change[b, k, k] = np.hypot(spread, turned) + m * com_m**2
    return tuple(f"{what} of {body}" for body in bodies for what in INERTIAL), change


def _point(mass: float, at: np.ndarray) -> np.ndarray:
    """Moments about the origin of a point mass, as MOMENTS lists them."""
    moments = mass * (at @ at * np.eye(3) - np.outer(at, at))
    return np.array([moments[i, j] for i, j in MOMENTS])
