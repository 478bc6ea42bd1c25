"""Where the meshes that a URDF names are: one resolver for collision, drawings and copies."""

import glob
import os
import re
import shutil
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

PACKAGE_FILE = "package.xml"


def find_mesh(urdf: Path, name: str) -> Path | None:
    """The file of a mesh as a URDF names it (package://, file://, relative); None if missing.

    A package is a folder of that name above the URDF or beside a folder above it, or the one whose
    package.xml says so there, or on ROS_PACKAGE_PATH or AMENT_PREFIX_PATH. At last the file is
    looked for by the end of its name, the longest first, under any folder above the URDF: folders
    get renamed.
    """
    return next((place for place in _places(urdf.absolute(), name) if _has_content(place)), None)


def find_package(urdf: Path, name: str) -> Path | None:
    """The folder of a package as a URDF names it; None if missing."""
    return next((p for p in _packages(urdf.absolute(), name) if p.is_dir()), None)


def _places(urdf: Path, name: str) -> Iterator[Path]:
    parts, above = _parts(name), urdf.parents
    if not parts:
        return
    scheme, _, path = name.rpartition("://")
    if scheme in ("", "file"):
        yield urdf.parent / path
        yield from (folder.joinpath(*parts) for folder in above)
    else:
        yield from (folder.joinpath(*parts[1:]) for folder in _packages(urdf, parts[0]))
    for start in range(1, len(parts)):
        yield from (folder.joinpath(*parts[start:]) for folder in above)


def _packages(urdf: Path, name: str) -> Iterator[Path]:
    """Folders that a package of this name may be."""
    yield from (folder / name for folder in urdf.parents)
    yield from (*_named(urdf.parent, name), *_on_paths(name))


def _parts(name: str) -> tuple[str, ...]:
    """Steps of a mesh's path below what a package or a root is, without steps upwards."""
    path = re.sub(r"^\w+://", "", name).replace("\\", "/")
    return tuple(part for part in path.split("/") if part not in ("", ".", ".."))


@lru_cache(maxsize=256)
def _named(folder: Path, package: str) -> tuple[Path, ...]:
    """Packages of this name, by package.xml, among those that `folder` is in and beside them."""
    own = [above for above in (folder, *folder.parents) if (above / PACKAGE_FILE).is_file()]
    beside = [child for above in own for child in _children(above.parent)]
    return tuple(place for place in (*own, *beside) if _package_name(place) == package)


def _children(folder: Path) -> list[Path]:
    try:
        return sorted(child for child in folder.iterdir() if child.is_dir())
    except OSError:
        return []


def _package_name(folder: Path) -> str:
    try:
        text = (folder / PACKAGE_FILE).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    found = re.search(r"<name>\s*([^<\s]+)\s*</name>", text)
    return found[1] if found else ""


def _on_paths(package: str) -> list[Path]:
    """Folders of a package in ROS's workspaces."""
    found = []
    for place in _listed("ROS_PACKAGE_PATH"):
        found += [place] if package in (place.name, _package_name(place)) else []
        found += [place / package, *place.glob(f"*/{glob.escape(package)}")]
    return found + [place / "share" / package for place in _listed("AMENT_PREFIX_PATH")]


def _listed(variable: str) -> list[Path]:
    return [Path(p) for p in os.environ.get(variable, "").split(os.pathsep) if p]


def _has_content(path: Path) -> bool:
    try:
        return path.is_file() and path.stat().st_size > 0
    except (OSError, ValueError):  # a name that no file can have
        return False


def copy_meshes(text: bytes | str, urdf: Path, target: Path) -> None:
    """Copy the meshes that a URDF's text names to below the folder of its copy at `target`.

    They are found from there by the same names. Nothing that exists is overwritten.
    """
    for mesh in ElementTree.fromstring(text).iter("mesh"):
        name = mesh.get("filename", "")
        found, copy = find_mesh(urdf, name), target.parent.joinpath(*_parts(name))
        if found is not None and not copy.exists():
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(found, copy)
