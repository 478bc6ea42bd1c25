"""Hits of a campaign whose robot.toml states laws of joints, as springs alone would answer them."""

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from planner.campaign.config import ModesTable
from planner.campaign.state import Measurement
from planner.dataset.hit_columns import Correction, PoseHits, no_columns
from planner.dynamics.at_force import with_average, with_possible_laws
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.measurement.straightened_hits import straightened_hits, struck_n
from planner.recording.points import TCP
from planner.recording.records import Hit


class HitsOf(Protocol):
    """What the hits of a measurement say, if need be once they are corrected."""

    def __call__(
        self, measurement: Measurement, corrected: Correction | None = None, /
    ) -> PoseHits: ...


def hits_unknown(frfs: Mapping[str, Frf]) -> HitsOf:
    """Of poses by name of which nothing is known but the tool's FRF."""

    def hits_of(measurement: Measurement, _: Correction | None = None, /) -> PoseHits:
        frf = frfs[measurement.pose]
        return PoseHits(no_columns(), frf, frf)

    return hits_of


class StraightenedHits:
    """Those of measurements in use at q (n, dof) in rad; `latest` is what was asked for last."""

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
