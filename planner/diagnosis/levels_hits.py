"""Hits of different force along one axis of a pose, and how the fitted robot answers each."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import next_fast_len

from planner.dataset.dataset import LAID, Dataset
from planner.dataset.visits import Visit
from planner.dynamics.gradient import moved
from planner.dynamics.motion import Motion, Turned
from planner.fit.data import FrfData
from planner.fit.fitted import StructureFit
from planner.fit.misfit import ELL, SHARE, FrfMisfit
from planner.frf.spectra import Spectra, Windows, transform
from planner.measurement.measured_frfs import Measured
from planner.measurement.nuisances import ACROSS, Tolerances, hit_basis
from planner.recording.force_levels import peak_n

FADED = 0.05  # of the window's weight, below which nothing is told of a motion


@dataclass(frozen=True)
class JointPort:
    """A joint's spring about (along) its own axis: "joint_2", N·m/rad (N/m)."""

    at: str
    stiffness: float
    slides: bool


@dataclass(frozen=True, eq=False)
class HitGroup:
    """n hits along one axis without leaving a pose, at L of K lines; J joints may bend.

    `accelerance` (n, 3, L) in m/s²/N and the `variance` of its noise, `size` (3, L) to which what
    nothing explains is proportional, `misses` (n · 4, n, 3, L) by sds of each hit's own errors.
    At all K lines: `swing` (n, J, K) of the joints were they linear, `own` (J, K) rad per N·m and
    `shown` (J, 3, K) of accelerations per N·m there, `force` (n, K).
    """

    level: np.ndarray
    peak_n: np.ndarray
    lines: np.ndarray
    accelerance: np.ndarray
    variance: np.ndarray
    size: np.ndarray
    misses: np.ndarray
    swing: np.ndarray
    own: np.ndarray
    shown: np.ndarray
    force: np.ndarray
    clock: "Clock"


