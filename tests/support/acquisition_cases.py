"""Simulated campaigns for studies of acquisitions: true modes (MuJoCo) with noise of EMA's size."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from planner.campaign.build import build, hits_unknown
from planner.campaign.cell import Cell
from planner.campaign.config import CampaignConfig
from planner.campaign.measured_modes import from_mode
from planner.campaign.model import Model
from planner.campaign.proposals import propose
from planner.campaign.state import CampaignState, Measurement
from planner.frf.frf import Frf
from planner.frf.metrics import agreement
from planner.modal.modes import Mode
from planner.proof.arms import IRB6640, KR10, KR210
from planner.proof.deviation import Deviation, soft_floor
from planner.proof.load import load_truth
from planner.proof.model import Truth

ROBOTS = {"KR10": KR10, "IRB 6640": IRB6640, "KR210": KR210}
# Robot and what its simulation lacks: the floor's tilts, or transverse tilts of the joints too.
CELLS = {
    "KR10": ("KR10", "floor"),
    "IRB 6640": ("IRB 6640", "floor"),
    "KR210": ("KR210", "floor"),
    "KR10, 6 springs": ("KR10", "tilts"),
    "KR210, 6 springs": ("KR210", "tilts"),
}
MODES, CANDIDATES, UNUSED, LINES = 4, 200, 60, 160
OF_FRFS = 10  # unused poses at which FRFs are judged
LEAST_SEEN = 0.02  # share of a mode in the hit axes below which EMA does not find it
FREQUENCY_SD, DAMPING_SD, FRF_SD = 1e-3, 0.05, 0.02  # relative, the last one to the FRF's rms


@dataclass(frozen=True, eq=False)
class Case:
    """One true robot, what the planner knows of it, and unused poses with true frequencies."""

    truth: Truth
    cell: Cell
    seed: int
    unused: np.ndarray
    true_hz: np.ndarray
    lines_hz: np.ndarray
    true_frf: np.ndarray  # (OF_FRFS, 3, 3, LINES) at the first unused poses
    frf_sd: float = FRF_SD

    def measure(
        self, q: np.ndarray, number: int, axes: tuple[int, ...] = (0, 1, 2)
    ) -> tuple[Measurement, Frf]:
        """Modes and FRF at q (6,) hit along `axes`, with noise of its own for every pose.

        With fewer axes frequencies are less certain, and modes that hardly show are not found.
        """
        rng = np.random.default_rng([self.seed, number])

        def lost(values: np.ndarray) -> np.ndarray:
            """Columns that were not hit are not known."""
            out = np.array(values)
            out[:, left] = np.nan
            return out

        hertz, zeta, residue = self.truth.modes(q, MODES)
        modes, left = [], [i for i in range(3) if i not in axes]
        for f, z, r in zip(hertz, zeta, residue, strict=True):
            square = np.sum(np.abs(r) ** 2, axis=0)
            seen = square[list(axes)].sum() / square.sum()
            if seen < LEAST_SEEN:
                continue
            relative = FREQUENCY_SD / np.sqrt(seen)
            sd = 0.03 * np.abs(r).max()
            noisy = r + sd * (rng.standard_normal((3, 3)) + 1j * rng.standard_normal((3, 3)))
            shape = np.linalg.svd(noisy[:, list(axes)])[0][:, 0]
            modes.append(
                Mode(
                    f * np.exp(relative * rng.standard_normal()), f * relative,
                    z * np.exp(DAMPING_SD * rng.standard_normal()), z * DAMPING_SD,
                    lost(noisy), lost(np.full((3, 3), sd)), shape, 1.0,
                )
            )  # fmt: skip
        hits = tuple(4 if i in axes else 0 for i in range(3))
        h = self.truth.accelerance(q, self.lines_hz)
        sd = self.frf_sd * np.sqrt(np.mean(np.abs(h) ** 2, axis=(0, 2), keepdims=True))
        noise = rng.standard_normal(h.shape) + 1j * rng.standard_normal(h.shape)
        variance = np.broadcast_to(sd**2, h.shape)
        h = h + sd / np.sqrt(2) * noise
        band = self.cell.config.modes.band_hz
        unknown = np.full(h.shape, np.nan)
        frf = Frf(self.lines_hz, lost(h), lost(variance), unknown, hits, band)
        found = tuple(from_mode(m) for m in modes)
        return Measurement(f"P{number}", tuple(np.rad2deg(q)), (), found), frf


def make(
    robot: str, seed: int, simulation: str, directory: Path, lacking: str = "", axes: str = "all"
) -> Case:
    """`lacking`: what the simulation has not, "floor" (a soft one) or "tilts" (and the floor)."""
    arm = ROBOTS[robot]
    full = arm.write(directory / "full", 2)
    toml = arm.write(directory / "robot", 1) if lacking == "tilts" else full
    soft = 25 * max(arm.torsion)
    off = Deviation(seed, 0.15, 0.15, 0.04, 0.005, extra=soft_floor(soft, soft) if lacking else ())
    truth = load_truth(full, off)
    table = {
        "robot": str(toml),
        "workspace": {"joints_deg": [list(r) for r in arm.joints_deg]},
        "modes": {"count": MODES, "band_hz": [arm.band_hz[0], 0.4 * arm.band_hz[1]]},
        "fidelity": {"simulation": simulation},
        "acquisition": {"candidates": CANDIDATES, "hit_axes": axes},
    }
    cell = Cell.load(toml, msgspec.convert(table, CampaignConfig))
    unused = arm.poses(UNUSED, 10_000 + seed)
    lines_hz = np.linspace(*cell.config.modes.band_hz, LINES)
    true_hz = np.array([truth.modes(q, MODES)[0] for q in unused])
    true_frf = np.array([truth.accelerance(q, lines_hz) for q in unused[:OF_FRFS]])
    return Case(truth, cell, seed, unused, true_hz, lines_hz, true_frf)


@dataclass(frozen=True, eq=False)
class Step:
    """The model after n measurements: errors of ln f at unused poses (u, 4), minutes so far.

    `frac`: Global FRAC of the FRFs predicted at unused poses, the mean over hits and responses.
    """

    n: int
    model: Model
    error: np.ndarray
    minutes: float
    frac: float

    @property
    def rmse_percent(self) -> float:
        return 100 * float(np.sqrt(np.mean(self.error**2)))

    @property
    def worst_percent(self) -> float:
        return 100 * float(np.max(np.abs(self.error)))


def campaign(
    case: Case, initial: list[int], strategy: str | list[int], budget: int
) -> Iterator[Step]:
    """Steps of a campaign: first the candidates `initial`, then what the strategy says.

    A strategy is an acquisition, or the indices of a design made beforehand.
    """
    cost, candidates = case.cell.cost, case.cell.candidates
    measurements: dict[str, Measurement] = {}
    frfs: dict[str, Frf] = {}
    hits_of = hits_unknown(frfs)
    minutes, at, model, planned = 0.0, None, None, list(initial)
    if not isinstance(strategy, str):
        planned += [i for i in strategy if i not in initial]
    for n in range(1, budget + 1):
        axes: tuple[int, ...] = (0, 1, 2)
        if n <= len(planned):
            q = candidates.q[planned[n - 1]]
        else:
            state = CampaignState(measurements=measurements, events=n)
            model = model or build(case.cell, state, hits_of)
            (proposal,) = propose(model, state, 1, str(strategy))
            q = np.deg2rad(np.array(proposal.joints_deg))
            axes = tuple("xyz".index(hit) for hit in proposal.hits)
        minutes += float(cost.minutes(q[None], at, axes)[0])
        at = q
        measurement, frf = case.measure(q, n, axes)
        measurements = {**measurements, measurement.pose: measurement}
        frfs[measurement.pose] = frf
        state = CampaignState(measurements=measurements, events=n)
        model = build(case.cell, state, hits_of)
        found = np.sort(model.predict(case.unused).frequency_hz, axis=1)
        frf, _ = model.frf(case.unused[:OF_FRFS], case.lines_hz)
        frac = float(np.mean(agreement(case.true_frf, frf).global_frac))
        yield Step(n, model, np.log(found / case.true_hz), minutes, frac)
