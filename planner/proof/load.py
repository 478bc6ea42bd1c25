"""The true robot of a robot folder: reads URDF and robot.toml itself and builds MuJoCo's model."""

import tomllib
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.proof.deviation import Deviation
from planner.proof.mechanics import ENGINES
from planner.proof.model import Truth
from planner.proof.parts import Builder
from planner.proof.springs import check, springs


def load_truth(
    robot_toml: Path, deviation: Deviation | None = None, engine: str = "mujoco"
) -> Truth:
    """The true robot behind a robot folder, by one of ENGINES.

    Raises InputError without MuJoCo, and where the folder cannot be read or does not fit together.
    """
    deviation = deviation or Deviation()
    table, root = _read(robot_toml)
    check(table, root, deviation, robot_toml)
    rng = np.random.default_rng(deviation.seed)
    found, own = springs(table, root, deviation, rng)
    builder = Builder(root, table, found, deviation, rng)
    try:
        mechanics = ENGINES[engine](builder.parts, table.get("gravity", (0.0, 0.0, -9.81)))
    except ImportError:
        raise InputError(
            "Simulated recordings need MuJoCo; install it with: pip install 'planner[truth]'"
        ) from None
    held = [mechanics.names.index(name) for name in builder.joint_names]
    elastic = [mechanics.names.index(f"spring_{i}") for i in range(len(found))]
    lower, upper = np.array(builder.limits).T
    return Truth(
        table["name"],
        tuple(builder.joint_names),
        found,
        deviation,
        f"{mechanics.version}, seed {deviation.seed}",
        lower,
        upper,
        mechanics,
        np.array(held),
        np.array(elastic),
        own,
        bool(table.get("geometric_stiffness", True)),
        len(table["compliance"]),
        slides=tuple(builder.slides),
        sensor_mass_kg={p["name"]: p["mass_kg"] for p in table.get("point", ()) if "mass_kg" in p},
    )


def _read(robot_toml: Path) -> tuple[dict, ElementTree.Element]:
    try:
        table = tomllib.loads(robot_toml.read_text(encoding="utf-8-sig"))
        root = ElementTree.parse(robot_toml.parent / table["urdf"]).getroot()
    except (OSError, ValueError, KeyError, ElementTree.ParseError) as error:
        raise InputError(
            f"{robot_toml} or its URDF cannot be read ({error!r}); correct it."
        ) from None
    return table, root
