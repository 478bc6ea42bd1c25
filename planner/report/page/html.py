"""HTML that cannot be broken by what users write: all text is escaped, markup is a type."""

import base64
import html
from collections.abc import Iterable, Sequence


class Markup(str):
    """Text that is HTML already; everything else is escaped where it is put in."""


VOID = {"img", "meta", "br"}


def tag(name: str, /, *children: object, **attributes: str) -> Markup:
    """An element; a trailing underscore of an attribute's name is left out (`class_`)."""
    given = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{html.escape(value, quote=True)}"'
        for key, value in attributes.items()
    )
    if name in VOID:
        return Markup(f"<{name}{given}>")
    return Markup(f"<{name}{given}>{joined(children)}</{name}>")


def joined(children: Iterable[object]) -> Markup:
    """Children one after the other, escaped unless they are markup."""
    return Markup("".join(c if isinstance(c, Markup) else html.escape(str(c)) for c in children))


def paragraphs(*texts: str) -> Markup:
    """One paragraph each."""
    return joined(tag("p", text) for text in texts)


def bullets(texts: Iterable[object]) -> Markup:
    """A list of points; nothing where there are none."""
    items = [tag("li", text) for text in texts]
    return tag("ul", *items) if items else Markup("")


def table(header: Sequence[object], rows: Iterable[Sequence[object]], caption: str = "") -> Markup:
    """A table whose first column is text and the others numbers; a cell may be a list of them."""
    head = tag("thead", tag("tr", *(tag("th", cell) for cell in header)))
    body = tag("tbody", *(tag("tr", *map(_cell, row)) for row in rows))
    said = [tag("caption", caption)] if caption else []
    return tag("div", tag("table", *said, head, body), class_="scroll")


def words_table(header: Sequence[object], rows: Iterable[Sequence[object]]) -> Markup:
    """A table of words, whose lines break."""
    return Markup(table(header, rows).replace("<table>", '<table class="words">', 1))


def _cell(cell: object) -> Markup:
    if not isinstance(cell, list):
        return tag("td", cell)
    # Lines break between numbers, not inside them.
    spans = [tag("span", f"{one}{',' if i < len(cell) else ''}") for i, one in enumerate(cell, 1)]
    return tag("td", Markup(" ".join(spans)) if spans else "–", class_="wide")


def picture(png: bytes, says: str) -> Markup:
    """A picture in the file itself, with what it shows below."""
    data = base64.b64encode(png).decode()
    image = tag("img", src=f"data:image/png;base64,{data}", alt=says)
    return tag("figure", image, tag("figcaption", says))


def section(title: str, *children: object, id_: str) -> Markup:
    """A chapter with a heading that links point to."""
    return tag("section", tag("h2", title), *children, id=id_)


# No script and nothing from elsewhere can be loaded, whatever a name in the campaign says.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"

STYLE = """
:root { --ink: #1c2733; --soft: #5a6875; --line: #d5dce2; --accent: #1f5f99; }
* { box-sizing: border-box; }
body { font: 15px/1.5 "Segoe UI", "Helvetica Neue", Arial, sans-serif; color: var(--ink);
  margin: 0 auto; max-width: 1080px; padding: 24px 32px; background: #fff; }
h1 { font-size: 26px; margin: 0 0 4px; } h2 { font-size: 20px; margin: 36px 0 8px;
  padding-bottom: 4px; border-bottom: 2px solid var(--accent); }
h3 { font-size: 16px; margin: 20px 0 6px; } .soft { color: var(--soft); }
nav { margin: 12px 0; } nav a { margin-right: 14px; white-space: nowrap; }
a { color: var(--accent); }
.label { background: #8c1d78; color: #fff; padding: 8px 14px; margin: 12px 0; font-weight: 600; }
.warn { border-left: 4px solid #d08700; padding: 2px 12px; margin: 8px 0; background: #fff8e8; }
.error { border-left: 4px solid #b3261e; padding: 2px 12px; margin: 8px 0; background: #fdeceb; }
.cards { display: flex; flex-wrap: wrap; gap: 12px; margin: 16px 0; }
.card { border: 1px solid var(--line); border-radius: 4px; padding: 8px 14px; min-width: 150px; }
.card b { display: block; font-size: 22px; } .card span { color: var(--soft); font-size: 13px; }
.scroll { overflow-x: auto; } table { border-collapse: collapse; margin: 8px 0; font-size: 13px; }
caption { text-align: left; color: var(--soft); padding: 4px 0; }
th, td { border-bottom: 1px solid var(--line); padding: 3px 10px; text-align: right;
  vertical-align: top; white-space: nowrap; }
th { background: #f2f5f8; } th:first-child, td:first-child { text-align: left; }
table.words td, table.words th { text-align: left; white-space: normal;
  overflow-wrap: anywhere; }
table.words th { min-width: 70px; } td.wide { white-space: normal; min-width: 150px; }
td.wide span { white-space: nowrap; }
figure { margin: 12px 0; } img { max-width: 100%; height: auto; }
figcaption { color: var(--soft); font-size: 13px; }
pre { background: #f4f6f8; padding: 10px 14px; overflow-x: auto; font-size: 13px;
  white-space: pre-wrap; overflow-wrap: anywhere; }
@page { size: A4; margin: 14mm 12mm; }
@media print { body { max-width: none; padding: 0; font-size: 11px; } nav { display: none; }
  h2 { break-after: avoid; } figure, .cards, tr { break-inside: avoid; } table { font-size: 9px; }
  .scroll { overflow: visible; }
  .label { -webkit-print-color-adjust: exact; print-color-adjust: exact; } }
"""


def document(title: str, *children: object) -> str:
    """The whole file."""
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        Markup(f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("title", title),
        tag("style", Markup(STYLE)),
    )
    return "<!DOCTYPE html>\n" + tag("html", head, tag("body", *children), lang="en") + "\n"
