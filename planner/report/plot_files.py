"""Where pictures go: files in a folder, and a Rerun recording."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from planner.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("png", "svg")


@dataclass(frozen=True)
class Pictures:
    """A folder for files of one format, and a Rerun file; None: not wanted."""

    folder: Path | None = None
    format: str = "png"
    rrd: Path | None = None

    def __post_init__(self) -> None:
        if self.format not in FORMATS:
            raise InputError(f"--format {self.format} is not known; give png or svg.")

    @property
    def wanted(self) -> bool:
        return self.folder is not None or self.rrd is not None

    def write(
        self,
        figures: dict[str, "Figure"],
        name: str,
        record: Callable[[Path], None] | None = None,
    ) -> dict[str, Any]:
        """Write every figure; answers where they are. Raises InputError if that is impossible.

        `record` writes the Rerun file, which else has the figures.
        """
        files = [] if self.folder is None else _files(figures, self.folder, self.format)
        if self.rrd is not None and record is not None:
            record(self.rrd)
        elif self.rrd is not None:
            _recording(figures, self.rrd, name)
        return {
            "plots": [str(file) for file in files],
            "rrd": None if self.rrd is None else str(self.rrd.absolute()),
        }


def _files(figures: dict[str, "Figure"], folder: Path, form: str) -> list[Path]:
    from planner.report.frf_plots import save

    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; name a folder for the pictures.")
    files = [folder.absolute() / f"{name}.{form}" for name in figures]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for file, figure in zip(files, figures.values(), strict=True):
            save(figure, file)
    except OSError as error:
        raise InputError(
            f"The pictures cannot be written to {folder} ({error.strerror}); name another folder."
        ) from None
    return files


def _recording(figures: dict[str, "Figure"], rrd: Path, name: str) -> None:
    import rerun as rr
    import rerun.blueprint as rrb

    from planner.report.frf_plots import png
    from planner.report.rerun_stream import open_stream

    views = [rrb.Spatial2DView(origin=f"/modes/{key}", name=key) for key in figures]
    stream = open_stream(f"modes|{name}", name, rrb.Blueprint(rrb.Tabs(*views)), rrd)
    for key, figure in figures.items():
        image = rr.EncodedImage(contents=png(figure, dpi=150), media_type="image/png")
        stream.log(f"modes/{key}", image, static=True)
    stream.flush(timeout_sec=10.0)
    stream.disconnect()
