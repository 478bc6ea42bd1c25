"""Pages of HTML without any other file: the report of a campaign, the manual, studies."""

import base64
from pathlib import Path
from typing import TYPE_CHECKING

import jinja2

from planner.errors import writing
from planner.report.pictures import png
from planner.version import __version__
from planner.words import local_time, significant, with_sd

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 100


def inline(picture: "Figure | Path") -> str:
    """A figure, or a PNG file, as base64."""
    data = picture.read_bytes() if isinstance(picture, Path) else png(picture, DPI)
    return base64.b64encode(data).decode()


def rendered(template: str, **values: object) -> str:
    """A template filled in; whatever a value holds is text there, no markup."""
    loader = jinja2.PackageLoader("planner.report", "templates")
    made = jinja2.Environment(
        loader=loader, autoescape=True, trim_blocks=True, undefined=jinja2.StrictUndefined
    )
    made.filters |= {"inline": inline, "cells": dict.values}
    made.filters |= {one.__name__: one for one in (local_time, significant, with_sd)}
    return made.get_template(template).render(version=__version__, **values)


def write_page(text: str, path: Path) -> Path:
    """Write a page; its absolute path. InputError if that is impossible."""
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8", errors="replace", newline="")
    return path.absolute()
