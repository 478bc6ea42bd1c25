"""The studies by name."""

from collections.abc import Callable

from planner.errors import InputError
from planner.studies.report import Progress, Report

NAMES = ("seed-000", "seed-001", "seed-002", "seed-003")


def find(name: str) -> Callable[[Progress], Report]:
    """The study of that name; InputError if there is none."""
    from importlib import import_module

    if name not in NAMES:
        raise InputError(f"There is no study {name}; choose one of {', '.join(NAMES)}.")
    return import_module(f"planner.studies.{name.replace('-', '_')}").study
