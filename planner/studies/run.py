"""One study or all of them: run, written as tables, pictures and pages, and not run twice."""

import csv
import time
from pathlib import Path
from typing import Any

import msgspec

from planner import content_hash
from planner.campaign.journal import read_checked, write_checked
from planner.errors import InputError, writing
from planner.progress import ProgressCallback, part_of
from planner.report.answer import encoded
from planner.report.html import rendered, write_page
from planner.report.pictures import Pictures
from planner.studies import registry
from planner.studies.claims import COLUMNS, HOLDS, IN_KIND, NOT, UNTESTED, gathered, judge
from planner.studies.report import StudiesAnswer, StudyAnswer, Table, shown_cell

FINISHED = "study.json"  # written last: a folder that has it holds a whole study
CLASSES = {HOLDS: "verdict holds", IN_KIND: "verdict kind", NOT: "verdict not", UNTESTED: "verdict"}


class Finished(msgspec.Struct, frozen=True):
    """A study's answer, and the program and size that gave it."""

    key: str
    answer: dict


def run_study(
    name: str, folder: Path | None, small: bool, progress: ProgressCallback
) -> StudyAnswer:
    """One study; its tables, pictures and page go to `folder`."""
    name = registry.named(name)
    _make(folder)
    start, study = time.perf_counter(), registry.load(name)
    told = study.study(progress, small)
    findings = judge(study.RULES, gathered(told.figures), told.notes)
    files: list[str] = []
    answer = StudyAnswer(
        name, told.data, told.tables, findings, files, time.perf_counter() - start,
        study.PAPER.citation, small, study.PAPER.short,
    )  # fmt: skip
    if folder is not None:
        files += [_write_table(each, folder) for each in (*told.tables, answer.claims)]
        files += Pictures(folder).write(lambda: told.pictures, name, simulated=True)["plots"]
        files.append(str(write_page(_page(answer), folder / f"{name}.html")))
    return answer


def run_all(folder: Path | None, small: bool, progress: ProgressCallback) -> StudiesAnswer:
    """Every study, each in a folder of its own, and an index; those finished are taken as they are.

    InputError without a folder: there would be nothing to go on from.
    """
    if folder is None:
        raise InputError("All studies take long and are kept; name a folder with --out.")
    registry.named(registry.ALL)
    _make(folder)
    start, done, taken, damaged = time.perf_counter(), [], [], []
    count = len(registry.NAMES)
    for i, name in enumerate(registry.NAMES):
        there, part = folder / name, part_of(progress, i / count, (i + 1) / count)
        before = _finished(name, there, small)
        if before is None:
            file = there / FINISHED
            damaged += [name] if file.exists() and not read_checked(file, Finished) else []
            before = run_study(name, there, small, lambda text, share, n=name, t=part: t(
                f"{n}: {text}", share))  # fmt: skip
            data = {"key": _key(name, small), "answer": msgspec.json.decode(encoded(before))}
            write_checked(there / FINISHED, data)
        else:
            taken.append(name)
        done.append(before)
    claims = tuple((a.study, *row) for a in done for row in a.claims.rows)
    whole = Table("claims", "Claims of all papers", ("study", "claim", *COLUMNS), claims)
    files = [str(write_page(_index(done), folder / "index.html")), _write_table(whole, folder)]
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


def _make(folder: Path | None) -> None:
    """InputError, before a study has run for minutes, if nothing can be written there."""
    if folder is not None:
        with writing(folder, "another folder"):
            folder.mkdir(parents=True, exist_ok=True)


def _write_table(made: Table, folder: Path) -> str:
    """One table as CSV; the file's absolute path."""
    path = folder.absolute() / f"{made.name}.csv"
    with writing(path, "another folder"), path.open("w", newline="", encoding="utf-8") as out:
        csv.writer(out).writerows([made.columns, *made.rows])
    return str(path)


def _page(answer: StudyAnswer) -> str:
    """Whose paper, what stands in for its data, claims, tables, pictures."""
    each = ", ".join(f"{v} {answer.count(v)}" for v in CLASSES)
    return _study_html(
        f"{answer.short}, done again",
        paper=answer.paper,
        data=answer.data,
        said=[f"Of {len(answer.findings)} claims: {each}."],
        tables=[answer.claims, *answer.tables],
        pictures=[Path(file) for file in answer.files if file.endswith(".png")],
        seconds=answer.seconds,
    )


def _index(answers: list[StudyAnswer]) -> str:
    """What holds, study by study, with a link to each one's page and all claims below."""
    rows = tuple((a.study, a.paper, *map(float, map(a.count, CLASSES)), a.seconds) for a in answers)
    listed = Table("studies", "Studies", ("study", "paper", *CLASSES, "seconds"), rows)
    return _study_html(
        "Papers on pose-dependent robot dynamics, done again",
        data="All recordings are SIMULATED; each study says how.",
        tables=[listed, *(answer.claims for answer in answers)],
        links={a.study: f"{a.study}/{a.study}.html" for a in answers},
    )


def _study_html(title: str, **values: Any) -> str:
    empty: dict[str, Any] = {
        "paper": "", "said": (), "links": {}, "pictures": (), "seconds": 0.0, "classes": CLASSES,
        "shown": shown_cell,
    }  # fmt: skip
    return rendered("study.html", title=title, **(empty | values))
