"""Diagnosis of recordings that differ from the simulation (`planner diagnose`)."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from planner.cli.answer import AsJson, respond, warn

if TYPE_CHECKING:
    from planner.dataset.dataset import Dataset
    from planner.diagnosis.diagnose import Explained
    from planner.diagnosis.finding import Finding
    from planner.diagnosis.linear.predict import ThreefoldSimilarity
    from planner.diagnosis.linear_diagnosis import Candidate, Diagnosis
    from planner.robot.robot import Robot


def diagnose(
    recordings: Annotated[
        Path,
        typer.Argument(metavar="RECORDINGS", help="Folder with recordings.csv, or a campaign."),
    ],
    robot: Annotated[
        Path | None,
        typer.Option(metavar="ROBOT_TOML", help="The robot's robot.toml (a campaign has its own)."),
    ] = None,
    predict: Annotated[
        Path | None, typer.Option(metavar="POSES_CSV", help="Poses whose FRFs are wanted.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Write robot, FRFs and pictures here.")
    ] = None,
    window_rate_1_s: Annotated[
        float,
        typer.Option("--window-rate", metavar="1/S", help="Of the analyser's exponential window."),
    ] = 0.0,
    as_json: AsJson = False,
) -> int:
    """Locate where simulation and recordings differ, name the missing physics, show the fit."""
    from planner.cli import modal
    from planner.cli.material import material
    from planner.cli.next_hit import next_hit
    from planner.cli.progress import counting
    from planner.cli.render_diagnosis import diagnosed
    from planner.diagnosis.diagnose import explain
    from planner.dynamics.simulation import Simulation
    from planner.recording.folder import read_poses
    from planner.robot.robot import Robot

    started = time.perf_counter()
    modal.check(None, "h1", None, window_rate_1_s)
    given = material(recordings, robot, window_rate_1_s)
    nominal = Robot.load(given.robot)
    wanted = read_poses(predict, nominal.joint_names) if predict else ()
    with counting(quiet=as_json) as tell:
        recorded = given.read(
            nominal.joint_names, nominal.config.band_hz, lambda text: tell(text, 0.0)
        )
        explained = explain(recorded, Simulation(nominal), tell)
        recorded, found = explained.recorded, explained.judged.diagnosis
        answer = _answer(explained)
        answer |= {"npz": None, "robot": None, "plots": []}
        answer["next"] = next_hit(explained, given.with_poses(wanted))
        if wanted:
            rows = [(row.pose, row.joints_deg) for row in wanted]
            answer["npz"] = str(_predict(found, rows, _target(out, predict, given.recordings)))
        if out is not None:
            answer |= _written(out, nominal, recorded, found)
    answer["seconds"] = time.perf_counter() - started
    for file, reason in recorded.refused:
        warn(f"Refused {file}: {reason}")
    return respond(answer, as_json, diagnosed, 3 if recorded.refused else 0)


def _target(out: Path | None, predict: Path | None, recordings: Path) -> Path:
    """Where predictions go: FOLDER, or beside the recordings' folder."""
    assert predict is not None
    folder = out if out is not None else recordings.absolute().parent / "predictions"
    return folder.absolute() / f"{predict.stem}.npz"


def _answer(explained: "Explained") -> dict[str, Any]:
    from planner.diagnosis.residual_location import where

    recorded, judged, whole = explained.recorded, explained.judged, explained.whole
    found = judged.diagnosis
    place = where(found.problem, found.refitted)
    return {
        "verdict": whole.verdict,
        "findings": [
            *(_established(finding, p) for finding, p in whole.established),
            *(_findings(found) if whole.linear else []),
        ],
        "candidates": [
            {
                "effect": " + ".join(name for name, _ in c.places),
                "at": " + ".join(at for _, at in c.places if at) or None,
                "probability": c.probability,
                "effects": [{"effect": name, "at": at} for name, at in c.places],
            }
            for c in whole.candidates
        ],
        "undecided": [list(c.places) for c in found.undecided],
        "where": {
            "bands_hz": place.bands_hz(),
            "poses": [recorded.poses[i] for i in place.poses()],
            "directions": place.directions(),
        },
        "fit": _agreement(judged.fitted),
        "held_out": {
            "poses": [recorded.poses[i] for i in judged.aside],
            **_agreement(judged.held_out),
        },
        "misfit": {"refitted": found.refitted.per_value, "explained": found.best.per_value},
        "refused": [{"file": file, "reason": reason} for file, reason in recorded.refused],
        "remarks": list(recorded.remarks),
        "simulated": recorded.simulated,
    }


