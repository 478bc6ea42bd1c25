"""A study's own modules, which lie beside its paper's robot in campaigns/."""

import importlib
from types import ModuleType

from planner.studies import registry


def part(name: str, file: str) -> ModuleType:
    """Such as part("birk2025", "data")."""
    return importlib.import_module(f"{registry.load(name).__name__}.{file}")
