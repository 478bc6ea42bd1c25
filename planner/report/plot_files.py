"""Where pictures go: files in a folder, and a Rerun recording."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from planner.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from planner.report.rerun.figures import More

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
        note: str = "",
        more: "More | None" = None,
    ) -> dict[str, Any]:
        """Write every figure; answers where they are. Raises InputError if that is impossible.

        In the Rerun file a `note` says what is what, and `more` draws what is no figure.
        """
        files = [] if self.folder is None else _files(figures, self.folder, self.format)
        if self.rrd is not None:
            from planner.report.rerun.figures import record_figures

            record_figures(figures, name, note, self.rrd, more)
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
