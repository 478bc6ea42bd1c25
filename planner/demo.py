"""The main job, start to end, on the shipped campaign: propose, import, refit, propose again."""

import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.campaign.campaign import Campaign
from planner.campaign.cell import Cell
from planner.campaign.events import Proposal
from planner.campaign.importing import ImportReport
from planner.campaign.labels import frequencies, label
from planner.campaign.measured_modes import from_modal
from planner.campaign.state import Measurement
from planner.dataset.measure import measure
from planner.dataset.screened_files import Source
from planner.errors import InputError, NoPoseLeftError
from planner.progress import ProgressCallback
from planner.recording.folder import read_recordings
from planner.recording.joints import JointUnits
from planner.recording.records import PoseRow
from planner.report.demonstration import DemonstrationReport, DemonstrationStep
from planner.report.rerun.event_logger import EventLogger

NAME = "kr240_plane"
Z_95 = 1.959964  # two-sided 95 % of a normal distribution


def shipped(name: str) -> Path:
    """Folder of a campaign shipped with the project (installed, or in a checkout)."""
    package = Path(__file__).parent
    for root in (package / "campaigns", package.parent / "campaigns"):
        if (root / name / "campaign.toml").is_file():
            return root / name
    raise InputError(f"The shipped campaign {name} is missing; install the package again.")


@dataclass(frozen=True, eq=False)
class Pool:
    """Recorded poses that the demonstration may draw on."""

    folder: Path
    joints: JointUnits
    rows: dict[str, tuple[PoseRow, ...]]

    @classmethod
    def load(cls, folder: Path, joints: JointUnits | Sequence[str]) -> "Pool":
        """Read a recordings folder."""
        rows: dict[str, list[PoseRow]] = {}
        for row in read_recordings(folder, joints):
            rows.setdefault(row.pose, []).append(row)
        return cls(
            folder, JointUnits.of(joints), {pose: tuple(group) for pose, group in rows.items()}
        )

    def q(self, poses: list[str]) -> np.ndarray:
        """Readback angles (n, dof) in rad."""
        return self.joints.internal([self.rows[pose][0].joints_deg for pose in poses])

    def nearest(self, cell: Cell, proposal: Proposal, used: list[str]) -> str:
        """The unused recorded pose that is nearest to a proposal, in model coordinates."""
        left = [pose for pose in self.rows if pose not in used]
        target = cell.features(self.joints.internal([proposal.joints_deg]))
        distance = np.linalg.norm(cell.features(self.q(left)) - target, axis=1)
        return left[int(np.argmin(distance))]


def play(
    directory: Path | None, measurements: int, viewer: bool, progress: ProgressCallback
) -> DemonstrationReport:
    """Play a campaign until its target, `measurements`, or the pool's end; returns the summary."""
    source = shipped(NAME)
    directory = directory or Path(tempfile.mkdtemp(prefix="planner-demo-")) / NAME
    campaign = Campaign.new(directory, source / "robot" / "robot.toml", source / "campaign.toml")
    pool = Pool.load(source / "recordings", campaign.cell.robot.joints)
    rrd = campaign.directory / "demo.rrd"
    used: list[str] = []
    steps: list[DemonstrationStep] = []
    started = time.perf_counter()
    with EventLogger(campaign.cell, rrd, viewer, simulated=True) as story:
        story.log(campaign.entries[0], campaign.model)
        proposal = campaign.next()[0]
        story.log(campaign.entries[-1], campaign.model)
        while len(used) < min(measurements, len(pool.rows)) and not campaign.model.done:
            pose = pool.nearest(campaign.cell, proposal, used)
            progress(f"measurement {len(used) + 1}: pose {pose}", len(used) / measurements)
            if used:
                started = time.perf_counter()
            report = campaign.import_paths((pool.folder,), pose)[0]
            imported = campaign.entries[-1], campaign.model
            used.append(pose)
            try:
                proposal = campaign.next()[0]
            except NoPoseLeftError:
                break
            finally:
                steps.append(_step(report, proposal, time.perf_counter() - started))
                story.log(*imported, report.measured)
            story.log(campaign.entries[-1], campaign.model)
    return _summary(campaign, pool, used, steps, rrd, progress)


def _step(report: ImportReport, proposal: Proposal, seconds: float) -> DemonstrationStep:
    modes = report.measurement.modes if report.measurement else ()
    return DemonstrationStep(
        report.pose, proposal.pose, tuple(m.frequency_hz for m in modes if m.likely),
        len(report.refused), report.model.frequency_sd_percent, report.refit_seconds, seconds,
    )  # fmt: skip


def _summary(
    campaign: Campaign,
    pool: Pool,
    used: list[str],
    steps: list[DemonstrationStep],
    rrd: Path,
    progress: ProgressCallback,
) -> DemonstrationReport:
    cell = campaign.cell
    unused = [pose for pose in pool.rows if pose not in used]
    truth = _measured_hz(cell, pool, unused, progress)
    prediction = campaign.model.predict(pool.q(unused))
    simulated = cell.frozen.simulate(pool.q(unused)).frequency_hz
    inside = np.abs(truth - prediction.frequency_hz) <= Z_95 * prediction.frequency_sd_hz
    known = np.isfinite(truth)
    return DemonstrationReport(
        campaign=str(campaign.directory),
        robot=cell.robot.name,
        simulated=True,
        pool=len(pool.rows),
        measurements=len(used),
        used=tuple(used),
        unused=len(unused),
        modes_compared=int(known.sum()),
        frequency_rmse_percent=rmse_percent(prediction.frequency_hz, truth),
        simulation_rmse_percent=rmse_percent(simulated, truth),
        frequency_rmse_percent_per_mode=_per_mode(prediction.frequency_hz, truth),
        simulation_rmse_percent_per_mode=_per_mode(simulated, truth),
        coverage95=float(np.mean(inside[known])) if known.any() else float("nan"),
        coverage95_per_mode=tuple(
            float(np.mean(inside[known[:, k], k])) if known[:, k].any() else float("nan")
            for k in range(truth.shape[1])
        ),
        remarks=campaign.model.remarks,
        step_seconds=tuple(step.seconds for step in steps),
        steps=tuple(steps),
        rrd=str(rrd),
    )


def _measured_hz(
    cell: Cell, pool: Pool, poses: list[str], progress: ProgressCallback
) -> np.ndarray:
    """Frequencies (n, count) in Hz that the recordings of poses give; NaN where none was found."""
    found = []
    for i, pose in enumerate(poses):
        progress(f"checking on unused pose {i + 1}", i / len(poses))
        rows = pool.rows[pose]
        sources = tuple(Source.of(r) for r in rows if r.file)
        table = cell.config.modes
        measured = measure(sources, table.band_hz, window_rate_1_s=table.window_rate_1_s)
        modes = from_modal(measured.modal)
        found.append(Measurement(pose, pool.rows[pose][0].joints_deg, (), modes))
    labelled = label(cell, tuple(found))
    return frequencies(labelled)


def rmse_percent(predicted: np.ndarray, truth: np.ndarray) -> float:
    """Root mean square relative error in %, over entries (any shape) known in `truth`."""
    return float(100 * np.sqrt(np.nanmean((predicted / truth - 1) ** 2)))


def _per_mode(predicted: np.ndarray, truth: np.ndarray) -> tuple[float, ...]:
    return tuple(rmse_percent(predicted[:, k], truth[:, k]) for k in range(truth.shape[1]))
