"""The answers of the campaign commands as plain values."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from planner.campaign.campaign import Campaign
from planner.campaign.events import Entry, HitRecord, Proposal, Question
from planner.campaign.importing import ImportReport
from planner.campaign.model import Model
from planner.errors import InputError


def created(campaign: Campaign) -> dict[str, Any]:
    """Answer of `new`."""
    cell = campaign.cell
    return {
        "campaign": str(campaign.directory),
        "robot": cell.robot.name,
        "joints": list(cell.robot.joint_names),
        "modes": cell.config.modes.count,
        "acquisition": cell.config.acquisition.name,
        "remarks": list(cell.remarks),
    }


def proposals(campaign: Campaign, found: tuple[Proposal, ...]) -> dict[str, Any]:
    """Answer of `next`, with what the model expects at each pose."""
    q = np.deg2rad(np.array([p.joints_deg for p in found]))
    expected = campaign.model.predict(q)
    return {
        "proposals": [
            {**msgspec.to_builtins(p), "expected": _expected(expected, i)}
            for i, p in enumerate(found)
        ],
        "joint_names": list(campaign.cell.robot.joint_names),
        "forecast": _forecast(campaign.model),
        "repeat": _repeat(campaign.model),
        "remarks": list(campaign.cell.remarks),
    }


def _forecast(model: Model) -> dict[str, Any]:
    """Predicted RMSE over the workspace, with what is said of it."""
    found = model.forecast
    return {**dataclasses.asdict(found), "text": found.text}


def _repeat(model: Model) -> dict[str, Any] | None:
    """The measured pose whose repetition gains most, where that is more than a new pose would."""
    found = model.repeat()
    if found is None or found[1] <= found[2]:
        return None
    pose, gain, fresh = found
    text = f"Noise dominates: hitting {pose} again tells more than any new pose."
    return {"pose": pose, "gain": gain, "gain_of_a_new_pose": fresh, "text": text}


def _expected(prediction, i: int) -> list[dict[str, float]]:
    return [
        {
            "frequency_hz": prediction.frequency_hz[i, k],
            "sd_hz": prediction.frequency_sd_hz[i, k],
            "damping_ratio": prediction.damping_ratio[i, k],
            "damping_sd": prediction.damping_sd[i, k],
        }
        for k in range(prediction.frequency_hz.shape[1])
    ]


def imported(reports: tuple[ImportReport, ...]) -> dict[str, Any]:
    """Answer of `import`; the top-level keys speak of the last pose, `poses` of each."""
    each = [_imported(report) for report in reports]
    return {**each[-1], "poses": each}


def _imported(report: ImportReport) -> dict[str, Any]:
    return {
        "pose": report.pose,
        "accepted": [hit.file for hit in report.accepted],
        "refused": refused((*report.refused, *report.left_out)),
        "question": _question(report.question, report.pose),
        "already_imported": list(report.already),
        "modes": _labelled_modes(report),
        "refit_seconds": report.refit_seconds,
        "frequency_sd_percent_before": report.model_before.frequency_sd_percent,
        "frequency_sd_percent": report.model.frequency_sd_percent,
        "remarks": list(report.remarks),
        "amplitude": msgspec.to_builtins(report.measurement.amplitude)
        if report.measurement
        else None,
        "simulated": bool(report.measurement and report.measurement.simulated),
    }


def _question(question: Question | None, pose: str) -> dict[str, Any] | None:
    return None if question is None else {"pose": pose, **msgspec.to_builtins(question)}


def _labelled_modes(report: ImportReport) -> list[dict[str, Any]]:
    """Modes of the pose with their label (None: not one of those modelled) and expectation."""
    if report.measurement is None:
        return []
    labelled = next((p for p in report.model.labelled if p.pose == report.pose), None)
    expected = report.model_before.predict(np.deg2rad([report.measurement.joints_deg]))
    labels = {m.frequency_hz: k for k, m in enumerate(labelled.modes) if m} if labelled else {}
    sure = dict(enumerate(labelled.probability)) if labelled else {}
    answer = []
    for mode in report.measurement.modes:
        k = labels.get(mode.frequency_hz)
        if k is None and not mode.likely:
            continue
        answer.append(
            {
                "label": None if k is None else k + 1,
                "label_probability": None if k is None else sure[k],
                "frequency_hz": mode.frequency_hz,
                "frequency_sd_hz": mode.frequency_sd_hz,
                "damping_ratio": mode.damping_ratio,
                "damping_sd": mode.damping_sd,
                "shape": mode.shape,
                "probability": mode.probability,
                "expected": None if k is None else _expected(expected, 0)[k],
            }
        )
    return answer


def what_to_say(directory: Path, pose: str, asked: str) -> str:
    """What is asked of held hits, and the commands that answer it, in one line."""
    return (
        f"{asked} They are held, not used. If it is: planner confirm {directory} {pose}; if it is "
        f"at OTHER: planner confirm {directory} {pose} --at OTHER; else: planner withdraw "
        f"{directory} {pose}."
    )


def status(campaign: Campaign) -> dict[str, Any]:
    """Answer of `status`."""
    state, model = campaign.state, campaign.model
    config = campaign.cell.config
    sd = model.frequency_sd_percent
    refused = [
        {"pose": m.pose, "file": h.file, "reason": h.reason}
        for m in state.recorded
        for h in m.hits
        if not h.accepted
    ] + [{"pose": p, "file": h.file, "reason": h.reason} for p, h in state.refused.values()]
    return {
        "campaign": str(campaign.directory),
        "robot": campaign.cell.robot.name,
        "simulated": any(m.simulated for m in state.recorded),
        "measurements": [_measurement(m, state.starred) for m in state.measurements.values()],
        "held": [
            _measurement(m, state.starred) | {"question": _question(m.question, m.pose)}
            for m in state.held.values()
        ],
        "open": [msgspec.to_builtins(state.proposals[pose]) for pose in state.open],
        "skipped": [{"pose": p, "reason": r} for p, r in state.skipped.items()],
        "refused": refused,
        "frequency_sd_percent": sd,
        "target_frequency_sd_percent": config.stop.frequency_sd_percent,
        "done": bool(model.done),
        "forecast": _forecast(model),
        "remarks": list(model.remarks),
        "log": {"entries": state.events, "torn_bytes": campaign.torn_bytes},
        "joint_names": list(campaign.cell.robot.joint_names),
        "stored_but_not_imported": campaign.orphans(),
    }


def _measurement(measurement, starred: frozenset[str]) -> dict[str, Any]:
    return {
        "pose": measurement.pose,
        "joints_deg": measurement.joints_deg,
        "hits": len(measurement.accepted),
        "refused": len(measurement.hits) - len(measurement.accepted),
        "frequency_hz": [mode.frequency_hz for mode in measurement.modes if mode.likely],
        "withdrawn": measurement.withdrawn,
        "starred": measurement.pose in starred,
        "simulated": measurement.simulated,
        "time": measurement.time,
        "remarks": list(measurement.remarks),
    }


def undone(entry: Entry) -> dict[str, Any]:
    """Answer of `undo`."""
    return {"undone": entry.seq, "event": msgspec.to_builtins(entry.event)["kind"]}


def session(summary) -> dict[str, Any]:
    """Answer of `watch`."""
    return dataclasses.asdict(summary)


def predicted(campaign: Campaign, poses_csv: Path, out: Path | None) -> dict[str, Any]:
    """Answer of `predict`; writes the FRFs to an npz file."""
    from planner.recording.folder import read_poses

    cell, model = campaign.cell, campaign.model
    rows = read_poses(poses_csv, cell.robot.joint_names)
    q = np.array([cell.check_pose(r.joints_deg, f"{poses_csv}, row {r.row}") for r in rows])
    frequency_hz = frequency_lines(cell.config.modes.band_hz)
    prediction = model.predict(q)
    mean, sd = model.frf(q, frequency_hz)
    out = out or campaign.directory / "predictions" / f"{poses_csv.stem}.npz"
    names = [row.pose for row in rows]
    save_npz(
        out, frequency_hz=frequency_hz, frf_mean=mean, frf_sd=sd, pose=np.array(names),
        joints_deg=np.rad2deg(q),
    )  # fmt: skip
    return {
        "poses": [{"pose": p, "modes": _expected(prediction, i)} for i, p in enumerate(names)],
        "npz": str(out.resolve()),
        "measurements": len(model.labelled),
    }


def frequency_lines(band_hz: tuple[float, float]) -> np.ndarray:
    """Lines (Hz) at which FRFs are predicted: 0.1 Hz apart, at most 2000 of them."""
    low, high = band_hz
    return np.linspace(low, high, min(2000, round((high - low) / 0.1)) + 1)


def save_npz(path: Path, **arrays: np.ndarray) -> None:
    """Write arrays to exactly this path; InputError if that cannot be done."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(path, "wb") as file:
            np.savez_compressed(file, allow_pickle=False, **arrays)
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror}); name another.") from None


