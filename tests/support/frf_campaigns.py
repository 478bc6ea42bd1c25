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
from planner.dataset.measure import MeasuredPose
from planner.errors import RefusedError
from planner.frf import metrics
from planner.frf.frf import Frf
from planner.modal.estimate_modes import estimate_modes
from planner.proof.arms import ARMS
from planner.proof.cases import DAMPING_S, PEAK_N
from planner.proof.deviation import Deviation
from planner.proof.effects import EFFECTS
from planner.proof.fault_injection import HitVisit, InjectedFaults, hit_poses
from planner.proof.hits import AXES, Hammer
from planner.proof.load import load_truth
from planner.proof.measurement_errors import EVERYDAY
from planner.proof.model import Truth
from planner.proof.scene import PULSE_S, Scene
from planner.recording.records import Hit

SCATTER = Deviation(stiffness=0.15, damping=0.15, inertia=0.04, com_m=0.005)  # as stated ones do

# What a simulation lacks: an effect of the truth's library; "" nothing.
LACKING = {
    "nothing": "",
    "soft base": "base_compliance",
    "bending link": "link_flexibility",
    "hose": "local_resonator",
}
MODES, LINES, REPEATS = 4, 300, 3


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
    arm = replace(ARMS[robot], damping_s=DAMPING_S)
    per_joint = int(rng.choice([1, 3]))
    toml = arm.write(folder / "robot", per_joint)
    low, high = np.deg2rad(np.array(arm.joints_deg)).T
    q = rng.uniform(low, high, (poses, 6))
    other = rng.uniform(low, high, (unseen, 6))
    injected = InjectedFaults(replace(SCATTER, seed=int(rng.integers(2**31))))
    if LACKING[lacking]:
        scene = Scene(arm, load_truth(toml, injected.deviation), per_joint, q, PEAK_N[robot])
        injected = EFFECTS[LACKING[lacking]](scene, injected, rng).injected
    truth = load_truth(toml, injected.deviation)
    hammer = Hammer(PEAK_N[robot], PULSE_S, noise=float(rng.uniform(0.005, 0.03)))
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
    """REPEATS hits an axis at each pose (n, 6), with errors of hand and chain."""
    injected, common = replace(injected, chain=EVERYDAY.chain(rng)), EVERYDAY.common(rng)
    axes = [axis for axis in range(3) for _ in range(REPEATS)]
    shots = [(f"+{AXES[axis]}", hammer.peak_n) for axis in axes]
    visits = []
    for one in q:
        there = one + np.deg2rad(EVERYDAY.readback_deg) * rng.standard_normal(6)
        visits.append(HitVisit(there, shots, aims=EVERYDAY.aims(axes, rng, common)))
    measurements, frfs, one_hit = [], {}, {}
    for number, recorded in enumerate(hit_poses(truth, injected, visits, hammer, rng)):
        rate = hammer.sampling_rate_hz
        hits = tuple(
            Hit(Path("hit"), h.axis, rate, h.force_n, h.acceleration_m_s2, simulated=True)
            for h in recorded
        )
        pose = MeasuredPose((), band_hz, given=hits)
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
