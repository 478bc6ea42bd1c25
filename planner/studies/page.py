"""A study as one HTML page without any other file, and an index of all studies."""

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path

from planner.errors import InputError
from planner.studies.claims import HOLDS, IN_KIND, NOT, UNTESTED
from planner.studies.report import Cell, StudyAnswer, Table, shown_cell

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 84em; padding: 0 1em;
       color: #222; background: #fff; }
h1 { font-size: 1.5em; } h2 { font-size: 1.15em; margin-top: 2em; }
table { border-collapse: collapse; font-size: 0.92em; margin: 0.6em 0; }
th, td { border-bottom: 1px solid #ccc; padding: 0.25em 0.7em; text-align: left;
         vertical-align: top; }
td.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
td.verdict { font-weight: 600; color: #555; white-space: nowrap; }
td.holds { color: #116611; } td.kind { color: #8a6100; } td.not { color: #aa1111; }
img { max-width: 100%; } .simulated { color: #a0209a; font-weight: 600; }
.wide { overflow-x: auto; }
"""
CLASSES = {HOLDS: "verdict holds", IN_KIND: "verdict kind", NOT: "verdict not", UNTESTED: "verdict"}


def study_page(answer: StudyAnswer) -> str:
    """The whole page: whose paper, what stands in for its data, claims, tables, pictures."""
    parts = [
        f"<h1>{escape(answer.short)}, done again</h1>",
        f"<p>{escape(answer.paper)}</p>",
        f'<p class="simulated">{escape(answer.data)}</p>',
        f"<p>{escape(_counted(answer))}</p>",
        _table(answer.claims),
        *(_table(table) for table in answer.tables),
        *(_picture(Path(file)) for file in answer.files if file.endswith(".png")),
        f"<p>Computed in {answer.seconds:.0f} s.</p>",
    ]
    return _document(f"{answer.short}, done again", parts)


def index_page(answers: Sequence[StudyAnswer]) -> str:
    """What holds, study by study, with a link to each one's page and all claims below."""
    rows = tuple(
        (a.study, a.paper, *(float(_count(a, v)) for v in CLASSES), a.seconds) for a in answers
    )
    listed = Table("studies", "Studies", ("study", "paper", *CLASSES, "seconds"), rows)
    links = {a.study: f"{a.study}/{a.study}.html" for a in answers}
    parts = [
        "<h1>Papers on pose-dependent robot dynamics, done again</h1>",
        '<p class="simulated">All recordings are SIMULATED; each study says how.</p>',
        _table(listed, links),
        *(_table(answer.claims) for answer in answers),
    ]
    return _document("Papers done again", parts)


def _count(answer: StudyAnswer, verdict: str) -> int:
    return sum(claim.verdict == verdict for claim in answer.findings)


def _counted(answer: StudyAnswer) -> str:
    """How many claims have each verdict."""
    each = ", ".join(f"{v} {_count(answer, v)}" for v in CLASSES)
    return f"Of {len(answer.findings)} claims: {each}."


def write_page(text: str, path: Path) -> str:
    """Write a page; its absolute path. InputError if that is impossible."""
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(
            f"{path} cannot be written ({error.strerror}); name another folder."
        ) from None
    return str(path.absolute())


def _document(title: str, parts: Sequence[str]) -> str:
    head = f'<meta charset="utf-8"><title>{escape(title)}</title><style>{STYLE}</style>'
    body = "\n".join(parts)
    return f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head>\n<body>\n{body}\n</body></html>\n'


def _table(table: Table, links: dict[str, str] | None = None) -> str:
    head = "".join(f"<th>{escape(column)}</th>" for column in table.columns)
    rows = "\n".join(
        "<tr>" + "".join(_cell(value, links or {}) for value in row) + "</tr>" for row in table.rows
    )
    return (
        f'<h2>{escape(table.title)}</h2>\n<div class="wide"><table><tr>{head}</tr>\n'
        f"{rows}</table></div>"
    )


def _cell(value: Cell, links: dict[str, str]) -> str:
    text = escape(shown_cell(value))
    if not isinstance(value, str):
        return f'<td class="number">{text}</td>'
    if value in links:
        text = f'<a href="{escape(links[value])}">{text}</a>'
    kind = f' class="{CLASSES[value]}"' if value in CLASSES else ""
    return f"<td{kind}>{text}</td>"


def _picture(path: Path) -> str:
    data = base64.b64encode(path.read_bytes()).decode()
    return f'<p><img alt="{escape(path.stem)}" src="data:image/png;base64,{data}"></p>'
