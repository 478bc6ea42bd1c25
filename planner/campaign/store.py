"""What a campaign folder holds besides its log: the robot folder and the raw recordings."""

import glob
import os
import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import tomlkit
from tomlkit.exceptions import TOMLKitError

from planner import content_hash, file_content
from planner.campaign.config import load_campaign_config
from planner.campaign.events import Configured, HitRecord
from planner.campaign.journal import Journal, sync_folder, write_synced
from planner.campaign.state import Measurement
from planner.dataset.screened_files import Source
from planner.dataset.store import Store
from planner.errors import InputError
from planner.recording.points import StatedPoints
from planner.robot.mesh_files import urdf_source
from planner.toml_file import read_toml_text

if TYPE_CHECKING:
    from planner.campaign.cell import Cell
    from planner.dataset.hit_columns import Correction, PoseHits

LOG = "log.jsonl"
CONFIG = "campaign.toml"
ROBOT = "robot"
RECORDINGS = "recordings"
MAX_FILE_BYTES = 512 * 1024 * 1024

T = TypeVar("T")


def is_campaign(path: Path) -> bool:
    """Whether a path is a campaign's folder, be it damaged."""
    return any((path / name).exists() for name in (LOG, CONFIG))


def store_recording(folder: Path, path: Path) -> Path:
    """Keep a recording under its content hash, and say where. Idempotent."""
    from planner.recording.read import content

    digest, suffix = recording_hash(path), "".join(path.suffixes[-2:]).lower()
    suffix = suffix if suffix.endswith(".gz") else path.suffix.lower()
    kept = recording_path(folder, digest, suffix)
    if not kept.exists():
        kept.parent.mkdir(exist_ok=True)
        write_synced(kept, content(path))
        file_content.remember(kept, file_content.mark(kept), digest)
    return kept


def recording_path(folder: Path, digest: str, suffix: str) -> Path:
    """Where the recording with this content hash is kept; InputError where that is no hash."""
    if not _is_hash(digest) or "/" in suffix or "\\" in suffix:
        raise InputError(f"{folder / LOG} names a recording {digest + suffix!r}, which is no hash.")
    return folder.joinpath(RECORDINGS, f"{digest}{suffix}")


def recording_hash(path: Path) -> str:
    """Hash of a recording with all that reading it takes, or InputError saying why not."""
    from planner.recording.read import digest

    return _unless_wrong(path, digest)


def _unless_wrong(path: Path, read: Callable[[Path], T]) -> T:
    """What reading a file gives, or InputError saying why not."""
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise InputError(
                f"{path} is larger than {MAX_FILE_BYTES >> 20} MiB, no single hit is; split it."
            )
        return read(path)
    except FileNotFoundError:
        raise InputError(f"{path} does not exist; check the path.") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}); check the file.") from None


def robot_hashes(folder: Path) -> dict[str, str]:
    """sha256 of each file of the campaign's robot folder, by relative path."""
    root = folder / ROBOT
    files = sorted(path for path in root.rglob("*") if path.is_file())
    return {path.relative_to(root).as_posix(): file_content.sha256(path) for path in files}


def keep_robot_files(folder: Path, hashes: dict[str, str]) -> None:
    """Keep each version of each robot file by content, so that replay can go back to it."""
    for name, digest in hashes.items():
        kept = folder / RECORDINGS / f"{digest}.robot"
        if not kept.exists():
            kept.parent.mkdir(exist_ok=True)
            write_synced(kept, file_content.read(folder / ROBOT / name))


def restore_robot(folder: Path, hashes: dict[str, str], target: Path) -> None:
    """Lay out in `target` the robot folder as it was when `hashes` were logged.

    Raises InputError where a file would lie outside it, is missing or has changed.
    """
    for name, digest in hashes.items():
        path = target / name
        inside = path.resolve().is_relative_to(target.resolve())
        if not inside or Path(name).is_absolute() or not _is_hash(digest):
            raise InputError(
                f"{folder / LOG} names {name!r} as a file of the robot folder, which it cannot "
                f"be; nothing is written there. The log is not one that planner wrote."
            )
        kept = folder / RECORDINGS / f"{digest}.robot"
        check_kept(kept, digest, f"the robot's {name}")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(file_content.read(kept))


