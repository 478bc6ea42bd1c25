"""Measured FRFs of several poses as arrays with one noise level per value.

Records that end before the decay does lack a part of it: a pulse's response is a sum of decays; cut
at T it loses ∫ from T of each, which in the transform is R λ² e^((λ−s)T) / (s−λ) for a pole λ with
residue R of the receptance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.dynamics.gradient import laplace
from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import Poles
from planner.errors import InputError
from planner.frf.frf import Frf
from planner.frf.metrics import mean_known
from planner.recording.points import TOOL, Layout, together
from planner.robot.elastic_model import ElasticModel, Matrices
from planner.robot.robot import Robot

# Where nothing is known of the noise: a share of the FRF, and one of the column's rms.
ASSUMED_RELATIVE, ASSUMED_FLOOR = 0.05, 0.01


@dataclass(frozen=True, eq=False)
class Measured:
    """FRFs of n poses at F lines each, lines being the pose's own.

    `s` (n, F) is the Laplace variable at which they hold, `accelerance` (n, r, c, F) in m/s²/N
    between the points of `layout`, `sd` (n, r, c, F) the root of E|δH|², ∞ where nothing was
    measured (accelerance is 1 there), `tail_s` (n,) as in `Frf`.
    """

    frequency_hz: np.ndarray
    s: np.ndarray
    accelerance: np.ndarray
    sd: np.ndarray
    tail_s: np.ndarray
    layout: Layout = TOOL

    @property
    def used(self) -> np.ndarray:
        """(n, r, c, F) bool."""
        return np.isfinite(self.sd)

    def at(self, poses: np.ndarray) -> "Measured":
        """Of some of the poses, by their numbers."""
        parts = self.frequency_hz, self.s, self.accelerance, self.sd, self.tail_s
        return Measured(*(part[poses] for part in parts), layout=self.layout)

    def loaded(self, matrices: Matrices, robot: Robot) -> Matrices:
        """Matrices between the points of `layout` with the mass of sensors that were there."""
        count = np.count_nonzero(self.used, axis=(2, 3)).reshape(len(self.used), -1, 3)
        there = np.sum(count, axis=2) > 0
        return with_sensors(matrices, robot, self.layout, there)


def common_band(frfs: Sequence[Frf], band_hz: tuple[float, float]) -> tuple[float, float]:
    """The part of a band in which any of the FRFs can be used. Raises InputError if there is none.

    Zero frequency is never part of it.
    """
    low = max(band_hz[0], min(f.usable_band_hz[0] for f in frfs))
    high = min(band_hz[1], max(f.usable_band_hz[1] for f in frfs))
    if not low < high:
        raise InputError(
            f"The FRFs can be used from {low:.4g} to {high:.4g} Hz within band_hz {list(band_hz)}, "
            f"which leaves nothing to fit; widen band_hz, or hit with a harder tip."
        )
    return low, high


def stack(
    frfs: Sequence[Frf],
    band_hz: tuple[float, float],
    most_lines: int,
    model_error: float,
    geometric: bool = False,
) -> Measured:
    """FRFs in a band, thinned out evenly to at most `most_lines` a pose.

    `model_error` is a relative sd added to that of the noise, for all that a simulation cannot
    follow: calibration, angles, friction. Lines are evenly spaced, or evenly on a logarithmic
    scale.
    """
    chosen = [_lines(frf, band_hz, most_lines, geometric) for frf in frfs]
    layout = together([frf.layout for frf in frfs])
    n, f = len(frfs), max(len(c) for c in chosen)
    if f == 0:
        raise InputError(
            f"No frequency line lies between {band_hz[0]:.4g} and {band_hz[1]:.4g} Hz; record "
            f"longer, or widen band_hz."
        )
    frequency = np.full((n, f), float(band_hz[1]))
    h = np.ones((n, *layout.shape, f), dtype=complex)
    sd = np.full((n, *layout.shape, f), np.inf)
    for i, (frf, lines) in enumerate(zip(frfs, chosen, strict=True)):
        count = len(lines)
        frequency[i, :count] = frf.frequency_hz[lines]
        values, noise = frf.accelerance[..., lines], noise_sd(frf)[..., lines]
        total = np.sqrt(noise**2 + (model_error * np.abs(values)) ** 2)
        given = np.isfinite(total) & (total > 0)
        at = np.ix_([i], layout.rows(frf.layout), layout.columns(frf.layout), range(count))
        h[at] = np.where(given, values, 1.0)
        sd[at] = np.where(given, total, np.inf)
    rates = np.array([frf.exponential_rate_1_s for frf in frfs])
    tails = np.array([frf.tail_s for frf in frfs])
    return Measured(frequency, laplace(frequency, rates), h, sd, tails, layout)


def matrices_at(elastic: ElasticModel, q: np.ndarray, frfs: Sequence[Frf]) -> Matrices:
    """Matrices at q (n, dof) between the points of FRFs measured there, their sensors' mass on.

    With slopes by the joint angles, for readbacks may err.
    """
    layout = together([frf.layout for frf in frfs])
    found = elastic.matrices(q, layout=layout, slopes=True)
    there = np.array([[name in f.layout.sensors for name in layout.sensors] for f in frfs])
    return with_sensors(found, elastic.robot, layout, there)


def with_sensors(found: Matrices, robot: Robot, layout: Layout, there: np.ndarray) -> Matrices:
    """With the mass of sensors at the poses where they were, `there` (n, s)."""
    mass = found.mass
    for number, name in enumerate(layout.sensors):
        kg = robot.sensor_mass_kg.get(name, 0.0)
        if kg:
            moved = found.sensor[:, 3 * number : 3 * number + 3]
            own = np.swapaxes(moved, 1, 2) @ moved
            mass = mass + kg * there[:, number, None, None] * own
    return replace(found, mass=mass)


def _lines(frf: Frf, band_hz: tuple[float, float], most: int, geometric: bool) -> np.ndarray:
    low = max(band_hz[0], frf.usable_band_hz[0])
    high = min(band_hz[1], frf.usable_band_hz[1])
    inside = np.flatnonzero((frf.frequency_hz >= low) & (frf.frequency_hz <= high))
    inside = inside[frf.frequency_hz[inside] > 0]
    if len(inside) <= most:
        return inside
    if not geometric:
        return inside[np.linspace(0, len(inside) - 1, most).round().astype(int)]
    # Of lines that would be chosen twice the next one is taken: as many as were asked for.
    wanted = np.geomspace(frf.frequency_hz[inside[0]], frf.frequency_hz[inside[-1]], most)
    near = np.searchsorted(frf.frequency_hz[inside], wanted).clip(0, len(inside) - 1)
    order = np.arange(most)
    near = np.maximum.accumulate(near - order) + order
    return inside[np.minimum(near, len(inside) - most + order)]


def noise_sd(frf: Frf) -> np.ndarray:
    """Sd (r, c, F) of an FRF: from the hits' scatter, else from the coherence, else assumed."""
    h, hits = np.abs(frf.accelerance), np.maximum(frf.hits, 1)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        # Bendat & Piersol 2010, eq. 9.90, for both parts of the complex value.
        share = np.sqrt((1 - frf.coherence) / (frf.coherence * hits))
        assumed = np.hypot(ASSUMED_RELATIVE * h, ASSUMED_FLOOR * _rms(h))
        from_coherence = np.where(np.isfinite(share), np.minimum(share, 10.0) * h, assumed)
    return np.where(np.isfinite(frf.variance), np.sqrt(frf.variance), from_coherence)