def _findings(found: "Diagnosis") -> list[dict[str, Any]]:
    """The effects of the best candidate, where there is one better than "none" and "unknown"."""
    if found.verdict != "explained":
        return []
    first = found.candidates[0]
    assert first.fit is not None
    entries = []
    for effect in first.effects:
        values = first.fit.parameters(found.temper, effect)
        entries.append(
            {
                "effect": effect.name,
                "at": effect.at,
                "probability": _marginal(found, effect.name, effect.at),
                "parameters": {
                    n: {"value": v, "sd": sd, "unit": unit} for n, (v, sd, unit) in values.items()
                },
                "text": _text(found, first, effect.text(values)),
            }
        )
    return entries


def _marginal(found: "Diagnosis", name: str, at: str) -> float:
    """Probability that an effect is there, alone or with another."""
    return min(1.0, sum(c.probability for c in found.candidates if (name, at) in c.places))


def _text(found: "Diagnosis", first: "Candidate", text: str) -> str:
    from planner.cli.next_hit import in_words

    others = [c for c in found.undecided if c is not first]
    if not others:
        return f"{text} ({100 * first.probability:.0f} %)"
    names = "; ".join(in_words(c.places, c.probability) for c in others)
    return (
        f"{text} ({100 * first.probability:.0f} %) These recordings cannot tell it from: {names}."
    )


def _established(finding: "Finding", probability: float) -> dict[str, Any]:
    return {
        "effect": finding.effect,
        "at": finding.at,
        "probability": probability,
        "parameters": {
            n: {"value": v, "sd": sd, "unit": unit}
            for n, (v, sd, unit) in finding.parameters.items()
        },
        "text": f"{finding.text} ({100 * probability:.0f} %)",
    }


def _agreement(of: "ThreefoldSimilarity | None") -> dict[str, Any]:
    names = ("nominal", "refitted", "explained")
    if of is None:
        return {name: {"frac": None, "frobenius": None} for name in names}
    sides = {name: getattr(of, name) for name in names}
    return {n: {"frac": s.frac, "frobenius": s.frobenius} for n, s in sides.items()}


def _predict(found: "Diagnosis", rows: list[tuple[str, tuple[float, ...]]], path: Path) -> Path:
    import numpy as np

    from planner.cli.answers import frequency_lines, save_npz
    from planner.diagnosis.linear.predict import predicted

    lines = frequency_lines(found.problem.band_hz)
    angles = np.array([joints for _, joints in rows])
    mean, sd = predicted(found.problem, found.best, np.deg2rad(angles), lines, found.temper)
    names = np.array([name for name, _ in rows])
    save_npz(path, frequency_hz=lines, frf_mean=mean, frf_sd=sd, pose=names, joints_deg=angles)
    return path


def _written(out: Path, robot: "Robot", recorded: "Dataset", found: "Diagnosis") -> dict[str, Any]:
    """The explained robot and the pictures, in a folder."""
    from planner.diagnosis.linear_diagnosis import Candidate
    from planner.diagnosis.write_explained import write_explained
    from planner.report.diagnosis_plots import diagnosis_figures
    from planner.report.plot_files import Pictures

    parts = found.best.effect.parts()
    places = {(e.name, e.at or None) for e in parts}
    shares = [c.probability for c in found.candidates if set(c.places) == places]
    path = write_explained(out, robot, found, Candidate(parts, sum(shares), found.best))
    mark = "SIMULATED recordings · " if recorded.simulated else ""
    figures = diagnosis_figures(found, recorded.poses, mark)
    plots = Pictures(out).write(figures, robot.name)["plots"]
    return {"robot": str(path), "plots": plots}
