"""Tables beside recordings: recordings.csv, predict.csv, and how all such tables are read."""

import csv
import io
import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.recording.column_names import hit_direction
from planner.recording.joints import AxisColumn, JointUnits
from planner.recording.points import PointNames, StatedPoints
from planner.recording.records import PoseRow
from planner.recording.text_tables import decoded

TABLE = "recordings.csv"
CHANNELS = "channels.csv"  # scales and units of WAV files
TABLES = (TABLE, CHANNELS)
MAX_BYTES = 32 * 1024 * 1024
MAX_ROWS = 200_000
NEEDED = {"pose": "a name such as P001", "hit": "along which axis it was hit, such as +x",
          "file": "the recording's file"}  # fmt: skip
ANGLE, SLIDE = "_deg", "_mm"
ANGLE_LIKE = re.compile(r"deg|rad$|°|_mm$|angle|joint|axis|^[AEJ]\d", re.IGNORECASE)


def several_poses(paths: list[Path], least: int = 2) -> bool:
    """Whether a single folder is named whose recordings.csv lists that many poses at least."""
    if len(paths) != 1 or not (paths[0] / TABLE).is_file():
        return False
    header, rows = read_table(paths[0] / TABLE)
    # A table without poses is refused where it is read in earnest.
    return "pose" not in header or len({row.cell("pose") for row in rows}) >= least


def joint_columns(folder: Path) -> JointUnits:
    """The joints as the table's columns `…_deg` and `…_mm` name them, where no robot is named."""
    header, _ = read_table(folder / TABLE)
    columns = [name for name in header if name.endswith((ANGLE, SLIDE))]
    names = tuple(name.removesuffix(ANGLE).removesuffix(SLIDE) for name in columns)
    return JointUnits(names, tuple(name.endswith(SLIDE) for name in columns))


def read_recordings(
    folder: Path,
    joints: JointUnits | Sequence[str],
    points: PointNames | None = None,
    bare: bool = False,
) -> tuple[PoseRow, ...]:
    """Rows of a recordings folder's table, in recording order; the robot's `joints` and `points`.

    A `bare` table may have no column of joints at all, under whatever name, where poses alone tell
    how the robot stood: its rows then hold none.
    Raises InputError naming file, row and remedy.
    """
    points = points or PointNames()
    path = folder / TABLE
    header, lines = read_table(path)
    units = JointUnits.of(joints)
    told = not bare or (units.names and any(map(ANGLE_LIKE.search, header)))
    columns = _joint_columns(path, header, units) if told else ()
    for name, what in NEEDED.items():
        if name not in header:
            raise InputError(f"{path} has no column {name}; add it: in each row {what}.")
    inside = folder.resolve()
    rows: list[PoseRow] = []
    seen: dict[tuple[object, ...], int] = {}
    for line in lines:
        row = _recording_row(line, inside, columns, points)
        points_hit = row.stated.hit_point, row.stated.response_points
        key = row.pose, row.hit, row.response, *points_hit, row.repeat or 0
        if row.repeat is not None and key in seen:
            raise line.wrong(
                f"pose {row.pose}, hit {row.hit}, repeat {row.repeat} is listed in row {seen[key]} "
                f"already; number the repeats."
            )
        seen[key] = line.number
        rows.append(row)
    if columns:
        _same_angles(path, rows, units)
    return _one_row_a_file(path, rows)


def read_poses(path: Path, joints: JointUnits | Sequence[str]) -> tuple[PoseRow, ...]:
    """Poses at which a prediction is wanted. Raises InputError naming file, row and remedy."""
    header, lines = read_table(path)
    columns = _joint_columns(path, header, JointUnits.of(joints))
    if "pose" not in header:
        raise InputError(f"{path} has no column pose; add one that names each row.")
    rows: list[PoseRow] = []
    seen: dict[str, int] = {}
    for line in lines:
        pose = line.pose
        if pose in seen:
            raise line.wrong(f"pose {pose} stands in row {seen[pose]} already; rename one of them.")
        seen[pose] = line.number
        force = line.value("peak_force_n") if line.cell("peak_force_n") else None
        if force is not None and not force > 0:
            raise line.wrong(
                f"peak_force_n is {force:g}; give a force above 0 N, or leave the cell empty."
            )
        rows.append(PoseRow(pose, line.angles(columns), line.number, peak_force_n=force))
    return tuple(rows)


