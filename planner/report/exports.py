"""Answer of `export`: a campaign's results or proposals in another program's format."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Group
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.errors import InputError, writing
from planner.export import uff
from planner.export.campaign_files import (
    LOADER,
    ExportData,
    export_data,
    frfs_csv,
    mat_arrays,
    model_arrays,
    modes_csv,
)
from planner.recording.folder import read_poses
from planner.recording.records import PoseRow
from planner.report.answer import Done
from planner.robot.collision import Collisions
from planner.robot.config import ControllerTable
from planner.robot.controller_program import (
    PROGRAMS,
    SUFFIXES,
    PoseToDrive,
    identifier,
    program,
    unique,
)
from planner.robot.robot import Robot

DATA = ("uff", "mat", "csv", "model")
KINDS = (*PROGRAMS, *DATA)
AS_URDF = (
    "Angles are the URDF's own: robot.toml has no [controller]. Compare one pose with the robot's "
    "panel before it drives; where signs or zeros differ, state them there."
)


def export(campaign: Campaign, kind: str, out: Path | None, poses_csv: Path | None) -> Done:
    """Answer of `export`: a campaign as one of KINDS is in a folder, by default DIR/export.

    Those of PROGRAMS drive the robot to the open proposals, or to other poses, which predictions
    are for, too. InputError where there is nothing to export, or a file cannot be written.
    """
    if kind not in KINDS:
        raise InputError(f"{kind} is no format; give one of {', '.join(KINDS)}.")
    rows = read_poses(poses_csv, campaign.cell.robot.joints) if poses_csv else ()
    for row in rows:
        campaign.cell.check_pose(row.joints_deg, f"{poses_csv}, row {row.row}")
    folder = (out or campaign.directory / "export").absolute()
    if kind in PROGRAMS:
        if rows:
            _refuse_contacts(campaign.cell.robot, poses_csv, rows)
        return _program(campaign, kind, folder, rows)
    found = export_data(campaign, [r.pose for r in rows], [r.joints_deg for r in rows])
    if not found.measured and not found.poses and kind != "model":
        raise InputError(f"{campaign.directory} has no measured pose yet; name poses with --poses.")
    loader = errors = None
    if kind == "model":
        arrays, name = model_arrays(campaign, found), f"{identifier(found.name)}_model"
        coordinates = ", ".join(map(str, arrays["names"]))
        loader = LOADER.format(file=f"{name}.npz", coordinates=coordinates)
        files: dict[str, Any] = {f"{name}.npz": arrays, f"{name}.py": loader.lstrip()}
        errors = tuple(arrays["error_percent"].tolist())
    elif kind == "uff":
        files = _uff(found)
    elif kind == "mat":
        files = {f"{identifier(found.name)}.mat": mat_arrays(found)}
    else:
        files = {"modes.csv": modes_csv(found), "frfs.csv": frfs_csv(found)}
    poses = dict.fromkeys([*(m.pose for m, _ in found.measured), *found.poses])
    return _written(kind, folder, files, list(poses), found.simulated, loader, errors)


def _refuse_contacts(robot: Robot, file: Path | None, rows: Sequence[PoseRow]) -> None:
    """Proposals touch nothing; InputError where a pose that was named by hand does."""
    collisions = Collisions(robot)
    for row in rows:
        if touching := collisions.contacts(robot.joints.internal(row.joints_deg)):
            raise InputError(
                f"{file}, row {row.row}: at {row.pose} {'; '.join(touching)}; name another pose, "
                f"or list the pair in robot.toml, [collision] ignore."
            )


def _program(campaign: Campaign, kind: str, folder: Path, rows: Sequence[PoseRow]) -> Done:
    state, name = campaign.state, campaign.directory.name
    drive = [PoseToDrive(r.pose, tuple(r.joints_deg)) for r in rows]
    open_ = [state.proposals[pose] for pose in state.open]
    drive = drive or [PoseToDrive(p.pose, p.joints_deg, p.hits) for p in open_]
    if not drive:
        raise InputError(
            f"{campaign.directory} has no open proposal; ask planner next first, or name --poses."
        )
    text = program(kind, campaign.cell.robot, f"planner_{name}", drive, state.simulated)
    files = {f"{identifier(f'planner_{name}', 'C_')}{SUFFIXES[kind]}": text}
    told = (AS_URDF,) if campaign.cell.robot.config.controller == ControllerTable() else ()
    return _written(kind, folder, files, [d.pose for d in drive], state.simulated, told=told)


def _uff(found: ExportData) -> dict[str, Any]:
    """A file for each pose: FRFs and modes as measured, FRFs as predicted."""
    files, used = {}, set[str]()
    for m, frf in found.measured:
        name = unique(identifier(m.pose), used)
        title = f"{found.label}, pose {m.pose}, measured"
        sets = uff.tool_frfs(frf.frequency_hz, frf.accelerance, title, frf.coherence)
        files[f"{name}_measured.unv"] = sets
        files[f"{name}_modes.unv"] = uff.tool_modes(m.modes, title)
    used = set[str]()
    for i, pose in enumerate(found.poses):
        title = f"{found.label}, pose {pose}, predicted"
        sets = uff.tool_frfs(found.frequency_hz, found.frf_mean[i], title)
        files[f"{unique(identifier(pose), used)}_predicted.unv"] = sets
    return files


def _written(
    kind: str, folder: Path, files: dict[str, Any], poses: Sequence[str], simulated: bool,
    loader: str | None = None, errors: Sequence[float] | None = None, told: Sequence[str] = (),
) -> Done:  # fmt: skip
    """The files, once written, and the poses in them; what reads a model, how well it holds."""
    paths = _write(folder, files)
    keys = {
        "kind": kind, "files": paths, "poses": poses, "simulated": simulated, "loader": loader,
        "error_percent": errors, "remarks": told,
    }  # fmt: skip
    lines = ["\n  ".join([f"Exported as {kind}:", *paths])]
    if errors:
        each = ", ".join(f"mode {k} {e:.2g} %" for k, e in enumerate(errors, 1))
        lines.append(f"Interpolating errs by (rms; part of the sds): {each}.")
    return Done(keys, Group(*map(Text, (*lines, *told))))


def _write(folder: Path, files: dict[str, Any]) -> tuple[str, ...]:
    """Write texts, datasets, and arrays as .npz or .mat by the name; returns the paths."""
    with writing(folder, "another folder"):
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            path = folder / name
            if isinstance(content, str):
                path.write_text(content, encoding="utf-8", newline="")
            elif path.suffix == ".unv":
                uff.write_sets(path, content)
            elif path.suffix == ".mat":
                from scipy.io import savemat

                savemat(path, content, do_compression=True, long_field_names=True)
            else:
                with open(path, "wb") as file:
                    np.savez_compressed(file, allow_pickle=False, **content)
    return tuple(str(folder / name) for name in files)
