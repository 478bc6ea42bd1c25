"""One study or all of them: run, written as tables, pictures and pages, and not run twice."""

import time
from pathlib import Path

import msgspec

from planner import content_hash
from planner.campaign.journal import read_checked, write_checked
from planner.errors import InputError
from planner.progress import Tell, within
from planner.report.answer import encoded
from planner.studies import registry
from planner.studies.claims import COLUMNS
from planner.studies.page import index_page, study_page, write_page
from planner.studies.report import (
    StudiesAnswer,
    StudyAnswer,
    Table,
    check_folder,
    write,
    write_table,
)

FINISHED = "study.json"  # written last: a folder that has it holds a whole study


class Finished(msgspec.Struct, frozen=True):
    """A study's answer, and the program and size that gave it."""

    key: str
    answer: dict


def conduct(name: str, folder: Path | None, small: bool, progress: Tell) -> StudyAnswer:
    """One study; its tables, pictures and page go to `folder`."""
    name = registry.named(name)
    check_folder(folder)
    start = time.perf_counter()
    told = registry.load(name).study(progress, small)
    files: list[str] = []
    answer = StudyAnswer(
        name, told.data, told.tables, told.findings, files, time.perf_counter() - start,
        told.paper.citation, small, told.paper.short,
    )  # fmt: skip
    files += write(answer, told.figures, folder)
    if folder is not None:
        files.append(write_page(study_page(answer), folder / f"{name}.html"))
    return answer


def conduct_all(folder: Path | None, small: bool, progress: Tell) -> StudiesAnswer:
    """Every study, each in a folder of its own, and an index; those finished are taken as they are.

    InputError without a folder: there would be nothing to go on from.
    """
    if folder is None:
        raise InputError("All studies take long and are kept; name a folder with --out.")
    registry.named(registry.ALL)
    check_folder(folder)
    start, done, taken, damaged = time.perf_counter(), [], [], []
    count = len(registry.NAMES)
    for i, name in enumerate(registry.NAMES):
        there, tell = folder / name, within(progress, i / count, (i + 1) / count)
        before = _finished(name, there, small)
        if before is None:
            file = there / FINISHED
            damaged += [name] if file.exists() and not read_checked(file, Finished) else []
            before = conduct(name, there, small, lambda text, share, n=name, t=tell: t(
                f"{n}: {text}", share))  # fmt: skip
            data = {"key": _key(name, small), "answer": msgspec.json.decode(encoded(before))}
            write_checked(there / FINISHED, data)
        else:
            taken.append(name)
        done.append(before)
    claims = tuple((a.study, *row) for a in done for row in a.claims.rows)
    whole = Table("claims", "Claims of all papers", ("study", "claim", *COLUMNS), claims)
    files = [write_page(index_page(done), folder / "index.html"), write_table(whole, folder)]
    seconds = time.perf_counter() - start
    return StudiesAnswer(tuple(done), tuple(taken), files, seconds, tuple(damaged))


def _key(name: str, small: bool) -> str:
    own = sorted(registry.folder_of(name).glob("*.py"))
    texts = [path.read_text("utf-8") for path in own]
    return content_hash.digest(content_hash.program(), *texts, "small" if small else "full")


def _finished(name: str, folder: Path, small: bool) -> StudyAnswer | None:
    """The study that is there whole, computed by this program in this size."""
    try:
        kept = read_checked(folder / FINISHED, Finished)
        if kept is None or kept.key != _key(name, small):
            return None
        answer = StudyAnswer.from_json(kept.answer)
    except (msgspec.MsgspecError, KeyError, TypeError):
        return None
    return answer if all(Path(file).exists() for file in answer.files) else None
