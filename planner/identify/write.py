"""An identified robot as a folder: robot.toml, whose comments and order stay, and its URDF."""

import shutil
from dataclasses import dataclass
from pathlib import Path

import tomlkit

from planner.errors import InputError
from planner.identify.result import Identification
from planner.robot.robot import Robot

DIGITS = 6  # significant ones: more than any identification knows


def updated_toml(text: str, result: Identification, urdf: str | None = None) -> str:
    """The robot.toml `text` with the [[compliance]] blocks' numbers (and its urdf) replaced."""
    document = tomlkit.parse(text)
    blocks = document["compliance"]
    for estimate in result.estimates:
        for number in estimate.blocks:
            blocks[number][estimate.kind] = float(f"{estimate.value:.{DIGITS}g}")
    if urdf is not None:
        document["urdf"] = urdf
    return tomlkit.dumps(document)


@dataclass(frozen=True)
class Written:
    """Files of an identified robot, absolute."""

    robot_toml: Path
    urdf: Path


def check_target(out: Path, robot: Robot) -> None:
    """InputError where `out` cannot be written without losing something."""
    if out.exists() or out.is_symlink():
        raise InputError(f"{out} exists already; name a new file, so that nothing is lost.")
    if out.suffix != ".toml":
        raise InputError(f"{out} does not end in .toml; name a robot.toml to write.")
    folder = next(p for p in (out.absolute().parent, *out.absolute().parents) if p.exists())
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder; {out} cannot be written there, name another.")


def write_robot(out: Path, robot: Robot, result: Identification) -> Written:
    """Write robot.toml at `out`, and the URDF beside it where that folder is another."""
    check_target(out, robot)
    out = out.absolute()
    urdf, entry = robot.urdf_path, None
    text = robot.path.read_text(encoding="utf-8")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        if out.parent.resolve() != robot.path.parent.resolve():
            urdf, entry = out.parent / robot.urdf_path.name, robot.urdf_path.name
            if urdf.exists() and urdf.read_bytes() != robot.urdf_path.read_bytes():
                raise InputError(f"{urdf} is another robot's; name another folder with --out.")
            shutil.copyfile(robot.urdf_path, urdf)
        with open(out, "x", encoding="utf-8") as file:
            file.write(updated_toml(text, result, entry))
    except OSError as error:
        raise InputError(
            f"{out} cannot be written ({error.strerror}); name another file with --out."
        ) from None
    return Written(out, urdf)
