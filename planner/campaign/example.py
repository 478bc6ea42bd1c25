"""Files of an own robot to begin with: commented TOML files and a URDF."""

import shutil
from pathlib import Path

from planner.errors import InputError

EXAMPLE = Path(__file__).parent.parent / "example"


def write_example(directory: Path) -> tuple[str, str, str, tuple[str, ...]]:
    """Write them into a folder that is new or empty.

    Returns:
        The folder, its robot.toml and campaign.toml, and all files, as absolute paths.
    """
    folder = directory.absolute()
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{directory} exists and is not empty; choose another folder.")
    try:
        shutil.copytree(EXAMPLE, folder, dirs_exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{directory} cannot be written ({error.strerror}); choose another folder."
        ) from None
    files = tuple(str(path) for path in sorted(folder.rglob("*")) if path.is_file())
    return str(folder), str(folder / "robot" / "robot.toml"), str(folder / "campaign.toml"), files
