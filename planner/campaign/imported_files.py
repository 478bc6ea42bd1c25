"""Files that are delivered: their poses, which are new, and why others are not imported."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from planner.campaign import store
from planner.campaign.events import REFUSED, REPLACED, HitRecord, Imported
from planner.campaign.state import CampaignState
from planner.dataset.screened_files import Source
from planner.dataset.visits import table_folders
from planner.errors import InputError
from planner.recording.folder import CHANNELS, TABLE, files_in, joint_columns, read_recordings
from planner.recording.joints import JointUnits
from planner.recording.points import ANYWHERE, StatedPoints
from planner.recording.read import READERS
from planner.recording.records import PoseRow
from planner.robot.robot import Robot
from planner.words import command


@dataclass(frozen=True)
class ImportedFiles:
    """Files of one pose; `joints_deg` is the readback, None where no table states it.

    `said`: somebody stated the pose, a table of recordings (it names its `row`) or who imports.
    """

    pose: str
    joints_deg: tuple[float, ...] | None
    sources: tuple[Source, ...]
    row: str = ""  # "file, row n" for messages
    said: bool = True


@dataclass(frozen=True)
class KnownFile:
    """A delivered file whose data are in use, or are held, and the file that brought them first."""

    file: str
    first: str

    @property
    def copied(self) -> bool:
        """Whether it is another file."""
        return Path(self.file).absolute() != Path(self.first).absolute()


def sort_paths(
    paths: tuple[Path, ...], robot: Robot | None, pose: str | None, default_pose: str | None
) -> tuple[ImportedFiles, ...]:
    """Deliveries by pose, in recording order, of a `robot` if one is known.

    A folder with recordings.csv says itself which pose a file belongs to (`pose` then picks one,
    or renames the only one), and so do its subfolders; a file that is named is what the table
    beside it says, if that lists it. Bare files belong to `pose` or, without it, to `default_pose`,
    "" where there is none. A table without joints is one of proposed poses.
    """
    deliveries: list[ImportedFiles] = []
    bare: list[Path] = []
    by_folder: dict[Path, list[Path]] = {}
    for path in paths:
        if path.exists() and (folders := table_folders(path)):
            deliveries += _from_tables(path, folders, robot, pose)
        elif path.is_dir():
            bare += files_in(path, READERS)
        elif path.is_file():
            if path.name != CHANNELS:
                by_folder.setdefault(path.parent, []).append(path)
        else:
            raise InputError(f"{path} does not exist; name recordings or a recordings folder.")
    for folder, files in by_folder.items():
        listed = _listed(folder, files, robot, pose)
        deliveries += listed
        told = {source.path.resolve() for one in listed for source in one.sources}
        bare += [file for file in files if file.resolve() not in told]
    if bare:
        stated = StatedPoints() if robot is None else StatedPoints(names=robot.points)
        sources = tuple(Source(path, str(path), stated=stated) for path in bare)
        name = pose or default_pose or ""
        deliveries.append(ImportedFiles(name, None, sources, said=pose is not None))
    return tuple(deliveries)


def _from_tables(
    path: Path, folders: tuple[Path, ...], robot: Robot | None, pose: str | None
) -> list[ImportedFiles]:
    """Deliveries of folders, each with a table of its own; `pose` picks one, or renames the only.

    Raises InputError where there is none of that name.
    """
    every = [d for folder in folders for d in _from_table(folder, robot)]
    found = [d for d in every if pose in (None, d.pose)]
    if pose is not None and not found and len(folders) == len(every) == 1:
        found = [replace(every[0], pose=pose)]
    if not found:
        names = list(dict.fromkeys(d.pose for d in every))
        where = folders[0] / TABLE if len(folders) == 1 else path
        raise InputError(f"{where} has no pose {pose}; its poses are {', '.join(names[:8])}.")
    return found


def _listed(
    folder: Path, files: Sequence[Path], robot: Robot | None, pose: str | None
) -> list[ImportedFiles]:
    """Those of some files that a folder's table lists, if it has one; of `pose` alone, if given."""
    table = folder / TABLE
    text = table.read_text(encoding="utf-8", errors="replace") if table.is_file() else ""
    named = {file.resolve() for file in files if file.name in text}
    if not named:
        return []
    found = [
        replace(one, sources=tuple(s for s in one.sources if s.path.resolve() in named))
        for one in _from_table(folder, robot)
        if pose in (None, one.pose)
    ]
    return [one for one in found if one.sources]


