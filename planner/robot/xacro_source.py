"""The text of a URDF; of a xacro file, from which URDFs are made, what it expands to."""

import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from planner import file_content
from planner.errors import InputError
from planner.robot.mesh_files import find_package


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
        found = find_package(urdf, package)
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
