"""An identified robot as a folder: robot.toml, whose comments and order stay, and its URDF."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import msgspec
import numpy as np
import tomlkit

from planner.errors import InputError
from planner.fit.result import Identification
from planner.robot.config import Compliance, OuterHalf, Payload, entry_of
from planner.robot.elastic_model import ElasticModel
from planner.robot.joint_laws import LawTable
from planner.robot.mesh_files import copy_meshes
from planner.robot.robot import Robot
from planner.robot.urdf_inertias import outer_halves, with_inertias
from planner.words import listed

INERTIAL_ENTRIES = "mass_kg", "centre_m", "inertia_kg_m2"  # of [[link]]
FOUND = "resonator", "harmonic"  # blocks that an identification may add
DIGITS = 6  # significant ones: more than any identification knows


def updated_toml(
    text: str,
    result: Identification,
    urdf: str | None = None,
    added: Sequence[Compliance] = (),
    laws: Sequence[LawTable] = (),
    payload: Sequence[Payload] = (),
    halves: Mapping[str, OuterHalf] = MappingProxyType({}),
) -> str:
    """The robot.toml `text` with the [[compliance]] blocks' numbers (and its urdf) replaced.

    A new `urdf` is one of `with_inertias`, which has what [[link]] states in it; so are `payload`s
    in the stead of those in the text, and outer `halves` by the links that bend.
    `added` blocks, which the identification counts last, follow those in the text, and so do
    resonators and harmonics that it found; those in the text take its numbers. `laws` replace
    those stated for their joints, and bring the pulse of the hits that told them.
    """
    document = tomlkit.parse(text)
    springs, blocks = document["compliance"], _stated(document, "compliance")
    for block in added:
        table = tomlkit.table()
        table.update(joint=block.joint, axis=list(block.axis), stiffness=0.0, damping=0.0)
        if block.slide:
            table["slide"] = True
        for key in ("height_m", "lever_m"):
            if getattr(block, key):
                table[key] = float(f"{getattr(block, key):.{DIGITS}g}")
        if block.tie:
            table["tie"] = block.tie
        springs.append(table)
        blocks.append(table)
    for estimate in result.estimates:
        for number in estimate.blocks:
            at = entry_of(estimate.kind, blocks[number])
            blocks[number][at] = float(f"{estimate.value:.{DIGITS}g}")
    found = {kind: getattr(result.simulation.robot.config, kind) for kind in FOUND}
    for kind, values in {"payload": payload, **found}.items():
        stated = _stated(document, kind)
        for number, block in enumerate(values):
            table = stated[number] if number < len(stated) else tomlkit.table()
            table.update(msgspec.to_builtins(block))
            if number >= len(stated):
                document.setdefault(kind, tomlkit.aot()).append(table)
    if laws:
        _state_laws(document, laws, result.simulation.robot.config.hammer.pulse_ms)
    if urdf is not None:
        document["urdf"] = urdf
        drop_stated_inertias(document)
    _state_halves(document, halves)
    return tomlkit.dumps(document)


def _stated(document: tomlkit.TOMLDocument, kind: str) -> list:
    """Blocks of a kind, those of [[effects]] after the robot's own."""
    within = (b for e in document.get("effects", ()) for b in e.get(kind, ()))
    return [*document.get(kind, ()), *within]


def _state_laws(document: tomlkit.TOMLDocument, laws: Sequence[LawTable], pulse_ms: float) -> None:
    joints = {law.joint for law in laws}
    stated = [block for block in document.get("law", ()) if block["joint"] not in joints]
    document.pop("law", None)
    document["law"] = tomlkit.aot()
    for block in (*stated, *map(msgspec.to_builtins, laws)):
        table = tomlkit.table()
        table.update(block)
        table.add(tomlkit.nl())
        document["law"].append(table)
    document.setdefault("hammer", tomlkit.table())["pulse_ms"] = float(f"{pulse_ms:.3g}")