def _from_table(folder: Path, robot: Robot | None) -> list[ImportedFiles]:
    rows: dict[str, list[PoseRow]] = {}
    known = (joint_columns(folder), ANYWHERE) if robot is None else (robot.joints, robot.points)
    for row in read_recordings(folder, *known, bare=True):
        rows.setdefault(row.pose, []).append(row)
    return [
        ImportedFiles(
            name,
            group[0].joints_deg or None,
            tuple(Source.of(r) for r in group if r.file),
            f"{folder / TABLE}, row {group[0].row}",
        )
        for name, group in rows.items()
    ]


def record_of(source: Source, reason: str, digest: str | None = None) -> HitRecord:
    """What the log keeps of a file, and of what is said of it; for a `reason` it is refused.

    Without a `digest` it is of a kept file, whose name is its hash and its suffix.
    """
    name = source.path.name
    content = (name[:64], name[64:]) if digest is None else (digest, "")
    return HitRecord(
        source.name, *content, source.hit, source.repeat, not reason, reason,
        hit_point=source.stated.hit_point, response_points=source.stated.response_points,
        part=source.part, response=source.response, from_name=source.from_name,
    )  # fmt: skip


def at_their_poses(
    deliveries: tuple[ImportedFiles, ...], state: CampaignState
) -> tuple[ImportedFiles, ...]:
    """Files of which nobody says the pose go where they were imported before, if they were.

    Raises InputError where it is not clear at which pose the others were recorded.
    """
    known = state.in_use
    found: list[ImportedFiles] = []
    for delivery in deliveries:
        if delivery.said:
            found.append(delivery)
            continue
        poses: dict[str, list[Source]] = {}
        for source in delivery.sources:
            at, _ = known.get(_digest(source), (delivery.pose, None))
            poses.setdefault(at, []).append(source)
        if "" in poses:
            raise InputError(
                f"{poses[''][0].path}: it is not clear at which pose it was recorded; say "
                f"--pose ID."
            )
        found += [replace(delivery, pose=p, sources=tuple(s)) for p, s in poses.items()]
    return tuple(found)


def new_files(
    directory: Path, delivery: ImportedFiles, state: CampaignState, named: frozenset[Path]
) -> tuple[tuple[Source, ...], tuple[KnownFile, ...], tuple[HitRecord, ...]]:
    """Keep the raw files; each hit of those new, those in use at this pose, and those left out.

    A file that the engineer refused, or that was shown at another pose, is new only where it is
    itself among the `named` paths or its table says so; one that cannot be read is left out, as is
    a recording that is in use at another pose. Raises InputError where all are.
    """
    pose, known, in_use = delivery.pose, state.measurements.get(delivery.pose), state.in_use
    withdrawn = ""
    if known is not None and known.withdrawn:
        again = command("planner", "confirm", directory, pose)
        withdrawn = f"{pose} was withdrawn; to use its hits again: {again}; else give the "
        withdrawn += "new measurement another pose name, in recordings.csv or by --pose"
    fresh: list[Source] = []
    already, left_out, elsewhere = [], [], []
    seen: dict[str, str] = {}
    for source in delivery.sources:
        try:
            digest = store.recording_hash(source.path)
        except InputError as error:  # one bad file does not keep the others out
            left_out.append(record_of(source, str(error), ""))
            continue
        at, hit = in_use.get(digest, (pose, None))
        if hit is not None and at != pose:
            reason = _of_another(directory, hit, at, pose)
            if len(delivery.sources) == 1 + len(elsewhere):
                raise InputError(f"{source.path}: {reason}.")
            elsewhere.append(record_of(source, reason, digest))
        elif reason := withdrawn or _reason_against(delivery, source, digest, named, state):
            left_out.append(record_of(source, reason, digest))
        elif hit is not None or (digest in seen and not source.part):
            already.append(KnownFile(source.name, hit.whole_name if hit else seen[digest]))
        else:
            seen.setdefault(digest, source.name)
            kept = store.store_recording(directory, source.path)
            fresh += replace(source, path=kept).parts()
    return tuple(fresh), tuple(already), (*left_out, *elsewhere)


