"""The studies by name: first author and year of the paper."""

from collections.abc import Callable

from planner.errors import InputError
from planner.progress import Tell
from planner.studies.report import Report

NAMES = ("busch2022", "busch2020", "seyedhosseini2025", "lei2023", "birk2025")
ALL = "all"
ALIASES = {f"seed-00{i}": name for i, name in enumerate(NAMES)}  # what they were called before
Study = Callable[[Tell, bool], Report]  # progress, and whether the small version is wanted


def find(name: str) -> Study:
    """The study of that name; InputError if there is none."""
    from importlib import import_module

    name = ALIASES.get(name, name)
    if name not in NAMES:
        raise InputError(f"There is no study {name}; choose one of {', '.join(NAMES)} or all.")
    return import_module(f"planner.studies.{name}").study
