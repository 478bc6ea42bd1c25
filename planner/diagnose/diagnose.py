"""Where simulation and recordings differ, and which effect explains it."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from planner.diagnose.effect import Effect
from planner.diagnose.effects import library
from planner.diagnose.fit import Fit, Problem, fit, settle
from planner.diagnose.weigh import Weights, weigh
from planner.frf.types import Frf
from planner.identify.data import common_band
from planner.physics.simulation import Simulation

IN_QUESTION = 10.0  # times the least misfit: candidates that are followed to the end
TIED = 0.05  # probability that keeps a candidate in the set the data cannot tell apart


@dataclass(frozen=True)
class Candidate:
    """An effect at a place ("none" and "unknown" at None) and its probability."""

    effect: str
    at: str | None
    probability: float
    misfit: float  # χ² per value, NaN for "unknown"
    log_evidence: float  # tempered, NaN for "unknown"
    parameters: dict[str, tuple[float, float, str]]
    text: str


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The verdict, and all candidates, most probable first."""

    verdict: str
    candidates: tuple[Candidate, ...]
    refitted: Fit
    best: Fit
    temper: float
    seconds: float

    @property
    def undecided(self) -> tuple[Candidate, ...]:
        """Candidates that the data cannot tell apart."""
        return tuple(c for c in self.candidates if c.probability > TIED)


def diagnose(
    frfs: Sequence[Frf],
    q: np.ndarray,
    simulation: Simulation,
    *,
    effects: Sequence[Effect] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Which effect explains FRFs at q (n, dof) in rad that the simulation does not.

    `effects` are looked at instead of the whole library. Raises InputError where nothing of the
    FRFs lies in robot.toml's band.
    """
    started = time.perf_counter()
    band = common_band(frfs, simulation.robot.config.band_hz)
    problem = Problem(tuple(frfs), np.atleast_2d(q), simulation, band)
    refitted = settle(fit(problem, Effect("")))
    fits = [refitted]
    for effect in library(simulation) if effects is None else effects:
        if progress:
            progress(f"{effect.name} at {effect.at}")
        fits.append(fit(problem, effect, [refitted]))
    best = min(f.per_value for f in fits)
    fits = [settle(f) if f.per_value < IN_QUESTION * best else f for f in fits]
    weights = weigh(fits)
    candidates = _candidates(fits, weights)
    verdict = {"none": "consistent", "unknown": "unexplained"}.get(
        candidates[0].effect, "explained"
    )
    best = fits[int(np.argmax(weights.probabilities[:-1]))]
    seconds = time.perf_counter() - started
    return Diagnosis(verdict, candidates, refitted, best, weights.temper, seconds)


def _candidates(fits: Sequence[Fit], weights: Weights) -> tuple[Candidate, ...]:
    out = []
    for f, p, z in zip(fits, weights.probabilities, weights.log_evidence, strict=False):
        values = f.parameters(weights.temper)
        text = f.effect.text(values) if f.effect.at else "The refitted simulation is enough."
        at = f.effect.at or None
        out.append(Candidate(f.effect.name, at, float(p), f.per_value, float(z), values, text))
    unknown = float(weights.probabilities[-1])
    out.append(Candidate("unknown", None, unknown, np.nan, np.nan, {}, "No candidate explains it."))
    return tuple(sorted(out, key=lambda c: -c.probability))