def _of_another(directory: Path, hit: HitRecord, at: str, pose: str) -> str:
    """Why a recording that is in use at one pose cannot belong to another."""
    back = command("planner", "withdraw", directory, at)
    return (
        f"the same data are in use as {hit.whole_name} of pose {at}; put what was recorded at "
        f"{pose} here, or, if this was, take back what was imported there ({back}) and import "
        f"both again"
    )


def superseded(before: Sequence[HitRecord], sources: Sequence[Source]) -> tuple[HitRecord, ...]:
    """Which hits of a pose newer files take the place of."""
    return tuple(hit for hit in before if any(_replaces(source, hit) for source in sources))


def _replaces(source: Source, hit: HitRecord) -> bool:
    """Whether it is written over, or of the same name for the same axis and repeat of a table."""
    if source.hit is None or source.repeat is None:
        return source.whole_name == hit.whole_name
    same = (source.hit, source.repeat) == (hit.hit, hit.repeat)
    return same and Path(source.whole_name).name == Path(hit.whole_name).name


def differs_from_table(source: Source, record: HitRecord) -> bool:
    """Whether a table says something else of a file now than when it was judged."""
    points = source.stated.hit_point, source.stated.response_points, source.response
    known = record.hit_point, record.response_points, record.response
    return points != known or (source.hit is not None and source.hit != (record.hit or ""))


def replaced_hits(
    delivery: ImportedFiles, held: Imported, joints: JointUnits
) -> tuple[HitRecord, ...] | None:
    """Files of a held import that a delivery brings anew, to be judged again; None: it does not.

    It does where a table says something else of one of them, or of the pose's joints, where one has
    other content now, or where all are said to be of another pose. Those given are the held hits
    that the delivery lacks.
    """
    brought = {_digest(source): source for source in delivery.sources}
    lacking = [hit for hit in held.hits if hit.sha256 not in brought]
    if delivery.pose != held.pose:
        return () if delivery.said and not lacking else None
    both = ((brought[hit.sha256], hit) for hit in held.hits if hit.sha256 in brought)
    gone = superseded(lacking, delivery.sources)
    stood = delivery.joints_deg
    moved = stood is not None and joints.apart(held.joints_deg, stood)
    anew = gone or moved or any(differs_from_table(*one) for one in both)
    return tuple(hit for hit in lacking if hit not in gone) if anew else None


def _digest(source: Source) -> str:
    """Content hash; "" where the file cannot be read."""
    try:
        return store.recording_hash(source.path)
    except InputError:
        return ""


def _reason_against(
    delivery: ImportedFiles,
    source: Source,
    digest: str,
    named: frozenset[Path],
    state: CampaignState,
) -> str:
    """Why a file is not imported; empty: it is, or it is in use."""
    pose, known = delivery.pose, state.measurements.get(delivery.pose)
    held, by_itself = state.held.get(pose), source.path in named
    before = [h for h in (known.hits if known else ()) if h.sha256 == digest]
    if any(hit.accepted for hit in before):
        return ""
    if not by_itself and (
        gone := [hit.reason for hit in before if hit.reason.startswith(REPLACED)]
    ):
        return f"{gone[0]}; to use it again, name the file itself"
    if held is not None:
        if any(hit.sha256 == digest for hit in held.hits):
            return ""
        return f"hits of {pose} wait for an answer: {held.question.text if held.question else ''}"
    certain = bool(delivery.row) or (delivery.said and by_itself)
    shown = state.came(digest, pose)
    if shown != pose and not certain:
        return (
            f"it came at {shown}, and nobody said that it is of {pose}; to import it there, name "
            f"the file itself and --pose {pose}"
        )
    if digest in state.refused:
        at, record = state.refused[digest]
        elsewhere = delivery.said and at != pose
        # Where the record has no axis, not even "", nobody kept what was said of the file then.
        otherwise = record.hit is not None and differs_from_table(source, record)
        if not (by_itself or elsewhere or otherwise):
            return f"{REFUSED} before; to import it all the same, name the file itself"
    return "" if delivery.said else _refused_elsewhere(pose, digest, state)


def _refused_elsewhere(pose: str, digest: str, state: CampaignState) -> str:
    """What is said of a file that was refused at another pose, where nobody says its pose."""
    for measurement in state.measurements.values():
        for hit in measurement.hits if measurement.pose != pose else ():
            if hit.sha256 == digest and not hit.accepted:
                return (
                    f"refused at {measurement.pose} before: {hit.reason.rstrip('.')}; to have it "
                    f"judged at {pose}, say --pose {pose}"
                )
    return ""
