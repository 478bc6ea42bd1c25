"""One study or all of them: run, written as tables, pictures and pages, and not run twice."""

import time
from pathlib import Path

import msgspec

from planner import content_hash
from planner.campaign.checked_file import read_checked, write_checked
from planner.errors import InputError
from planner.progress import Tell, within
from planner.report.answer import encoded
from planner.studies import registry
from planner.studies.answer import StudiesAnswer, StudyAnswer
from planner.studies.page import index_page, study_page, write_page
from planner.studies.report import Table, check_folder, write, write_table

FINISHED = "study.json"  # written last: a folder that has it holds a whole study
# What decides a study's figures; another command line or page does not.
COMPUTING = (
    "campaign", "dataset", "design", "diagnosis", "dynamics", "frf", "identification", "inference",
    "modal", "recording", "robot", "studies", "surrogate", "truth",
)  # fmt: skip


class Finished(msgspec.Struct, frozen=True):
    """A study's answer, and the program and size that gave it."""

    key: str
    answer: dict


def conduct(name: str, folder: Path | None, small: bool, progress: Tell) -> StudyAnswer:
    """One study; its tables, pictures and page go to `folder`."""
    made = registry.find(name)
    check_folder(folder)
    start = time.perf_counter()
    report = made(progress, small)
    files = write(report, folder)
    answer = StudyAnswer.of(report, files, time.perf_counter() - start, small)
    if folder is not None:
        files.append(write_page(study_page(answer), folder / f"{answer.study}.html"))
    return answer


def conduct_all(folder: Path | None, small: bool, progress: Tell) -> StudiesAnswer:
    """Every study, each in a folder of its own, and an index; those finished are taken as they are.

    InputError without a folder: there would be nothing to go on from.
    """
    if folder is None:
        raise InputError("All studies take long and are kept; name a folder with --out.")
    check_folder(folder)
    start, done, taken, damaged = time.perf_counter(), [], [], []
    count = len(registry.NAMES)
    for i, name in enumerate(registry.NAMES):
        there, tell = folder / name, within(progress, i / count, (i + 1) / count)
        before = _finished(there, small)
        if before is None:
            file = there / FINISHED
            damaged += [name] if file.exists() and not read_checked(file, Finished) else []
            before = conduct(name, there, small, lambda text, share, n=name, t=tell: t(
                f"{n}: {text}", share))  # fmt: skip
            _keep(before, there, small)
        else:
            taken.append(name)
        done.append(before)
    claims = [(a.study, *row) for a in done for row in a.claims.rows]
    columns = "study", "claim", "holds here?", "computed here", "why not"
    files = [
        write_page(index_page(done), folder / "index.html"),
        write_table(Table("claims", "Claims of all papers", columns, tuple(claims)), folder),
    ]
    seconds = time.perf_counter() - start
    return StudiesAnswer(tuple(done), tuple(taken), files, seconds, tuple(damaged))


def _key(small: bool) -> str:
    return content_hash.digest(content_hash.program(*COMPUTING), "small" if small else "full")


def _finished(folder: Path, small: bool) -> StudyAnswer | None:
    """The study that is there whole, computed by this program in this size."""
    try:
        kept = read_checked(folder / FINISHED, Finished)
        if kept is None or kept.key != _key(small):
            return None
        answer = StudyAnswer.from_json(kept.answer)
    except (msgspec.MsgspecError, KeyError, TypeError):
        return None
    return answer if all(Path(file).exists() for file in answer.files) else None


def _keep(answer: StudyAnswer, folder: Path, small: bool) -> None:
    data = {"key": _key(small), "answer": msgspec.json.decode(encoded(answer))}
    write_checked(folder / FINISHED, data)