def replayed(
    campaign: Campaign,
    until: int | None,
    rrd: Path | None,
    viewer: bool,
    progress: Callable[[str], None],
    acquisition: str | None = None,
) -> dict[str, Any]:
    """Answer of `replay`: each step of the log and whether computing it again gave the same.

    With an `acquisition` also what that would have proposed, and saved.
    """
    from planner.replay import replay
    from planner.report.rerun_story import Story

    steps, model = [], None
    simulated = any(m.simulated for m in campaign.state.recorded)
    with Story(campaign.cell, rrd, viewer, simulated) as story:
        for step in replay(campaign, until, acquisition):
            progress(f"{step.entry.seq} of {len(campaign.entries)} {step.detail}")
            story.tell(step.entry, step.state, step.model, step.measured)
            steps.append(
                {
                    "seq": step.entry.seq,
                    "time": step.entry.time,
                    "event": msgspec.to_builtins(step.entry.event)["kind"],
                    "check": step.check,
                    "detail": step.detail,
                    "measurements": len(step.model.labelled),
                    "frequency_sd_percent": step.model.frequency_sd_percent,
                    "instead": [
                        {"joints_deg": p.joints_deg, "position_m": p.position_m, "hits": p.hits}
                        for p in step.instead
                    ],
                }
            )
            model = step.model
    if acquisition is not None:
        progress(f"playing {acquisition} on what was measured")
    return {
        "campaign": str(campaign.directory),
        "steps": steps,
        "reproduced": all(step["check"] != "differs" for step in steps),
        "rrd": str(rrd.resolve()) if rrd else None,
        "frequency_sd_percent": _sd(model),
        "otherwise": _otherwise(campaign, acquisition),
    }


def _otherwise(campaign: Campaign, acquisition: str | None) -> dict[str, Any] | None:
    from planner.compare.counterfactual import otherwise

    found = otherwise(campaign, acquisition) if acquisition else None
    if found is None:
        return None
    runs = {"campaign": found.measured, found.acquisition: found.instead}
    names = "poses", "n", "frequency_rmse_percent", "minutes"
    curves = {k: {name: list(getattr(run, name)) for name in names} for k, run in runs.items()}
    return {"acquisition": found.acquisition, "text": found.text, "runs": curves}


def _sd(model: Model | None) -> list[float] | None:
    return None if model is None else model.frequency_sd_percent.tolist()


def refused(hits: tuple[HitRecord, ...]) -> list[dict[str, str]]:
    """Refused hits with their reasons."""
    return [{"file": hit.file, "reason": hit.reason} for hit in hits if not hit.accepted]
