"""The studies by name, first author and year of the paper: `study.py` beside the paper's robot."""

import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from planner.demo import NAME as SHIPPED
from planner.demo import shipped
from planner.errors import InputError

FOLDERS = {
    "busch2022": "kr240_busch2022",
    "busch2020": "kr240_busch2020",
    "seyedhosseini2025": "kr210_seyedhosseini2025",
    "lei2023": "irb6660_lei2023",
    "birk2025": "kr10_birk2025",
}
NAMES = tuple(FOLDERS)
ALL = "all"
ALIASES = {f"seed-00{i}": name for i, name in enumerate(NAMES)}  # what they were called before
NEEDED = "mujoco"  # makes the recordings, as `planner.proof` has it


def named(name: str) -> str:
    """The study's own name; InputError if there is none, or what it needs is not installed."""
    name = ALIASES.get(name, name)
    if name not in (*NAMES, ALL):
        raise InputError(f"There is no study {name}; choose one of {', '.join(NAMES)} or all.")
    if find_spec(NEEDED) is None:
        raise InputError(
            "Studies make their recordings with MuJoCo, which is not installed; run "
            f"{sys.executable} -m pip install 'planner[truth]'"
        )
    return name


def folder_of(name: str) -> Path:
    """Where the study's files lie."""
    return shipped(SHIPPED).parent / FOLDERS[name]


def load(name: str) -> ModuleType:
    """The study's module: it has RULES, and `study(progress, small)`, which gives a `Report`."""
    return import_module(f"planner.studies.{FOLDERS[name]}.study")