def _state_halves(document: tomlkit.TOMLDocument, halves: Mapping[str, OuterHalf]) -> None:
    links = {block["link"]: block for block in document.get("link", ())}
    for link, half in halves.items():
        if link not in links:
            links[link] = tomlkit.table()
            links[link]["link"] = link
            document.setdefault("link", tomlkit.aot()).append(links[link])
        inline = tomlkit.inline_table()
        inline.update(msgspec.to_builtins(half))
        links[link]["outer_half"] = inline


def drop_stated_inertias(document: tomlkit.TOMLDocument) -> None:
    """Leave of [[link]] only how sure it is: the URDF has its numbers now."""
    blocks = document.get("link", [])
    for number in reversed(range(len(blocks))):
        for entry in INERTIAL_ENTRIES:
            blocks[number].pop(entry, None)
        if blocks[number].keys() <= {"link", "guessed"}:  # which states nothing
            del blocks[number]


@dataclass(frozen=True)
class Written:
    """Files of an identified robot, absolute, and what they leave out."""

    robot_toml: Path
    urdf: Path
    remarks: tuple[str, ...]


def check_target(out: Path, robot: Robot) -> None:
    """InputError where `out` cannot be written without losing something."""
    if out.exists() or out.is_symlink():
        raise InputError(f"{out} exists already; name a new file, so that nothing is lost.")
    if out.suffix != ".toml":
        raise InputError(f"{out} does not end in .toml; name a robot.toml to write.")
    folder = next(p for p in (out.absolute().parent, *out.absolute().parents) if p.exists())
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder; {out} cannot be written there, name another.")


def write_robot(
    out: Path, robot: Robot, result: Identification, laws: Sequence[LawTable] = ()
) -> Written:
    """Write robot.toml at `out`, with `laws` that were found, and its URDF where it is another.

    It is another where inertias were identified too (springs alone would fit worse than before),
    or where the folder is another. Nothing that exists is overwritten; InputError instead.
    """
    check_target(out, robot)
    out, bodies = out.absolute(), result.simulation.elastic.bodies
    change = result.simulation.elastic.inertia - ElasticModel(robot).inertia
    elsewhere = out.parent.resolve() != robot.path.parent.resolve()
    urdf, name, payload, unchanged = robot.urdf_path, None, robot.config.payload, ()
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        if elsewhere or np.any(change):
            name = robot.urdf_path.name if elsewhere else f"{out.stem}.urdf"
            urdf = out.parent / name
            text, payload, unchanged = with_inertias(robot, bodies, change)
            _write_new(urdf, text)
            if elsewhere:
                copy_meshes(text, robot.urdf_path, urdf)
        stated = robot.path.read_text(encoding="utf-8-sig")
        inside = sum(len(e.compliance) for e in robot.config.effects)
        added = robot.config.compliance[len(tomlkit.parse(stated)["compliance"]) + inside :]
        halves = outer_halves(robot, result.simulation.elastic, unchanged)
        _write_new(out, updated_toml(stated, result, name, added, laws, payload, halves))
    except OSError as error:
        raise InputError(
            f"{out} cannot be written ({error.strerror}); name another file with --out."
        ) from None
    return Written(out, urdf, _impossible(unchanged))


def _impossible(unchanged: Sequence[str]) -> tuple[str, ...]:
    """What became of inertias that no body of matter can have; nothing where there are none."""
    if not unchanged:
        return ()
    return (
        f"What turns with {listed(unchanged)} has the inertia that is stated, as no body can have "
        f"the identified one (moments below 0, or against the triangle inequality): the written "
        f"robot fits less well than what was found; correct the URDF's masses and moments there.",
    )


def _write_new(path: Path, text: str) -> None:
    if path.exists():
        raise InputError(f"{path} exists already; name another file or folder with --out.")
    with open(path, "x", encoding="utf-8") as file:
        file.write(text)