def check_kept(kept: Path, digest: str, what: str) -> None:
    """InputError where a kept file is not as it was when it was kept."""
    if _unless_wrong(kept, file_content.sha256) != digest:
        raise InputError(f"{kept} is not what was kept as {what}; restore it from a copy.")


def _is_hash(text: str) -> bool:
    return len(text) == 64 and set(text) <= set("0123456789abcdef")


def create_folder(
    directory: Path,
    robot_toml: Path,
    campaign_toml: Path | None,
    first_event: Callable[[Path], Configured],
) -> None:
    """Make the campaign folder: robot folder copied in, campaign.toml taken over, log begun.

    The folder appears under its name only once it is whole.
    """
    directory = directory.absolute()
    if (directory / LOG).exists():
        raise InputError(f"{directory} already holds a campaign; choose another folder.")
    if directory.exists() and (not directory.is_dir() or any(directory.iterdir())):
        raise InputError(f"{directory} exists and is not empty; choose another folder.")
    partial = directory.with_name(f".{directory.name}.{os.getpid()}.part")
    try:
        directory.parent.mkdir(parents=True, exist_ok=True)
        _remove_left(directory)
        partial.mkdir()
        _copy_robot(robot_toml, partial / ROBOT)
        robot = f"{ROBOT}/{robot_toml.name}"
        if campaign_toml is not None:
            load_campaign_config(campaign_toml)  # says what is wrong with it
        text = _taken_over(campaign_toml, robot) if campaign_toml else _default(partial, robot)
        (partial / CONFIG).write_text(text, encoding="utf-8")
        write_synced(partial / LOG, b"")
        Journal(partial / LOG).append(first_event(partial))
        if directory.exists():
            directory.rmdir()
        os.replace(partial, directory)
        sync_folder(directory.parent)
    except InputError as error:  # in words that name the user's files, not the copies
        text = str(error)
        for copy in (partial, partial.resolve()):
            text = text.replace(str(copy / ROBOT), str(robot_toml.parent))
            text = text.replace(str(copy / CONFIG), str(campaign_toml or CONFIG))
        raise InputError(text) from None
    except OSError as error:
        raise InputError(
            f"{directory} cannot be made ({_why(error)}); choose another folder."
        ) from None
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _why(error: OSError) -> str:
    """In words; of a folder whose files cannot be copied, those of the first one."""
    if isinstance(error, shutil.Error):
        _, copy, reason = error.args[0][0]
        return f"{Path(copy).name}: {reason}"
    return error.strerror or type(error).__name__


def _remove_left(directory: Path) -> None:
    """Remove the halves of this campaign that were left by a `new` that was killed."""
    for left in directory.parent.glob(f".{glob.escape(directory.name)}.*.part"):
        process = left.name.split(".")[-2]
        if not (process.isdecimal() and _alive(int(process))) or int(process) == os.getpid():
            shutil.rmtree(left, ignore_errors=True)


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except OSError as error:
        return not isinstance(error, ProcessLookupError)
    return True


