"""A campaign's model from its cell and its state: labels, simulation, surrogate."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from planner.campaign.cell import Cell
from planner.campaign.config import ModesTable
from planner.campaign.frequencies_by_simulation import tuned_frequencies
from planner.campaign.hit_errors import CampaignHitErrors, Visited, estimate
from planner.campaign.labels import LabelledPose, label, observations
from planner.campaign.low_fidelity import LowFidelity, Recall, identify_low_fidelity, in_memory
from planner.campaign.model import Model
from planner.campaign.state import CampaignState, Measurement
from planner.dataset.hit_columns import Correction, PoseHits, no_columns
from planner.design.parameter_sensitivity import FrfNoise
from planner.dynamics.at_force import with_average, with_possible_laws
from planner.dynamics.simulation import Simulation
from planner.fit.identified_robot import IdentifiedRobot
from planner.frf.frf import Frf
from planner.measurement.straightened_hits import straightened_hits, struck_n
from planner.recording.points import TCP
from planner.recording.records import Hit
from planner.surrogate.average import Average
from planner.surrogate.frequency_models import MODELS
from planner.surrogate.gp import STAGES
from planner.surrogate.modal_surrogate import ModalObservations, fit_primary, fit_surrogate

SIMULATED_AT = 200  # candidates, where a model learns the simulation
# Logarithms: of the chance that a mode is not found, and of the density in ln f of those found
# that are none.
MISSING_MODE, UNLABELLED_MODE = float(np.log(0.1)), float(np.log(0.01))

Tuned = tuple[np.ndarray, np.ndarray]  # frequencies (n, count) in Hz and their sds
Guided = tuple[tuple[LabelledPose, ...], ModalObservations, Average]  # with ln f's own fit


# What the hits of a measurement say, if need be once they are corrected.
HitsOf = Callable[[Measurement, Correction | None], PoseHits]


def hits_unknown(frfs: Mapping[str, Frf]) -> HitsOf:
    """Of poses by name of which nothing is known but the tool's FRF."""
    return lambda m, _: PoseHits(no_columns(), frfs[m.pose], frfs[m.pose])


def build(cell: Cell, state: CampaignState, hits_of: HitsOf, recall: Recall | None = None) -> Model:
    """Label and fit everything that the state's measurements hold.

    `hits_of` gives what a measurement's hits say at all points. `recall` says what was found of the
    first measurements, so that nothing is found twice. Where robot.toml states laws of joints, hits
    are taken as they would be without these.
    """
    low, used, table = cell.frozen, state.used, cell.config.modes
    hits = tuple(hits_of(m, None) for m in used)
    noise, errors, tuned = None, None, None
    if cell.config.fidelity.simulation == "updated" and used:
        q = cell.robot.joints.internal([m.joints_deg for m in used])
        straight = straighten = None
        if low.nominal and cell.robot.config.law and any(len(h.columns.axis) for h in hits):
            straight = StraightenedHits(hits_of, used, q, table)
            straighten = straight.frfs
            low = replace(low, nominal=straight.referred(low.nominal))
        known, whole = recall or in_memory(), tuple(h.whole for h in hits)
        low = identify_low_fidelity(low, whole, q, table.band_hz, used, known, straighten)
        q = low.stood(q)
        if straight is not None and straight.latest:
            hits = straight.latest
        fit = low.identified_robot
        assert fit is not None
        noise = FrfNoise.of(tuple(h.whole for h in hits), table.band_hz, fit.identified.misfit)
        tuned, errors = _told_by(fit, cell, used, hits, q)
    low, (labelled, seen, primary) = _best_guided(cell, used, low, tuned)
    kernel = cell.config.surrogate.kernel
    surrogate = fit_surrogate(seen, primary, False, low.is_identified, kernel)
    frfs = tuple(h.of_tool.within(table.band_hz) for h in hits)
    return Model(cell, labelled, low, seen, surrogate, noise, errors, used, frfs)


def _told_by(
    fit: IdentifiedRobot,
    cell: Cell,
    used: tuple[Measurement, ...],
    hits: tuple[PoseHits, ...],
    q: np.ndarray,
) -> tuple[Tuned, CampaignHitErrors]:
    """Frequencies with their sds, and errors of hits, by a robot that was identified from them."""
    band, count = cell.config.modes.band_hz, cell.config.modes.count
    seen = tuple(h.averaged.within(band) for h in hits)
    simulation = fit.identified.simulation
    tuned = tuned_frequencies(simulation, seen, q, band, cell.tolerances, count)
    visits = [
        Visited(one, h.columns, m.pose, tuple(hit.file for hit in m.accepted), h.averaged)
        for one, m, h in zip(q, used, hits, strict=True)
    ]
    return tuned, estimate(visits, fit, cell.tolerances, band)