@dataclass(frozen=True, eq=False)
class Clock:
    """From spectra at lines 1 … K of records (`samples`), windowed, to instants and back."""

    samples: int
    lines: int
    step_s: float
    rate_1_s: float
    peak_s: float

    @property
    def count(self) -> int:
        """Instants, three a period of the highest line."""
        return next_fast_len(3 * self.lines, real=True)

    @property
    def window(self) -> np.ndarray:
        """(count,): what the exponential window makes of instants."""
        t = np.arange(self.count) * self.samples * self.step_s / self.count
        return np.exp(-self.rate_1_s * (t - self.peak_s))

    @property
    def heard(self) -> int:
        """Instants until which the window lets enough of a motion through."""
        return int(np.count_nonzero(self.window > FADED))

    def windowed(self, spectrum: np.ndarray) -> np.ndarray:
        """(…, heard) instants as the window shows them, of (…, K); sums as transforms have them."""
        padded = np.zeros((*spectrum.shape[:-1], self.count // 2 + 1), dtype=complex)
        padded[..., 0] = spectrum[..., 0].real  # what is slower than the first line
        padded[..., 1 : self.lines + 1] = spectrum
        return np.fft.irfft(padded, self.count)[..., : self.heard]

    def instants(self, spectrum: np.ndarray) -> np.ndarray:
        """The same without the window, in units per instant."""
        shown = self.windowed(spectrum) / self.window[: self.heard]
        return shown * (self.count / self.samples)

    def spectrum(self, instants: np.ndarray) -> np.ndarray:
        """(…, K) of (…, heard)."""
        whole = np.fft.rfft(instants * self.window[: self.heard], self.count)
        return whole[..., 1 : self.lines + 1] * (self.samples / self.count)


def own_ports(found: StructureFit) -> tuple[tuple[JointPort, ...], list[int]]:
    """The joints with a spring of their own, and its numbers among the structure's springs."""
    s = found.structure
    robot, stiffness = s.prior.repertoire.simulation.robot, s.elasticity(found.at.x).stiffness
    ports: dict[str, tuple[JointPort, int]] = {}
    for own, spring in enumerate(s.springs):
        block = robot.config.compliance[spring]
        if robot.is_own(block):
            at = f"joint_{robot.joint_names.index(block.joint) + 1}"
            ports.setdefault(at, (JointPort(at, float(stiffness[own]), bool(block.slide)), own))
    return tuple(p for p, _ in ports.values()), [own for _, own in ports.values()]


def hit_groups(recorded: Dataset, found: StructureFit) -> tuple[HitGroup, ...]:
    """Of all visits, axes that were hit more than once."""
    length = max((len(h.force_n) for v in recorded.visits for h in v.hits), default=0)
    out = []
    for visit in recorded.visits:
        spectra = transform(
            visit.hits, recorded.band_hz, Windows(LAID, recorded.window_rate_1_s), length
        )
        out += _groups(recorded, found, visit, spectra, length)
    return tuple(out)


def _groups(
    recorded: Dataset, found: StructureFit, visit: Visit, spectra: Spectra, length: int
) -> list[HitGroup]:
    axes = [h.axis_index for h in visit.hits]
    several = [a for a in range(3) if axes.count(a) > 1]
    if not several:
        return []
    f, rate = spectra.frequency_hz, LAID + recorded.window_rate_1_s
    s = 2j * np.pi * f + rate
    lines = _spread(f, recorded.band_hz)
    force = np.array([h.force for h in spectra.hits])
    h = np.array([h.response for h in spectra.hits])[..., lines] / force[:, None, lines]
    noise = np.array([h.noise for h in spectra.hits])[:, :, None]
    force_noise = np.array([h.force_noise for h in spectra.hits])[:, None, None]
    variance = (noise + np.abs(h) ** 2 * force_noise) / np.abs(force[:, None, lines]) ** 2
    motion = _motion(found, visit.q, f, s)
    own = own_ports(found)[1]
    means = {a: h[np.array(axes) == a].mean(axis=0) for a in range(3) if a in axes}
    basis = _misses(motion, lines, means, found.misfit.tolerances)
    rms = np.sqrt(np.mean([np.abs(m) ** 2 for m in means.values()], axis=(0, 1)))
    clock = Clock(length, len(f), visit.hits[0].sampling_rate_hz ** -1, rate, spectra.peak_s)
    out = []
    for axis in several:
        mine = [i for i, a in enumerate(axes) if a == axis]
        n, hits = len(mine), [visit.hits[i] for i in mine]
        misses = np.zeros((n, 4, n, *h.shape[1:]), dtype=complex)
        misses[range(n), :, range(n)] = basis[axis]
        port_hit = motion.x_hit[0][own, axis]
        out.append(
            HitGroup(
                np.array([recorded.level(hit) for hit in hits]),
                np.array([peak_n(hit) for hit in hits]),
                lines,
                h[mine],
                variance[mine],
                np.hypot(np.abs(means[axis]), SHARE * rms),
                misses.reshape(4 * n, n, *h.shape[1:]),
                port_hit * force[mine][:, None],
                motion.x_hit[0][own, 3 + np.arange(len(own))],
                (s**2) * motion.x_sensor[0][own],
                force[mine],
                clock,
            )
        )
    return out


def _spread(frequency_hz: np.ndarray, band_hz: tuple[float, float]) -> np.ndarray:
    """Numbers of lines in the band that lie so far apart that each errs by itself."""
    chosen, last = [], 0.0
    for number, f in enumerate(frequency_hz):
        if band_hz[0] <= f <= band_hz[1] and f >= last * (1 + ELL):
            chosen.append(number)
            last = float(f)
    return np.array(chosen)


def _motion(found: StructureFit, q: np.ndarray, f: np.ndarray, s: np.ndarray) -> Motion:
    """Of the fitted robot at q (dof,) in rad under hits, and under torques of its own springs."""
    structure, own = found.structure, own_ports(found)[1]
    ones = np.ones((1, 3, 3, len(f)))
    measured = Measured(f[None], s[None], ones.astype(complex), ones, np.full(1, np.inf))
    elastic = structure.prior.carried
    data = FrfData(q[None], measured, elastic.matrices(q), elastic.body_jacobians(q[None]))
    misfit = FrfMisfit(structure, data, found.misfit.tolerances)
    x, m = found.at.x, misfit.matrices
    ports = np.eye(m.hit.shape[2])[own][None]
    wider = replace(m, hit=np.concatenate([m.hit, ports], axis=1))
    return moved(wider, structure.elasticity(x), s[None], misfit.mass(x), misfit.impedances(x))


def _misses(
    motion: Motion, lines: np.ndarray, means: dict[int, np.ndarray], t: Tolerances
) -> np.ndarray:
    """(3, 4, 3, L) of a hit along each axis; what tilts do as hits along other axes tell it."""
    some = replace(motion, x_hit=motion.x_hit[:, :, :3][..., lines],
                   x_sensor=motion.x_sensor[..., lines], s=motion.s[:, lines],
                   matrices=replace(motion.matrices, hit=motion.matrices.hit[:, :3]))  # fmt: skip
    basis = hit_basis(some.accelerance, Turned((some,)).moment, t)[0]
    for axis in range(3):
        for tilt, across in enumerate(ACROSS[axis]):
            if across in means:
                basis[axis, tilt] = t.angle_rad * means[across]
    return basis