def _copy_robot(robot_toml: Path, target: Path) -> None:
    """Copy robot.toml, its URDF with the meshes that this names, and a cut.toml beside it.

    A URDF that lies elsewhere comes to lie beside robot.toml, and is expanded where it is xacro.
    """
    from planner.robot.mesh_files import copy_meshes
    from planner.robot.robot import Robot

    source, robot = robot_toml.parent.resolve(), Robot.load(robot_toml)
    urdf, named = robot.urdf_path, robot.config.urdf
    inside = urdf.relative_to(source) if urdf.is_relative_to(source) else Path(urdf.name)
    copy = target / inside
    if copy.suffix == ".xacro":
        copy = copy.with_name(f"{copy.name.split('.')[0]}.urdf")
    copy.parent.mkdir(parents=True)
    text = urdf_source(urdf)
    copy.write_bytes(text)
    copy_meshes(text, urdf, copy)
    for file in source.glob("*.toml"):
        if file.name != CONFIG:  # which the campaign has of its own
            shutil.copyfile(file, target / file.name)
    place = copy.relative_to(target).as_posix()
    if place != Path(named).as_posix():
        document = tomlkit.parse(robot_toml.read_text(encoding="utf-8-sig"))
        document["urdf"] = place
        (target / robot_toml.name).write_text(tomlkit.dumps(document), encoding="utf-8")


def _taken_over(campaign_toml: Path, robot: str) -> str:
    """The user's campaign.toml, comments and all, with the robot's new place."""
    try:
        document = tomlkit.parse(read_toml_text(campaign_toml, "campaign.toml"))
    except TOMLKitError as error:
        raise InputError(
            f"{campaign_toml} is not a valid campaign.toml ({error}); correct it."
        ) from None
    document["robot"] = robot
    return tomlkit.dumps(document)


def _default(directory: Path, robot_file: str) -> str:
    """A campaign.toml over the whole joint range, to be narrowed by the engineer."""
    from planner.robot.robot import Robot
    from planner.robot.workspace import ranges_inside

    robot = Robot.load(directory / robot_file)
    limits = ranges_inside(robot, robot.lower_rad, robot.upper_rad)
    said = "Whole range of every joint: narrow it to where the tool works."
    return campaign_text(said, robot_file, limits, {"band_hz": list(robot.config.band_hz)})


def campaign_text(said: str, robot: str, joints_deg: list[list[float]], modes: dict) -> str:
    """A campaign.toml for a workspace of which something is `said` in a comment."""
    tables = {"robot": robot, "workspace": {"joints_deg": joints_deg}, "modes": modes}
    return f"# {said}\n{tomlkit.dumps(tables)}"


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


@dataclass(frozen=True, eq=False)
class KeptRecordings:
    """Recordings by content hash in a campaign's folder, of a cell's robot."""

    directory: Path
    cell: "Cell"

    def source(self, hit: HitRecord) -> Source:
        """The kept copy of a recording; InputError where it is not what was imported."""
        stated = StatedPoints(hit.hit_point, hit.response_points, names=self.cell.robot.points)
        own = hit.hit, hit.repeat, stated, hit.part, hit.response, hit.from_name
        return Source(self._checked(hit), hit.file, *own)

    def _checked(self, hit: HitRecord) -> Path:
        path = recording_path(self.directory, hit.sha256, hit.suffix)
        check_kept(path, hit.sha256, hit.file)
        return path

    def look_through(self, measurements: Iterable[Measurement], found: Store) -> None:
        """InputError where one of the accepted recordings is not what was imported.

        Files that nobody has written since they were `found` whole are not read again.
        """
        key = content_hash.digest("recordings found whole", str(self.directory))
        before: dict[Path, file_content.Mark] = found.get(key, dict) or {}
        for path, mark in before.items():
            file_content.remember(path, mark, path.name[:64])
        hits = (hit for measurement in measurements for hit in measurement.accepted)
        now = {path: file_content.mark(path) for path in dict.fromkeys(map(self._checked, hits))}
        if now != before:
            found.put(key, now)

    def hits(self, measurement: Measurement, corrected: "Correction | None" = None) -> "PoseHits":
        """What the accepted hits of a measured pose say, each by itself and at all points."""
        from planner.dataset.hit_columns import hits_of

        table = self.cell.config.modes
        how = table.band_hz, table.window_rate_1_s
        return hits_of(tuple(map(self.source, measurement.accepted)), *how, corrected)
