"""Campaigns on true robots (MuJoCo) hit as people hit: FRFs predicted at poses never measured."""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np

from planner.campaign.build import build
from planner.campaign.cell import Cell
from planner.campaign.config import CampaignConfig
from planner.campaign.measured_modes import from_modal
from planner.campaign.model import Model
from planner.campaign.state import CampaignState, Measurement
from planner.dataset.hit_columns import PoseHits, no_columns
from planner.errors import RefusedError
from planner.frf import metrics
from planner.frf.frf import Frf
from planner.modal.estimate_modes import estimate_modes
from planner.proof.arms import in_a_cell
from planner.proof.deviation import Deviation
from planner.proof.fault_injection import InjectedFaults
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.proof.measurement_errors import EVERYDAY
from planner.proof.model import Truth
from planner.proof.scene import PULSE_S, Scene
from planner.proof.table import drawn
from tests.support.struck_poses import struck_poses

SCATTER = Deviation(stiffness=0.15, damping=0.15, inertia=0.04, com_m=0.005)  # as stated ones do

# What a simulation lacks: an effect of the truth's library; "" nothing.
LACKING = {
    "nothing": "",
    "soft base": "base_compliance",
    "bending link": "link_flexibility",
    "hose": "local_resonator",
}
MODES, LINES = 4, 300


@dataclass(frozen=True, eq=False)
class FrfCase:
    """Measured poses of a true robot in order, and FRFs (u, 3, 3, LINES) at q (u, 6) unseen."""

    cell: Cell
    measurements: tuple[Measurement, ...]
    frfs: dict[str, Frf]
    one_hit: dict[str, Frf]
    unseen: np.ndarray
    lines_hz: np.ndarray
    true_frf: np.ndarray

    def model(self, n: int, hits: bool = True) -> Model:
        """After the first n poses; without `hits` as of exported FRFs, whose hits nobody knows."""
        one_hit = self.one_hit if hits else self.frfs

        def hits_of(measurement: Measurement, _: object = None) -> PoseHits:
            """As a campaign asks for it; nothing of single hits."""
            pose = measurement.pose
            return PoseHits(no_columns(), one_hit[pose], self.frfs[pose])

        used = {m.pose: m for m in self.measurements[:n]}
        state = CampaignState(measurements=used, events=n)
        return build(self.cell, state, hits_of)

    def models(self) -> Iterator[Model]:
        """After each pose."""
        return (self.model(n) for n in range(1, len(self.measurements) + 1))


def make(
    robot: str, lacking: str, seed: int, folder: Path, poses: int = 6, unseen: int = 8,
    simulation: str = "updated",
) -> FrfCase:  # fmt: skip
    """A robot of ARMS whose simulation lacks one of LACKING, hit at `poses` random poses."""
    rng = np.random.default_rng([seed, zlib.crc32(f"{robot} {lacking}".encode())])
    arm = in_a_cell(robot)
    per_joint = int(rng.choice([1, 3]))
    toml = arm.write(folder / "robot", per_joint)
    q, other = arm.drawn(poses, rng), arm.drawn(unseen, rng)
    injected = InjectedFaults(replace(SCATTER, seed=int(rng.integers(2**31))))
    if LACKING[lacking]:
        plain = load_truth(toml, injected.deviation)
        scene = Scene(arm, plain, per_joint, q, arm.peak_n, injected, rng)
        injected = drawn(LACKING[lacking], scene).injected
    truth = load_truth(toml, injected.deviation)
    hammer = Hammer(arm.peak_n, PULSE_S, noise=float(rng.uniform(0.005, 0.03)))
    measurements, frfs, one_hit = _measured(truth, injected, q, hammer, arm.band_hz, rng)
    table = {
        "robot": str(toml),
        "workspace": {"joints_deg": [list(r) for r in arm.joints_deg]},
        "modes": {"count": MODES, "band_hz": list(arm.band_hz)},
        "fidelity": {"simulation": simulation},
        "acquisition": {"candidates": 50},
    }
    cell = Cell.load(toml, msgspec.convert(table, CampaignConfig))
    lines = np.linspace(*arm.band_hz, LINES)
    true = np.array([truth.accelerance(one, lines) for one in other])
    return FrfCase(cell, measurements, frfs, one_hit, other, lines, true)


def _measured(
    truth: Truth,
    injected: InjectedFaults,
    q: np.ndarray,
    hammer: Hammer,
    band_hz: tuple[float, float],
    rng: np.random.Generator,
) -> tuple[tuple[Measurement, ...], dict[str, Frf], dict[str, Frf]]:
    """Modes and FRFs of all poses (n, 6), those of every hit and of one hit."""
    measurements, frfs, one_hit = [], {}, {}
    poses = struck_poses(truth, injected, q, hammer, band_hz, EVERYDAY, rng)
    for number, pose in enumerate(poses):
        name, frf = f"P{number + 1}", pose.frf
        try:
            modes = from_modal(estimate_modes(frf, band_hz))
        except RefusedError:
            modes = ()
        measurements.append(Measurement(name, tuple(np.rad2deg(q[number])), (), modes))
        frfs[name], one_hit[name] = frf, pose.one_hit_frf
    return tuple(measurements), frfs, one_hit


@dataclass(frozen=True)
class FrfScore:
    """How predicted FRFs compare with true ones: means over unseen poses.

    `frac`: Global FRAC of the direct FRFs; `frobenius`; `covered`: share of lines of all nine FRFs
    within 2 sd; `covered_low`, `covered_high`: of the lower and the upper half of the band;
    `alone`: Global FRAC of the identified simulation by itself.
    """

    frac: float
    frobenius: float
    covered: float
    covered_low: float
    covered_high: float
    alone: float

    @classmethod
    def of(cls, case: FrfCase, model: Model) -> "FrfScore":
        """Of a model at the unseen poses."""
        mean, sd = model.frf(case.unseen, case.lines_hz)
        inside = np.abs(mean - case.true_frf) <= 2 * sd
        half = LINES // 2
        learned, alone = model.low.identified_robot or model.low.rejected, np.nan
        if learned is not None:
            simulation = learned.identified.simulation
            alone = frac_of(case.true_frf, simulation.accelerance(case.unseen, case.lines_hz))
        found = metrics.agreement(case.true_frf, mean)
        return cls(
            metrics.direct_mean(found.global_frac), metrics.direct_mean(found.frobenius),
            float(inside.mean()), float(inside[..., :half].mean()),
            float(inside[..., half:].mean()), alone,
        )  # fmt: skip


def frac_of(true: np.ndarray, predicted: np.ndarray) -> float:
    """Global FRAC of the direct FRFs."""
    return metrics.direct_mean(metrics.agreement(true, predicted).global_frac)
