"""The explained robot as a folder: robot.toml with [[effects]], and its URDF."""

from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.linear_diagnosis import Candidate, Diagnosis
from planner.errors import InputError
from planner.identification.parameters import KINDS
from planner.robot.robot import Robot
from planner.robot.urdf import copy_meshes
from planner.robot.urdf_inertias import urdf_with_inertias

DIGITS = 6


def write_explained(folder: Path, robot: Robot, diagnosis: Diagnosis, accepted: Candidate) -> Path:
    """Write folder/robot.toml and the URDF beside it; returns robot.toml's path.

    Springs and inertias are the refitted ones; each accepted effect is an [[effects]] block.
    Raises InputError where the files cannot be written; earlier ones of the same names go.
    """
    found = accepted.fit
    assert found is not None  # "unknown" is never accepted
    path = folder.absolute() / "robot.toml"
    if path == robot.path.absolute():
        raise InputError(f"--out {folder} holds the robot that was given; name another folder.")
    urdf = folder / robot.urdf_path.name
    bodies, change = _inertia_change(found, robot)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        urdf.write_text(urdf_with_inertias(robot, bodies, change)[0], encoding="utf-8")
        copy_meshes(robot.urdf_path, urdf)
        path.write_text(_toml(robot, diagnosis, accepted, found, urdf.name), encoding="utf-8")
    except OSError as error:
        raise InputError(f"{folder} cannot be written ({error.strerror}); name another.") from None
    return path


def _inertia_change(found: Fit, robot: Robot) -> tuple[tuple[str, ...], np.ndarray]:
    a, b = found.misfit.split
    change = found.misfit.parametrisation.inertia_change(found.x[a:b])
    return found.misfit.setting.simulation.elastic.bodies, change


def _toml(robot: Robot, diagnosis: Diagnosis, accepted: Candidate, found: Fit, urdf: str) -> str:
    document = tomlkit.parse(robot.path.read_text(encoding="utf-8"))
    document["urdf"] = urdf
    springs = found.misfit.parametrisation.elasticity(found.x[: found.misfit.split[0]])
    listed: Any = document["compliance"]
    for number, block in enumerate(listed):
        for kind in KINDS:
            value = _round(float(getattr(springs, kind)[number]))
            if value or kind in block:
                block[kind] = value
    effects: Any = document.get("effects", tomlkit.aot())
    for effect in accepted.effects if accepted.effects[0].at else ():
        values = found.parameters(diagnosis.temper, effect)
        entry = tomlkit.table()
        entry |= {"effect": effect.name, "at": effect.at}
        entry["probability"] = _round(accepted.probability)
        told = {
            _key(n): {"value": _round(v), "sd": _round(sd), "unit": unit}
            for n, (v, sd, unit) in values.items()
        }
        entry["parameters"] = told
        elements = effect.elements(found.misfit.setting.simulation, values)
        for name, blocks in elements.items():
            entry[name] = [{k: _rounded(v) for k, v in block.items()} for block in blocks]
        effects.append(entry)
    if len(effects):
        document["effects"] = effects
    return tomlkit.dumps(document)


def _key(name: str) -> str:
    return name.replace("−", "-")


def _rounded(value: Any) -> Any:
    if isinstance(value, list):
        return [_rounded(v) for v in value]
    return _round(value) if isinstance(value, float) else value


def _round(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
