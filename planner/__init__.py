"""Plan, use and explain impact-hammer tests of milling robots."""

from typing import TYPE_CHECKING, Any

from planner.version import __version__

if TYPE_CHECKING:
    from planner.api import analyse, diagnose, identify
    from planner.ask_tell import AskTell
    from planner.campaign.campaign import Campaign
    from planner.dataset.dataset import Dataset
    from planner.dynamics.simulation import Simulation
    from planner.frf.frf import Frf
    from planner.modal.modes import Mode
    from planner.recording.records import Hit
    from planner.robot.robot import Robot

__all__ = [
    "AskTell", "Campaign", "Dataset", "Frf", "Hit", "Mode", "Robot", "Simulation", "__version__",
    "analyse", "diagnose", "identify",
]  # fmt: skip

_MODULES = {
    "AskTell": "planner.ask_tell",
    "Campaign": "planner.campaign.campaign",
    "Dataset": "planner.dataset.dataset",
    "Frf": "planner.frf.frf",
    "Hit": "planner.recording.records",
    "Mode": "planner.modal.modes",
    "Robot": "planner.robot.robot",
    "Simulation": "planner.dynamics.simulation",
    "analyse": "planner.api",
    "diagnose": "planner.api",
    "identify": "planner.api",
}


def __getattr__(name: str) -> Any:
    """A public name, imported when it is first asked for."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import os
    from importlib import import_module

    before = set(os.environ)
    try:
        found = getattr(import_module(_MODULES[name]), name)
    finally:
        for added in set(os.environ) - before:  # JAX leaves settings of its own there
            del os.environ[added]
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
