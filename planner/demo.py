"""The main job, start to end, on the shipped campaign: propose, import, refit, propose again."""

import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Group
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.campaign.cell import Cell
from planner.campaign.events import Proposal
from planner.campaign.importing import ImportReport
from planner.campaign.labels import label, observations
from planner.compare.curves import score
from planner.compare.pool import PoseFiles, make, poses_of
from planner.dataset.visits import recordings_in
from planner.errors import InputError, NoPoseLeftError
from planner.progress import ProgressCallback
from planner.report.answer import Done
from planner.report.text import SIMULATED, number, table

NAME = "kr240_plane"


def shipped(name: str) -> Path:
    """Folder of a campaign shipped with the project (installed, or in a checkout)."""
    package = Path(__file__).parent
    for root in (package / "campaigns", package.parent / "campaigns"):
        if (root / name / "campaign.toml").is_file():
            return root / name
    raise InputError(f"The shipped campaign {name} is missing; install the package again.")


def play(
    directory: Path | None, measurements: int, viewer: bool, progress: ProgressCallback
) -> Done:
    """Answer of `demo`: a campaign, played until its target, `measurements`, or the pool's end."""
    from planner.report.rerun.campaign import RerunView

    source = shipped(NAME)
    directory = directory or Path(tempfile.mkdtemp(prefix="planner-demo-")) / NAME
    campaign = Campaign.new(directory, source / "robot" / "robot.toml", source / "campaign.toml")
    joints, recordings = campaign.cell.robot.joints, source / "recordings"
    listed = recordings_in(recordings, joints)
    pool = unused = poses_of(listed, joints, campaign.cell.config.modes)
    rrd = campaign.directory / "demo.rrd"
    steps: list[dict[str, Any]] = []
    started = time.perf_counter()
    with closing(RerunView(campaign.cell, rrd, viewer, simulated=True)) as story:
        story.log(campaign.entries[0], campaign.model)
        proposal = campaign.next()[0]
        story.log(campaign.entries[-1], campaign.model)
        while len(steps) < min(measurements, len(pool)) and not campaign.model.done:
            here = _nearest(campaign.cell, unused, proposal)
            progress(f"measurement {len(steps) + 1}: pose {here.pose}", len(steps) / measurements)
            if steps:
                started = time.perf_counter()
            report = campaign.import_paths((recordings,), here.pose)[0]
            imported = campaign.entries[-1], campaign.model
            unused = tuple(one for one in unused if one is not here)
            try:
                proposal = campaign.next()[0]
            except NoPoseLeftError:
                break
            finally:
                steps.append(_step(report, proposal, time.perf_counter() - started))
                story.log(*imported, report.measured)
            story.log(campaign.entries[-1], campaign.model)
    return _answer(campaign, steps, pool, unused, rrd, progress)


def _answer(
    campaign: Campaign, steps: Sequence[dict[str, Any]], pool: Sequence[PoseFiles],
    unused: Sequence[PoseFiles], rrd: Path, progress: ProgressCallback,
) -> Done:  # fmt: skip
    """Judged on the poses of the pool that were not used."""
    truth = _measured_hz(campaign.cell, unused, progress)
    q = campaign.cell.robot.joints.internal([one.joints_deg for one in unused])
    (ours, simulation, inside), *modes = errors = _errors(campaign, q, truth)
    each = list(zip(*modes, strict=True)) or [(), (), ()]
    keys = {
        "campaign": str(campaign.directory), "robot": campaign.cell.robot.name, "simulated": True,
        "pool": len(pool), "measurements": len(steps), "used": [step["pose"] for step in steps],
        "unused": len(truth), "modes_compared": int(np.isfinite(truth).sum()),
        "frequency_rmse_percent": ours, "simulation_rmse_percent": simulation,
        "frequency_rmse_percent_per_mode": each[0], "simulation_rmse_percent_per_mode": each[1],
        "coverage95": inside, "coverage95_per_mode": each[2], "remarks": campaign.model.remarks,
        "step_seconds": [step["seconds"] for step in steps], "steps": steps, "rrd": str(rrd),
    }  # fmt: skip
    return Done(keys, _said(keys, errors))


