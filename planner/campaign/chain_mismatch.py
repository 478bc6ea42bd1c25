"""Whether a measuring chain shows what it should, by the simulation, at the first pose.

The imaginary part of an accelerance over frequency, added up over a band, is Σ φ φᵀ of the modes in
it but for a factor: neither damping nor where exactly modes lie matter, so that a simulation tells
it whose springs are known to a factor. It is simulated for many draws of them; what was measured is
held against all of these as it is, and as it would be without a wrong scale, sign or axis.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.campaign.chain_faults import NONE, SCALED, TURNED, ChainFault, log_prior
from planner.campaign.events import Question
from planner.campaign.import_checks import Claim
from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import solve_poles
from planner.frf.frf import Frf
from planner.measurement.nuisances import Tolerances

DRAWS, SEED = 400, 53
SPRINGS, DAMPING = np.log(1.6), np.log(2.0)  # sds of logarithms: of each spring, and of damping
# Another mode, relative to what the simulation says of all: bearings, links and floors give way.
MORE = 0.5
RATE_1_S, LINES = 2.0, 120  # modes are widened by that much, so that few lines tell their sum
# Of what is simulated, relative: what physics that is lacking does to modal shapes. Student's t
# of so many degrees forgives a simulation that is farther off.
DISCREPANCY, DEGREES = 0.12, 4
LOG_ODDS = np.log(1000.0)  # against a wrong chain, before anything is measured


@dataclass(frozen=True, eq=False)
class HitSums:
    """Of one pose: `measured` (3, c) with the sd of its noise, and `drawn` (n, 3, c) of n draws.

    Columns are the c axes that were hit; `variance` (n, 3, c) is of what each draw leaves open.
    """

    measured: np.ndarray
    noise: np.ndarray
    drawn: np.ndarray
    variance: np.ndarray

    def log_density(self, faults: Sequence[ChainFault]) -> np.ndarray:
        """(faults, n): of what was measured, if the chain has that fault, for each draw."""
        inverse = np.array([np.linalg.inv(fault.matrix) for fault in faults])
        noise = inverse**2 @ self.noise**2
        variance = self.variance + noise[:, None]
        off = ((inverse @ self.measured)[:, None] - self.drawn) ** 2 / variance
        rows, columns = self.measured.shape
        count = rows * columns
        volume = columns * np.log(np.abs(np.linalg.det(inverse)))[:, None]
        far = (DEGREES + count) / 2 * np.log1p(off.sum(axis=(2, 3)) / DEGREES)
        return volume - np.log(variance).sum(axis=(2, 3)) / 2 - far


def hit_sums(
    simulation: Simulation, tolerances: Tolerances, q: np.ndarray, frf: Frf
) -> HitSums | None:
    """At a pose q (dof,) in rad; None where no axis was heard by all of the sensor."""
    known = np.flatnonzero(np.isfinite(frf.accelerance).all(axis=(0, 2)))
    if not known.size:
        return None
    drawn = _drawn(simulation, q, frf)[:, :, known]
    width = _width(frf.frequency_hz)
    noise = np.sqrt(np.nan_to_num(frf.variance[:, known]) @ width**2 / 2)
    measured = np.imag(frf.accelerance[:, known]) @ width
    return HitSums(measured, noise, drawn, _left_open(drawn, tolerances))


def _left_open(drawn: np.ndarray, t: Tolerances) -> np.ndarray:
    """(n, 3, c): of hits and chain, and of the simulation."""
    square = drawn**2
    rows, columns = square.sum(axis=2, keepdims=True), square.sum(axis=1, keepdims=True)
    lacking = DISCREPANCY**2 * rows * columns / rows.sum(axis=1, keepdims=True)
    channels = t.gain**2 * square + t.across**2 * (columns - square)
    return lacking + channels + t.angle_rad**2 * (rows - square) + t.force_gain**2 * square


def _drawn(simulation: Simulation, q: np.ndarray, frf: Frf) -> np.ndarray:
    """(n, 3, 3): sums over the band of an FRF with springs that are drawn at random."""
    low, *_, high = frf.frequency_hz.tolist()
    at = np.linspace(low, high, min(LINES, len(frf.frequency_hz)))
    s, (k, c) = 2j * np.pi * at + RATE_1_S, _springs(simulation)
    m = simulation.elastic.matrices(q[None])
    many = [np.repeat(one, DRAWS, axis=0) for one in (m.mass, m.hit, m.sensor)]
    solved = solve_poles(many[0], c, k + m.geometric, many[1], many[2])
    each = (s**2 / (s - solved.poles[..., None])) @ _width(at)
    drawn = np.imag(np.einsum("nmij,nm->nij", solved.residues, each))
    # With a mode more, of which the simulation knows nothing: not even along which axis it moves.
    size = np.sqrt(np.abs(np.diagonal(drawn, axis1=1, axis2=2)).mean(axis=1, keepdims=True))
    more = MORE * np.random.default_rng(SEED + 1).standard_normal((len(drawn), 3)) * size
    return drawn + more[:, :, None] * more[:, None]


def _springs(simulation: Simulation) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness, complex where damping is structural, and damping, (n, e, e) each."""
    own, rng = simulation.elasticity, np.random.default_rng(SEED)
    factor = np.exp(SPRINGS * rng.standard_normal((DRAWS, len(own.stiffness))))
    damped = np.exp(DAMPING * rng.standard_normal((DRAWS, 1)))
    k = own.stiffness * factor
    if own.loss_factor.any():
        k = k * (1 + 1j * own.loss_factor * damped)
    one = np.eye(len(own.stiffness))
    return k[:, :, None] * one, (own.damping * factor * damped)[:, :, None] * one


def _width(frequency_hz: np.ndarray) -> np.ndarray:
    return np.gradient(frequency_hz) / frequency_hz


def most_probable(sums: HitSums) -> tuple[ChainFault, float]:
    """The likeliest fault of a pose's chain, and by how much log likelihood it beats none."""

    def likelihood(faults: Sequence[ChainFault]) -> np.ndarray:
        return np.logaddexp.reduce(sums.log_density(faults), axis=1)

    found = [(float(value), one) for value, one in zip(likelihood(TURNED), TURNED, strict=True)]
    for family in SCALED:
        each = likelihood(family) + log_prior(family)
        found.append((float(np.logaddexp.reduce(each)), family[int(np.argmax(each))]))
    most, fault = max(found, key=lambda one: one[0])
    return fault, most - float(likelihood([NONE])[0])


def chain_mismatch(claim: Claim, frf: Frf | None) -> Question | None:
    """What to ask of the chain behind the first pose's hits, before they are believed.

    `frf` is the tool's by the new hits alone; None: nothing is asked.
    """
    cell = claim.model.cell
    if frf is None or cell.simulation is None:
        return None
    here = hit_sums(cell.simulation, cell.tolerances, claim.q, frf.within(claim.band_hz))
    if here is None:
        return None
    fault, gain = most_probable(here)
    if gain < LOG_ODDS:
        return None
    text = f"At {claim.pose}, by the simulation, {fault.asked} Are these hits right as they are?"
    return Question(text, about="chain")