def _rms(size: np.ndarray) -> np.ndarray:
    """Of each sensor's axes and all lines, column by column, (r, c, 1) of (r, c, F)."""
    power = mean_known(size.reshape(-1, 3, *size.shape[1:]) ** 2, axis=(1, 3))
    return np.repeat(np.sqrt(power), 3, axis=0)[..., None]


OVER = -12.0  # Re λ T below which a decay is over: less than 1e-5 of it is left


def cut_off(solved: Poles, s: np.ndarray, tail_s: np.ndarray) -> np.ndarray:
    """(n, 3, 3, F) in m/s²/N at s (n, F) for records that end tail_s (n,) after the pulse.

    With loss factors, of the poles of K(1 + iη) those with a negative imaginary part grow: what is
    recorded has the conjugates of the others in their place.
    """
    out = np.zeros((*solved.residues.shape[:1], *solved.residues.shape[2:], s.shape[1]), complex)
    for i in np.flatnonzero(np.isfinite(tail_s)):
        alive = solved.poles[i].real * tail_s[i] > OVER
        if solved.structural:
            alive &= (solved.poles[i].imag > 0) & (solved.poles[i].real < 0)
        if not alive.any():
            continue
        pole = solved.poles[i, alive][:, None]
        flat = solved.residues[i, alive].reshape(len(pole), -1)
        if solved.structural:
            pole, flat = np.concatenate([pole, pole.conj()]), np.concatenate([flat, flat.conj()])
        lost = pole**2 * np.exp((pole - s[i]) * tail_s[i]) / (s[i] - pole)
        out[i] = (flat.T @ lost).reshape(out[i].shape)
    return out


def completed(frf: Frf, simulation: Simulation, q: np.ndarray) -> Frf:
    """An FRF at q (dof,) in rad with the decays that its records cut off, as a simulation has them.

    As it is where it is known not to lack any.
    """
    if not np.isfinite(frf.tail_s):
        return frf
    above = frf.frequency_hz > 0
    s = laplace(frf.frequency_hz[above], frf.exponential_rate_1_s)
    solved = simulation.solved(simulation.elastic.matrices(q[None], layout=frf.layout))
    values = frf.accelerance.copy()
    values[..., above] += cut_off(solved, s, np.array([frf.tail_s]))[0]
    return replace(frf, accelerance=values, tail_s=float("inf"))
