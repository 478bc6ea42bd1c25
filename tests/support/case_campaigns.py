"""Campaigns of the robots of `fitted_cases`: models after some poses, and how FRFs compare."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import numpy as np

from planner.campaign.build import build
from planner.campaign.cell import Cell
from planner.campaign.config import CampaignConfig
from planner.campaign.events import Proposal
from planner.campaign.labels import from_modal
from planner.campaign.low_fidelity import Recall, in_memory
from planner.campaign.model import Model
from planner.campaign.state import CampaignState, Measurement
from planner.dataset.hit_columns import PoseHits, no_columns
from planner.robot.robot import Robot
from tests.support.fitted_cases import COUNTED, LINES, Case, frac_of, one_thing
from tests.support.true_modes import NOT_COUNTED, counted, true_modes


@dataclass(frozen=True, eq=False)
class CaseCampaign:
    """A case's poses P0, P1, ... measured in order; of single hits nothing is known."""

    case: Case
    cell: Cell
    recall: Recall = field(default_factory=in_memory)

    @classmethod
    def of(cls, case: Case, simulation: str = "updated") -> "CaseCampaign":
        robot = Robot.load(case.toml)
        box = np.clip(case.box_rad, robot.lower_rad, robot.upper_rad)
        table = {
            "robot": str(case.toml),
            "workspace": {"joints_deg": np.rad2deg(box).T.tolist()},
            "modes": {"count": COUNTED, "band_hz": list(case.band_hz)},
            "fidelity": {"simulation": simulation},
            "acquisition": {"candidates": 50},
        }
        return cls(case, Cell.load(case.toml, msgspec.convert(table, CampaignConfig)))

    def angles(self, q: np.ndarray) -> tuple[float, ...]:
        return tuple(self.cell.robot.joints.shown(q))

    def state(
        self, n: int, q: np.ndarray | None = None, unlisted: Sequence[int] = ()
    ) -> CampaignState:
        """After n poses, said to be at q (n, dof); all others but `unlisted` ones are proposed."""
        q = self.case.q if q is None else q
        used = [
            Measurement(f"P{k}", self.angles(q[k]), (), from_modal(self.case.measured[k].modal))
            for k in range(n)
        ]
        after = {
            f"P{k}": Proposal(f"P{k}", self.angles(q[k]), (0.0, 0.0, 0.0), None, "")
            for k in range(n, len(q)) if k not in unlisted
        }  # fmt: skip
        measurements = {m.pose: m for m in used}
        return CampaignState(
            proposals=after, open=tuple(after), measurements=measurements, events=n
        )

    def model(self, state: CampaignState) -> Model:
        def hits_of(measurement: Measurement, _: object = None) -> PoseHits:
            pose = self.case.measured[int(measurement.pose[1:])]
            return PoseHits(no_columns(), pose.one_hit_frf, pose.frf)

        return build(self.cell, state, hits_of, self.recall)

    def after(self, n: int) -> Model:
        """Of n poses."""
        return self.model(self.state(n))


def lacking(
    robot: str, kind: str, seed: int, folder: Path, simulation: str = "updated"
) -> CaseCampaign:
    """Of a robot whose simulation lacks one of KINDS."""
    return CaseCampaign.of(one_thing(robot, kind, seed, folder), simulation)


@dataclass(frozen=True)
class Score:
    """How predicted FRFs and frequencies compare with true ones: means over unseen poses.

    `frac`: Global FRAC of the direct FRFs; `covered`: share of lines of all nine FRFs within 2 sd;
    `covered_low`, `covered_high`: of the lower and the upper half of the band; `alone`: Global FRAC
    of the identified simulation by itself; `rmse`: of frequencies, in %; `inside`: share of them in
    the 95 % intervals of a pose's mean over visits; `done`: whether the campaign would stop.
    """

    frac: float
    covered: float
    covered_low: float
    covered_high: float
    alone: float
    rmse: float
    inside: float
    done: bool

    @classmethod
    def of(cls, case: Case, model: Model) -> "Score":
        """Of a model at the unseen poses."""
        mean, sd = model.frf(case.unseen, case.lines_hz)
        inside = np.abs(mean - case.true_frf) <= 2 * sd
        low, high = float(inside[..., : LINES // 2].mean()), float(inside[..., LINES // 2 :].mean())
        learned, alone = model.low.identified_robot or model.low.rejected, np.nan
        if learned is not None:
            simulation = learned.identified.simulation
            alone = frac_of(case.true_frf, simulation.accelerance(case.unseen, case.lines_hz))
        q = case.unseen
        modes = model._predict(q, model.cell.features(q), model.low.frequencies(q), visit=False)
        hz, most = modes.frequency_hz, modes.frequency_hz.shape[1] + NOT_COUNTED
        seen = [true_modes(case.truth, one, most) for one in q]
        true = np.array([counted(*one, f) for one, f in zip(seen, hz, strict=True)])
        return cls(
            frac_of(case.true_frf, mean), float(inside.mean()), low, high, alone,
            100 * float(np.sqrt(np.mean((hz / true - 1) ** 2))),
            float(np.mean(np.abs(hz - true) <= 1.96 * modes.frequency_sd_hz)), model.done,
        )  # fmt: skip
