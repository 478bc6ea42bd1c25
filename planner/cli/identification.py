"""Identification of a simulation's elastic parameters (`planner identify`)."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from planner.cli.answer import AsJson, respond, warn

if TYPE_CHECKING:
    from planner.dataset.dataset import Dataset
    from planner.dynamics.simulation import Simulation
    from planner.identification.agreement import Similarity
    from planner.identification.held_out import JudgedIdentification
    from planner.identification.identify import Progress
    from planner.identification.result import Identification
    from planner.report.plot_files import Pictures
    from planner.robot.robot import Robot

MASS = INERTIA = 0.05
COM_M = 0.01
LARGE = 2.0  # misfit that noise and calibration do not explain


def identify(
    recordings: Annotated[
        Path, typer.Argument(metavar="RECORDINGS", help="Folder with recordings.csv.")
    ],
    robot: Annotated[Path, typer.Option(metavar="ROBOT_TOML", help="The robot's robot.toml.")],
    out: Annotated[
        Path | None, typer.Option(metavar="ROBOT_TOML", help="Write the identified robot here.")
    ] = None,
    inertias: Annotated[
        bool, typer.Option(help="Let masses and inertias err by 5 %, centres of mass by 1 cm.")
    ] = True,
    extend: Annotated[
        bool,
        typer.Option(help="Add the tilts of joints and floor that robot.toml leaves out."),
    ] = False,
    held_out: Annotated[
        int | None, typer.Option(min=0, metavar="N", help="Poses to judge by (default: 1 of 4).")
    ] = None,
    starts: Annotated[int, typer.Option(min=1, max=100, help="Starting points at most.")] = 8,
    seed: Annotated[int, typer.Option(min=0, help="Of the starting points.")] = 0,
    band_hz: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="LOW HIGH", help="Band in Hz, instead of robot.toml's."),
    ] = None,
    window_rate_1_s: Annotated[
        float,
        typer.Option("--window-rate", metavar="1/S", help="Of the analyser's exponential window."),
    ] = 0.0,
    plot: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Draw FRFs before and after into it.")
    ] = None,
    format_: Annotated[str, typer.Option("--format", help="Of the pictures: png or svg.")] = "png",
    rrd: Annotated[Path | None, typer.Option(help="Write a Rerun recording to this file.")] = None,
    as_json: AsJson = False,
) -> int:
    """Fit stiffness and damping of a robot's simulation to recorded hits."""
    from planner.cli import modal
    from planner.cli.progress import reporting
    from planner.cli.render_identification import identified
    from planner.dataset.dataset import Dataset
    from planner.dynamics.simulation import Simulation
    from planner.identification.extended_structure import Structure, extended
    from planner.identification.held_out import identify_judged
    from planner.identification.parameters import Priors
    from planner.identification.write_robot import check_target
    from planner.report.plot_files import Pictures
    from planner.robot.robot import Robot

    started = time.perf_counter()
    modal.check(band_hz, "h1", None, window_rate_1_s)
    pictures = Pictures(plot, format_, rrd)
    nominal = Robot.load(robot)
    if out is not None:
        check_target(out, nominal)
    simulation, band = Simulation(nominal), band_hz or nominal.config.band_hz
    priors = Priors(mass=MASS, inertia=INERTIA, com_m=COM_M) if inertias else Priors()
    fitted = extended(simulation, priors) if extend else Structure(simulation, priors)
    with reporting("identifying", quiet=as_json) as progress:
        recorded = Dataset.read(
            recordings,
            nominal.joint_names,
            band,
            window_rate_1_s=window_rate_1_s,
            progress=progress,
        )
        judged = identify_judged(
            recorded.frfs,
            recorded.q,
            fitted.simulation,
            fitted.priors,
            held_out,
            band_hz=band,
            starts=starts,
            seed=seed,
            progress=_told(progress),
        )
    found = fitted.simulation.robot
    answer = _answer(found, recorded, judged) | {
        "band_hz": list(band),
        "inertias": inertias,
        "added": fitted.added,
        "out": None,
        **_drawn(pictures, recorded, judged, simulation, band),
    }
    if out is not None:
        _write(answer, out, found, recorded, judged)
    answer["seconds"] = time.perf_counter() - started
    for file, reason in recorded.refused:
        warn(f"Refused {file}: {reason}")
    return respond(answer, as_json, identified, 3 if recorded.refused else 0)