def _best_guided(
    cell: Cell, used: tuple[Measurement, ...], low: LowFidelity, tuned: Tuned | None
) -> tuple[LowFidelity, Guided]:
    """By the simulation as identified or, where that does not fit, as stated or by none."""
    if low.identified_robot is None or low.identified_robot.fits:
        return low, _guided(cell, used, low, tuned)
    # What lacks physics is bent by fitting it: as it stands it may be a better guide, or none.
    stated = replace(cell.frozen, rejected=low.identified_robot)
    tried = [
        (one, _guided(cell, used, one)) for one in (low, stated, replace(stated, nominal=None))
    ]
    best = max(tried, key=lambda one: _log_evidence(used, one[1]))
    return best if best[0] is not low else (low, _guided(cell, used, low, tuned))


def simulated_elsewhere(
    cell: Cell, low: LowFidelity, model: str = ""
) -> tuple[np.ndarray, np.ndarray] | None:
    """Where a model of frequencies learns the simulation: features, frequencies in Hz."""
    if not MODELS[model or cell.config.surrogate.model].elsewhere:
        return None
    candidates = cell.candidates
    q, x = candidates.q[:SIMULATED_AT], candidates.features[:SIMULATED_AT]
    return x, low.frequencies(q).frequency_hz


def _guided(
    cell: Cell, used: tuple[Measurement, ...], low: LowFidelity, tuned: Tuned | None = None
) -> Guided:
    """Labels, and frequencies, as one low fidelity makes them.

    `tuned` ones, where their sds are known, take the place of those of modal analyses.
    """
    labelled, table = label(cell, used, low), cell.config.surrogate
    seen = observations(cell, labelled)
    if tuned is not None:
        known = np.isfinite(tuned[1]) & np.array([[pose.own] for pose in labelled])
        hz, sd = (
            np.where(known, own, found)
            for own, found in zip(tuned, (seen.frequency_hz, seen.frequency_sd_hz), strict=True)
        )
        seen = replace(seen, frequency_hz=hz, frequency_sd_hz=sd)
    elsewhere = simulated_elsewhere(cell, low)
    primary = fit_primary(seen, low.discrepancy, low.belief, table.model, table.kernel, elsewhere)
    return labelled, seen, primary


def _log_evidence(used: tuple[Measurement, ...], guided: Guided) -> float:
    """How probable the measured modes were, all labels together.

    A label without a mode, and a mode below the last label that got none, are rare too.
    """
    labelled, _, primary = guided
    missed = stray = 0
    for pose, measurement in zip(labelled, used, strict=True):
        given = {mode.frequency_hz for mode in pose.modes if mode is not None}
        free = [m.frequency_hz for m in measurement.modes if m.likely]
        missed += sum(mode is None for mode in pose.modes)
        stray += sum(f not in given and f < max(given, default=0.0) for f in free)
    share = min(1.0, STAGES[-1] / max(len(labelled), 1))  # of the poses it is about
    rare = missed * MISSING_MODE + stray * UNLABELLED_MODE
    return float(np.sum(primary.log_evidence)) + share * rare


class StraightenedHits:
    """Hits as springs alone would answer them, where robot.toml states laws of joints.

    Those of measurements in use at q (n, dof) in rad; `latest` is what was asked for last.
    """

    def __init__(
        self, hits_of: HitsOf, used: tuple[Measurement, ...], q: np.ndarray, table: ModesTable
    ):
        self.latest: tuple[PoseHits, ...] = ()
        self._hits_of, self._how = hits_of, (table.band_hz[1], table.window_rate_1_s)
        self._used = tuple(zip(used, q, strict=True))

    def frfs(self, simulation: Simulation, count: int) -> tuple[Frf, ...]:
        """At all points, of the first so many, without what the laws of a simulation do."""
        simulation = with_possible_laws(simulation)

        def corrected(q: np.ndarray) -> Correction:
            return lambda hits: straightened_hits(
                hits, np.tile(q, (len(hits), 1)), simulation, *self._how
            )

        self.latest = tuple(self._hits_of(m, corrected(q)) for m, q in self._used[:count])
        return tuple(hits.whole for hits in self.latest)

    def referred(self, simulation: Simulation) -> Simulation:
        """The same robot, its springs with what the hits of the first pose have of its laws."""
        struck: list[Hit] = []

        def seen(hits: tuple[Hit, ...]) -> tuple[Hit, ...]:
            struck.extend(hit for hit in hits if hit.hit_point == TCP)
            return hits

        (measurement, q), *_ = self._used
        self._hits_of(measurement, seen)
        if not struck:
            return simulation
        axes = np.array([hit.axis_index for hit in struck])
        return with_average(simulation, q, axes, struck_n(simulation, struck))
