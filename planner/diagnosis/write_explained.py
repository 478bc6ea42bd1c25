"""The explained robot: as a simulation, or as a folder with robot.toml and its URDF."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import tomlkit

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.effects.slight_bearings import is_slight
from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.linear_diagnosis import Candidate, Diagnosis
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import KINDS
from planner.errors import InputError
from planner.fit.write_robot import drop_stated_inertias
from planner.robot.config import BASE, EffectTable, entry_of, without_effects
from planner.robot.massless_base import massless_base
from planner.robot.mesh_files import copy_meshes
from planner.robot.robot import Robot
from planner.robot.urdf_inertias import urdf_with_inertias

DIGITS = 6  # significant ones in robot.toml: more than any diagnosis knows


@dataclass(frozen=True, eq=False)
class _Changes:
    """What an explanation changes: springs of [[compliance]], new [[effects]], inertias."""

    springs: tuple[dict[str, float], ...]
    effects: tuple[dict[str, Any], ...]
    bodies: tuple[str, ...]
    inertia_change: np.ndarray  # (bodies, 10)


def explained_simulation(diagnosis: Diagnosis, accepted: Candidate) -> Simulation:
    """The refitted simulation with the accepted effects, as `write_explained` would write it."""
    changes = _changes(diagnosis, accepted)
    effects = [msgspec.convert(entry, EffectTable) for entry in changes.effects]
    nominal = diagnosis.problem.simulation
    return nominal.with_effects(changes.springs, effects, changes.bodies, changes.inertia_change)


def possible_simulation(diagnosis: Diagnosis, accepted: Candidate) -> Simulation | None:
    """As `explained_simulation`; None where the explanation needs bodies that no robot has."""
    try:
        return explained_simulation(diagnosis, accepted)
    except InputError:
        return None


def write_explained(folder: Path, robot: Robot, diagnosis: Diagnosis, accepted: Candidate) -> Path:
    """Write folder/robot.toml and the URDF beside it; returns robot.toml's path.

    Springs and inertias are the refitted ones; each accepted effect is an [[effects]] block.
    Raises InputError where the files cannot be written; earlier ones of the same names go.
    """
    path = folder.absolute() / "robot.toml"
    if path == robot.path.absolute():
        raise InputError(f"--out {folder} holds the robot that was given; name another folder.")
    urdf, changes = folder / robot.urdf_path.name, _changes(diagnosis, accepted)
    text, _ = urdf_with_inertias(robot, changes.bodies, changes.inertia_change)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        urdf.write_text(text, encoding="utf-8")
        copy_meshes(text, robot.urdf_path, urdf)
        path.write_text(_toml(robot, changes, urdf.name), encoding="utf-8")
    except OSError as error:
        raise InputError(f"{folder} cannot be written ({error.strerror}); name another.") from None
    return path


def _changes(diagnosis: Diagnosis, accepted: Candidate) -> _Changes:
    found = accepted.fit
    assert found is not None  # "unknown" is never accepted
    a, b = found.misfit.split
    elasticity = found.misfit.parametrisation.elasticity(found.x[:a])
    count = len(without_effects(diagnosis.problem.simulation.robot.config).compliance)
    springs = tuple(
        {kind: _round(float(getattr(elasticity, kind)[i])) for kind in KINDS} for i in range(count)
    )
    there = accepted.effects if accepted.effects[0].at else ()
    effects = tuple(_entry(diagnosis, accepted, found, effect) for effect in there)
    effects += _bearings(diagnosis, found)
    change = found.misfit.parametrisation.inertia_change(found.x[a:b])
    bodies = found.misfit.setting.simulation.elastic.bodies
    if BASE in bodies and massless_base(diagnosis.problem.simulation.robot):
        change[bodies.index(BASE)] = 0.0  # of a mass that is there so that it can move
    return _Changes(springs, effects, bodies, change)


def _entry(diagnosis: Diagnosis, accepted: Candidate, found: Fit, effect: Effect) -> dict[str, Any]:
    """An [[effects]] block of robot.toml."""
    values = found.parameters(diagnosis.temper, effect)
    told = {
        _key(n): {"value": _round(v), "sd": _round(sd), "unit": unit}
        for n, (v, sd, unit) in values.items()
    }
    elements = effect.elements(found.misfit.setting.simulation, values)
    lists = {
        name: [{k: _rounded(v) for k, v in block.items()} for block in blocks]
        for name, blocks in elements.items()
    }
    probability = _round(accepted.probability)
    whole = {"effect": effect.name, "at": effect.at, "probability": probability}
    return {**whole, "parameters": told, **lists}


def _bearings(diagnosis: Diagnosis, found: Fit) -> tuple[dict[str, Any], ...]:
    """An [[effects]] block of what bearings give, which is no finding, where the fit has them."""
    stated = len(diagnosis.problem.simulation.robot.config.compliance)
    elasticity = found.misfit.parametrisation.elasticity(found.x[: found.misfit.split[0]])
    blocks = [
        {
            "joint": block.joint,
            "axis": [_round(a) for a in block.axis],
            "tie": block.tie,
            **{kind: _round(float(getattr(elasticity, kind)[i])) for kind in KINDS[:2]},
        }
        for i, block in enumerate(found.misfit.setting.simulation.robot.config.compliance)
        if i >= stated and is_slight(block)
    ]
    return ({"effect": "slight_bearings", "at": "joints", "compliance": blocks},) if blocks else ()


def _toml(robot: Robot, changes: _Changes, urdf: str) -> str:
    document = tomlkit.parse(robot.path.read_text(encoding="utf-8-sig"))
    document["urdf"] = urdf
    drop_stated_inertias(document)
    listed: Any = document["compliance"]
    for block, values in zip(listed, changes.springs, strict=True):
        for kind, value in values.items():
            entry = entry_of(kind, block)
            if value or entry in block:
                block[entry] = value
    effects: Any = document.get("effects", tomlkit.aot())
    for values in changes.effects:
        entry = tomlkit.table()
        entry |= values
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