def _write(
    answer: dict[str, Any],
    out: Path,
    robot: "Robot",
    recorded: "Dataset",
    judged: "JudgedIdentification",
) -> None:
    """Write the identified robot, read it again, and say how well that one agrees."""
    from planner.dynamics.simulation import Simulation
    from planner.identification.agreement import fit_similarity
    from planner.identification.write_robot import write_robot
    from planner.robot.robot import Robot

    written = write_robot(out, robot, judged.final)
    again, band = Simulation(Robot.load(written.robot_toml)), answer["band_hz"]
    fit = fit_similarity(again, recorded.frfs, recorded.q, (band[0], band[1]))
    answer["remarks"] += written.remarks
    answer |= {"out": str(written.robot_toml), "urdf": str(written.urdf)}
    answer["written"] = _similarity(fit)


def _drawn(
    pictures: "Pictures",
    recorded: "Dataset",
    judged: "JudgedIdentification",
    nominal: "Simulation",
    band_hz: tuple[float, float],
) -> dict[str, Any]:
    if not pictures.wanted:
        return {"plots": [], "rrd": None}
    from planner.report.identification_plots import Pose, identification_figures

    poses = []
    for i, name in enumerate(recorded.poses):
        aside = i in judged.held_out
        shown = judged.trial if aside and judged.trial else judged.final
        poses.append(Pose(name, recorded.q[i], recorded.frfs[i], shown.simulation, aside))
    mark = "SIMULATED recordings · " if recorded.simulated else ""
    figures = identification_figures(poses, nominal, band_hz, mark)
    return pictures.write(figures, nominal.robot.name)


def _told(progress: Callable[[str], None]) -> "Callable[[Progress], None]":
    def tell(at: "Progress") -> None:
        where = f"start {at.start}, " if at.start else ""
        progress(f"{where}{at.stage}, step {at.iteration}, misfit {at.misfit:.3g}")

    return tell


def _answer(robot: "Robot", recorded: "Dataset", judged: "JudgedIdentification") -> dict[str, Any]:
    final = judged.final
    aside = [recorded.poses[i] for i in judged.held_out]
    remarks = [*recorded.remarks, *final.remarks]
    if final.misfit > LARGE:
        remarks.append(
            f"The misfit is {final.misfit:.1f}, 1 being the noise: the simulation lacks more than "
            f"springs can make up for, and what it lacks is hidden in them; try --extend."
        )
    if not final.converged:
        remarks.append("The last fit had not come to rest; try more --starts.")
    if not aside:
        remarks.append(
            "No pose was held out, so nothing says how good the simulation is elsewhere; record "
            "three poses or more."
        )
    return {
        "parameters": parameters(robot, final),
        "fit": {**_similarity(final.fit), "before": _similarity(judged.before)},
        "held_out": {
            **_similarity(judged.held_out_after),
            "before": _similarity(judged.held_out_before),
            "poses": aside,
        },
        "undetermined": [direction.text for direction in final.undetermined],
        "misfit": final.misfit,
        "misfit_by_pose": dict(zip(recorded.poses, final.misfit_by_pose, strict=True)),
        "converged": final.converged,
        "refused": [{"file": file, "reason": reason} for file, reason in recorded.refused],
        "remarks": remarks,
        "simulated": recorded.simulated,
    }


def parameters(robot: "Robot", found: "Identification") -> list[dict[str, Any]]:
    """One entry per [[compliance]] block, in its order; `identifiable` speaks of the stiffness."""
    by_block = {(e.kind, number): e for e in found.estimates for number in e.blocks}
    entries = []
    for number, block in enumerate(robot.config.compliance):
        entry: dict[str, Any] = {"joint": block.joint, "axis": list(block.axis)}
        for kind in ("stiffness", "damping", "loss_factor"):
            estimate = by_block.get((kind, number))
            entry[kind] = getattr(block, kind) if estimate is None else estimate.value
            entry[f"{kind}_sd"] = None if estimate is None else estimate.sd
            told = estimate is not None and estimate.identifiable
            entry["identifiable" if kind == "stiffness" else f"{kind}_identifiable"] = told
        entry["nominal"] = {"stiffness": block.stiffness, "damping": block.damping}
        entries.append(entry)
    return entries


def _similarity(of: "Similarity | None") -> dict[str, float | None]:
    return {
        "frac": None if of is None else of.frac,
        "frobenius": None if of is None else of.frobenius,
    }
