"""A URDF's text (of xacro what it expands to), and where the meshes that it names are."""

import glob
import os
import re
import shutil
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from planner import file_content
from planner.errors import InputError

PACKAGE_FILE = "package.xml"


def find_mesh(urdf: Path, name: str) -> Path | None:
    """The file of a mesh as a URDF names it (package://, file://, relative); None if missing.

    A package is a folder of that name above the URDF or beside a folder above it, or the one whose
    package.xml says so there, or on ROS_PACKAGE_PATH or AMENT_PREFIX_PATH. At last the file is
    looked for by the end of its name, the longest first, under any folder above the URDF: folders
    get renamed.
    """
    return next((place for place in _places(urdf.absolute(), name) if _has_content(place)), None)


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


def urdf_source(urdf: Path) -> bytes:
    """The URDF's text. Raises OSError where it cannot be read, InputError for unexpanded xacro."""
    text = file_content.read(urdf)
    return _expanded(urdf) if urdf.suffix == ".xacro" or _is_xacro(text) else text


def _is_xacro(text: bytes) -> bool:
    """Whether elements of xacro are left, which a comment or a namespace alone is not."""
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError):
        return False
    return any("xacro" in str(element.tag).partition("}")[0] for element in root.iter())


def _expanded(urdf: Path) -> bytes:
    remedy = f"expand it first, with xacro {urdf.name} > robot.urdf, and name that."
    try:
        xacro = import_module("xacro")
    except ImportError:
        raise InputError(f"{urdf} is xacro, from which a URDF is made; {remedy}") from None
    try:
        with _finding_packages(urdf):
            return xacro.process_file(str(urdf)).toxml(encoding="utf-8")
    except Exception as error:  # whatever its macros raise
        why = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{urdf} is xacro, and could not be expanded ({why}); {remedy}") from None


@contextmanager
def _finding_packages(urdf: Path) -> Iterator[None]:
    """Let xacro's $(find …) look where meshes are looked for; in ROS it asks ROS itself."""
    name = "ament_index_python"
    if find_spec(name) is not None:
        yield
        return

    def folder(package: str) -> str:
        found = next((p for p in _packages(urdf.absolute(), package) if p.is_dir()), None)
        if found is None:
            raise LookupError(f"package {package} cannot be found")
        return str(found)

    index, packages = ModuleType(name), ModuleType(f"{name}.packages")
    packages.__dict__["get_package_share_directory"] = folder
    sys.modules |= {name: index, packages.__name__: packages}
    try:
        yield
    finally:
        del sys.modules[name], sys.modules[packages.__name__]