def peak_forces(rows: Sequence[PoseRow], others_n: float | None = None) -> np.ndarray:
    """(n,) in N at which predictions are wanted; `others_n`, else NaN, where none is stated."""
    return np.array([row.peak_force_n or others_n or np.nan for row in rows])


def files_in(folder: Path, suffixes: Collection[str]) -> list[Path]:
    """Files of a folder without a table, by name; of its subfolders those with known `suffixes`.

    Raises InputError if there are none.
    """
    found = [
        path for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in TABLES and shown(path, folder)
        and (path.parent == folder or path.suffix.lower() in suffixes)
    ]  # fmt: skip
    if not found:
        raise InputError(f"{folder} holds no recordings; name a folder that does.")
    return found


def shown(path: Path, folder: Path) -> bool:
    """Whether neither a path in a folder nor what it lies in there is hidden."""
    return not any(part[0] == "." for part in path.relative_to(folder).parts)


def read_table(path: Path, text: str | None = None) -> tuple[list[str], list["TableRow"]]:
    """Header and rows of a table, or of a text that messages call `path`.

    Raises InputError for what is wrong.
    """
    text = decoded(path, MAX_BYTES) if text is None else text
    first = text.split("\n", 1)[0]
    delimiter = next((d for d in (",", ";", "\t") if d in first), ",")
    try:
        table = list(csv.reader(io.StringIO(text, newline=""), delimiter=delimiter))
    except csv.Error as error:
        raise InputError(f"{path} is no readable CSV table ({error}); export it again.") from None
    numbered = [(i, row) for i, row in enumerate(table, 1) if any(c.strip() for c in row)]
    if not numbered:
        raise InputError(f"{path} is empty; it needs a header and a row per hit or pose.")
    header = [name.strip() for name in numbered[0][1]]
    twice = next((name for name in header if header.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"{path}: column {twice or 'without a name'} stands twice; remove one.")
    if len(numbered) == 1:
        raise InputError(f"{path} has a header and no rows; add the rows.")
    if len(numbered) > MAX_ROWS:
        raise InputError(f"{path} has more than {MAX_ROWS} rows; split it.")
    for number, row in numbered[1:]:
        if len(row) != len(header):
            raise InputError(
                f"{path}, row {number}: {len(row)} cells, the header has {len(header)}; "
                f"correct the row."
            )
    return header, [TableRow(path, n, dict(zip(header, v, strict=True))) for n, v in numbered[1:]]


def _joint_columns(path: Path, header: list[str], joints: JointUnits) -> tuple[AxisColumn, ...]:
    """The joints' columns in the robot's order: by their names, or by the controller's axes."""
    own = tuple(AxisColumn(name) for name in joints.columns)
    kinds = (own, joints.axes) if joints.axes else (own,)
    lacking = {kind: [c.name for c in kind if c.name not in header] for kind in kinds}
    found = min(kinds, key=lambda kind: len(lacking[kind]))
    wanted = [column.name for column in found]
    if lacking[found]:
        near = [name for name in header if ANGLE_LIKE.search(name) and name not in wanted]
        seen = f" and has {', '.join(near)}" if near else ""
        raise InputError(
            f"{path} has no column {lacking[found][0]}{seen}; the robot's joints are "
            f"{', '.join(wanted)}: {'rename, or ' if near else ''}add what is missing."
        )
    slides = (SLIDE,) if any(joints.slides) else ()
    ends = (ANGLE, "_rad", *slides)
    extra = [n for n in header if n.endswith(ends) and n not in wanted]
    if extra:
        raise InputError(
            f"{path} has a column {extra[0]} that is no joint of the robot; remove or rename it."
        )
    return found


@dataclass(frozen=True)
class TableRow:
    """A row of a table: its line in the file, and its cells by column."""

    path: Path
    number: int
    cells: dict[str, str]

    def wrong(self, text: str) -> InputError:
        """An error that names the row."""
        return InputError(f"{self.path}, row {self.number}: {text}")

    def cell(self, column: str) -> str:
        """ "" where there is no such column."""
        return self.cells.get(column, "").strip()

    @property
    def pose(self) -> str:
        pose = self.cell("pose")
        if not pose or len(pose) > 100 or any(ord(c) < 32 for c in pose):
            raise self.wrong("the pose has no usable name; give it one.")
        return pose

    def angles(self, columns: Sequence[AxisColumn]) -> tuple[float, ...]:
        return tuple(c.stated(self.value(c.name)) for c in columns)

    def value(self, column: str) -> float:
        try:
            value = float(self.cell(column).replace(",", "."))  # decimals of half the spreadsheets
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or abs(value) > 1e5:
            unit = "millimetres" if column.endswith(SLIDE) else "degrees"
            raise self.wrong(
                f'{column} is "{self.cell(column)}", not a number; correct it (decimal point, '
                f"{unit})."
            )
        return value

    def signed_axis(self, column: str, frame: str) -> str:
        axis = self.cell(column).lower()
        if not hit_direction(axis):
            raise self.wrong(
                f'{column} is "{self.cell(column)}"; give a signed axis of the {frame} frame such '
                f"as +x."
            )
        return axis if axis[0] in "+-" else f"+{axis}"

    def file(self, folder: Path) -> Path:
        name = self.cell("file")
        if not name:
            raise self.wrong("no file is named; add it.")
        try:
            file = (folder / name).resolve()
            inside = file.is_relative_to(folder)
            found = inside and file.is_file()
        except (OSError, ValueError, RuntimeError):  # RuntimeError: links that lead to themselves
            raise self.wrong(f"{name!r} is no file name; correct it.") from None
        if not inside:
            raise self.wrong(f"{name} lies outside the recordings folder; move it inside.")
        if not found:
            raise self.wrong(f"{name} does not exist; correct the file name.")
        return file

    def points(self, names: PointNames) -> StatedPoints:
        """The points that it names."""
        hit_point, responses = self.cell("hit_point"), tuple(self.cell("response_points").split())
        named = [("hit_point", hit_point), *(("response_points", name) for name in responses)]
        for column, name in named:
            if name and not names.anywhere and name not in names.known:
                raise self.wrong(
                    f'{column} names "{name}", which is none of robot.toml\'s points '
                    f"({', '.join(names.known)}); correct it, or add a [[point]]."
                )
        twice = next((name for name in responses if responses.count(name) > 1), None)
        if twice:
            raise self.wrong(f"response_points names {twice} twice; name each point once.")
        if not hit_point and not responses and names == PointNames():
            return StatedPoints()
        return StatedPoints(hit_point, responses, self.number, names)


def _recording_row(
    row: TableRow, folder: Path, columns: Sequence[AxisColumn], points: PointNames
) -> PoseRow:
    response = row.signed_axis("response", "sensor") if row.cell("response") else None
    repeat = row.value("repeat") if row.cell("repeat") else None
    if repeat is not None and (repeat != int(repeat) or repeat < 0):
        raise row.wrong(f"repeat is {repeat:g}; give a whole number.")
    return PoseRow(
        row.pose,
        row.angles(columns),
        row.number,
        row.signed_axis("hit", "hit point's" if row.cell("hit_point") else "tcp"),
        None if repeat is None else int(repeat),
        row.file(folder),
        response=response,
        stated=row.points(points),
    )


def _same_angles(path: Path, rows: list[PoseRow], joints: JointUnits) -> None:
    first: dict[str, PoseRow] = {}
    for row in rows:
        known = first.setdefault(row.pose, row)
        off = joints.apart(known.joints_deg, row.joints_deg)
        if off:
            raise InputError(
                f"{path}, row {row.row}: pose {row.pose} has a joint {off} away from where "
                f"it is in row {known.row}; give another pose another name."
            )


def _one_row_a_file(path: Path, rows: list[PoseRow]) -> tuple[PoseRow, ...]:
    """Rows of which those that name the same file, for each hit in it, are one.

    The file itself then says along which axes it was hit. Raises InputError where rows that name
    one file are of different poses, or of the same hit.
    """
    first: dict[Path, PoseRow] = {}
    for row in rows:
        assert row.hit is not None
        known = first.setdefault(row.file, row)
        if known is row:
            continue
        if known.pose != row.pose or row.hit in (known.hit, *known.hits):
            raise InputError(
                f"{path}, row {row.row}: {row.file.name} is listed in row {known.row} already, for "
                f"the same hit or another pose; each hit has a file, or a row, of its own."
            )
        hits = *(known.hits or (known.hit or "",)), row.hit
        first[row.file] = replace(known, hit=None, hits=hits)
    return tuple(first.values())
