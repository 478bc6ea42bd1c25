"""Hits of different force along one axis of a pose, and how the fitted robot answers each."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import next_fast_len

from planner.dataset.dataset import LAID, Dataset
from planner.dataset.visits import Visit
from planner.dynamics.gradient import moved
from planner.dynamics.motion import Motion
from planner.fit.data import FrfData
from planner.fit.fitted import StructureFit
from planner.fit.misfit import FrfMisfit
from planner.fit.weights import ELL, SHARE
from planner.frf.spectra import Spectra, transform
from planner.measurement.measured_frfs import Measured
from planner.measurement.nuisances import hit_basis

FADED = 0.1  # of the window's weight, below which nothing is told of a motion


@dataclass(frozen=True)
class JointPort:
    """A joint's spring about (along) its own axis: "joint_2", its number among all, N·m/rad.

    `joint` is its name in robot.toml.
    """

    at: str
    joint: str
    spring: int
    stiffness: float
    slides: bool


@dataclass(frozen=True)
class Clock:
    """From spectra at lines 1 … K of records of so many `samples`, windowed, to instants and back.

    Instants are three a period of the highest line, as long as the window lets enough through.
    """

    samples: int
    lines: int
    step_s: float
    rate_1_s: float

    @property
    def _count(self) -> int:
        return int(next_fast_len(3 * self.lines, real=True) or 0)

    @property
    def instant_s(self) -> float:
        """From one instant to the next."""
        return self.samples * self.step_s / self._count

    @property
    def window(self) -> np.ndarray:
        """(T,): what it makes of the instants."""
        t = np.arange(self._count) * self.instant_s
        window = np.exp(-self.rate_1_s * t)
        return window[window > FADED]

    def windowed(self, spectrum: np.ndarray) -> np.ndarray:
        """(…, T) as the window shows them, of (…, K); sums as transforms have them."""
        padded = np.zeros((*spectrum.shape[:-1], self._count // 2 + 1), dtype=complex)
        padded[..., 0] = spectrum[..., 0].real  # what is slower than the first line
        padded[..., 1 : self.lines + 1] = spectrum
        return np.fft.irfft(padded, self._count)[..., : len(self.window)]

    def instants(self, spectrum: np.ndarray) -> np.ndarray:
        """The same without the window, in units per instant."""
        return self.windowed(spectrum) / self.window * (self._count / self.samples)

    def spectrum(self, instants: np.ndarray) -> np.ndarray:
        """(…, K) of (…, T)."""
        whole = np.fft.rfft(instants * self.window, self._count)
        return whole[..., 1 : self.lines + 1] * (self.samples / self._count)


@dataclass(frozen=True, eq=False)
class HitGroup:
    """n hits along one axis without leaving a pose, at L of K lines; J joints may bend.

    `accelerance` (n, 3, L) in m/s²/N and the `variance` of its noise, `size` (3, L) to which what
    nothing explains is proportional, `hit_errors` (4 n, n, 3, L) by sds of each hit's own errors.
    At all K lines: `swing` (n, J, K) of the joints were they linear, `own` (J, K) rad per N·m and
    `shown` (J, 3, K) accelerations per N·m there, `force` (n, K) under a window from the record's
    start.
    """

    peak_n: np.ndarray
    lines: np.ndarray
    accelerance: np.ndarray
    variance: np.ndarray
    size: np.ndarray
    hit_errors: np.ndarray
    swing: np.ndarray
    own: np.ndarray
    shown: np.ndarray
    force: np.ndarray
    clock: Clock


def own_ports(found: StructureFit) -> tuple[JointPort, ...]:
    """The joints with a spring of their own."""
    s = found.structure
    robot, stiffness = s.prior.effect_library.simulation.robot, s.elasticity(found.at.x).stiffness
    ports: dict[str, JointPort] = {}
    for own, spring in enumerate(s.springs):
        block = robot.config.compliance[spring]
        if robot.is_own(block):
            at = f"joint_{robot.joint_names.index(block.joint) + 1}"
            ports.setdefault(
                at, JointPort(at, block.joint, own, float(stiffness[own]), block.slide)
            )
    return tuple(ports.values())


def hit_groups(recorded: Dataset, found: StructureFit) -> tuple[HitGroup, ...]:
    """Of all visits, axes that were hit more than once."""
    length = max((len(h.force_n) for v in recorded.visits for h in v.hits), default=0)
    springs, out = [p.spring for p in own_ports(found)], []
    for visit in recorded.visits:
        spectra = transform(visit.hits, recorded.band_hz, LAID, recorded.window_rate_1_s, length)
        out += _groups(recorded, found, springs, visit, spectra, length)
    return tuple(g for g in out if g.clock == out[0].clock)


def _groups(
    recorded: Dataset, found: StructureFit, own: list[int], visit: Visit, spectra: Spectra,
    length: int,
) -> list[HitGroup]:  # fmt: skip
    f, rate = spectra.frequency_hz, LAID + recorded.window_rate_1_s
    f = f[f <= recorded.band_hz[1]]
    s = 2j * np.pi * f + rate
    apart = np.arange(np.log(recorded.band_hz[0]), np.log(f[-1]), np.log1p(ELL))
    lines = np.unique(np.searchsorted(f, np.exp(apart)))  # so far apart that each errs by itself
    force = np.array([h.force for h in spectra.hits])[:, : len(f)]
    h = np.array([h.response for h in spectra.hits])[..., lines] / force[:, None, lines]
    noise = np.array([h.noise for h in spectra.hits])[:, :, None]
    force_noise = np.array([h.force_noise for h in spectra.hits])[:, None, None]
    variance = (noise + np.abs(h) ** 2 * force_noise) / np.abs(force[:, None, lines]) ** 2
    motion = _motion(found, own, visit.q, f, s)
    axes = np.array([hit.axis_index for hit in visit.hits])
    peaks = np.array([hit.pulse.peak_n for hit in visit.hits])
    means = {int(a): h[axes == a].mean(axis=0) for a in np.unique(axes)}
    rms = np.sqrt(np.mean([np.abs(m) ** 2 for m in means.values()], axis=(0, 1)))
    answered = motion.accelerance[:, :, :3][..., lines]
    for axis, mean in means.items():
        answered[0, :, axis] = mean  # what tilts do, hits along other axes tell where there are any
    moment = motion.shown_of(motion.matrices.hit_turn)[..., lines]
    basis = hit_basis(answered, moment, found.misfit.tolerances)[0]
    clock = Clock(length, len(f), 1 / visit.hits[0].sampling_rate_hz, rate)
    force *= np.exp(-rate * spectra.peak_s)  # windows begin with the record now
    answers = motion.x_hit[0][own, 3:][range(len(own)), range(len(own))]
    shown, out = s**2 * motion.x_sensor[0][own], []
    for axis, mean in means.items():
        mine = np.flatnonzero(axes == axis)
        n, swing = len(mine), motion.x_hit[0][own, axis] * force[mine][:, None]
        misses = np.zeros((n, 4, n, *mean.shape), dtype=complex)
        misses[range(n), :, range(n)] = basis[axis]
        size, misses = np.hypot(np.abs(mean), SHARE * rms), misses.reshape(4 * n, n, *mean.shape)
        here = peaks[mine], lines, h[mine], variance[mine], size, misses
        out += [HitGroup(*here, swing, answers, shown, force[mine], clock)] if n > 1 else []
    return out


def _motion(
    found: StructureFit, own: list[int], q: np.ndarray, f: np.ndarray, s: np.ndarray
) -> Motion:
    """Of the fitted robot at q (dof,) in rad under hits, and under torques of its own springs."""
    ones, elastic = np.ones((1, 3, 3, len(f))), found.structure.prior.carried
    measured = Measured(f[None], s[None], ones.astype(complex), ones, np.full(1, np.inf))
    data = FrfData(q[None], measured, elastic.matrices(q), elastic.body_jacobians(q[None]))
    x = found.at.x
    misfit = FrfMisfit(found.structure, data, found.misfit.tolerances).levered(x)
    m = misfit.matrices
    ports = np.eye(m.hit.shape[2])[own][None]
    wider = replace(m, hit=np.concatenate([m.hit, ports], axis=1))
    springs = found.structure.elasticity(x)
    added = [z for z in misfit.impedances(x) if z is not None]
    return moved(wider, springs, s[None], misfit.mass(x), added)