def _errors(
    campaign: Campaign, q: np.ndarray, truth: np.ndarray
) -> list[tuple[float, float, float]]:
    """RMSE of the planner and of the simulation alone (%), share in 95 % intervals.

    Of all modes together, then of each, at q (n, dof) in rad where `truth` (n, modes) is in Hz.
    """
    expected, simulated = campaign.model.predict(q), campaign.cell.frozen.simulate(q).frequency_hz
    found, exact = [], np.zeros_like(truth)
    for k in (slice(None), *(slice(k, k + 1) for k in range(truth.shape[1]))):
        at = np.s_[:, k]
        ours = score(expected.frequency_hz[at], expected.frequency_sd_hz[at], truth[at], exact[at])
        alone = score(simulated[at], exact[at], truth[at], exact[at])
        both = ours.frequency_rmse_percent, alone.frequency_rmse_percent
        found.append((*both, ours.coverage95))
    return found


def _said(keys: Mapping[str, Any], errors: Sequence[tuple[float, float, float]]) -> Group:
    """The course, and the errors mode by mode."""
    course = table("Course", "measurement", "pose", "measured (Hz)", "sd of frequencies (%)")
    for k, step in enumerate(keys["steps"], 1):
        hz, sd = ("  ".join(f"{v:.2f}" for v in step[name])
                  for name in ("frequency_hz", "frequency_sd_percent"))  # fmt: skip
        course.add_row(str(k), step["pose"], hz, sd)
    made = table(
        f"Demonstration on {keys['robot']}: {keys['measurements']} of {keys['pool']} poses",
        *("mode", "planner RMSE (%)", "simulation alone RMSE (%)", "in 95 % interval (%)"),
    )
    every, *modes = errors
    for name, (*both, inside) in (*enumerate(modes, 1), ("all", every)):
        style = "bold" if name == "all" else None
        made.add_row(str(name), *map(number, both), f"{100 * inside:.0f}", style=style)
    first, *later = keys["step_seconds"]
    lines = [
        *keys["remarks"],
        f"The RMSE is that of the frequencies at {keys['unused']} poses that were never measured. "
        f"Refitting and proposing the next pose took {first:.2f} s at first, then at most "
        f"{max(later, default=0.0):.2f} s.",
        f"Campaign: {keys['campaign']}",
        f"Rerun recording: {keys['rrd']} (open with: rerun FILE)",
    ]
    return Group(course, made, Text("\n".join(lines)), SIMULATED)


def _step(report: ImportReport, proposal: Proposal, seconds: float) -> dict[str, Any]:
    """A measurement: the pose, the one proposed next, frequencies of its modes, and times."""
    modes = report.measurement.modes if report.measurement else ()
    return {
        "pose": report.pose, "proposed": proposal.pose,
        "frequency_hz": tuple(m.frequency_hz for m in modes if m.likely),
        "refused": len(report.refused), "frequency_sd_percent": report.model.frequency_sd_percent,
        "refit_seconds": report.refit_seconds, "seconds": seconds,
    }  # fmt: skip


def _nearest(cell: Cell, pool: Sequence[PoseFiles], proposal: Proposal) -> PoseFiles:
    """The recorded pose that is nearest to a proposal, in model coordinates."""
    joints = cell.robot.joints
    target = cell.features(joints.internal([proposal.joints_deg]))
    there = cell.features(joints.internal([one.joints_deg for one in pool]))
    return pool[int(np.argmin(np.linalg.norm(there - target, axis=1)))]


def _measured_hz(cell: Cell, poses: Sequence[PoseFiles], progress: ProgressCallback) -> np.ndarray:
    """Frequencies (n, count) in Hz that the recordings of poses give; NaN where none was found."""
    found = []
    for i, pose in enumerate(poses):
        progress(f"checking on unused pose {i + 1}", i / len(poses))
        found.append(make(None, pose).measurement)
    return observations(cell, label(cell, tuple(found))).frequency_hz
