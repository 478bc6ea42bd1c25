"""All that is looked for before and beside the linear effects: artefacts, drift, force levels."""

from dataclasses import dataclass

from planner.diagnose.data.visits import Recorded
from planner.diagnose.finding import Finding
from planner.diagnose.screens import artefacts, drift, levels
from planner.diagnose.tell import Tell, quietly
from planner.physics.simulation import Simulation


@dataclass(frozen=True, eq=False)
class Screened:
    """What was found, artefacts first, and the recordings without the artefacts."""

    findings: tuple[Finding, ...]
    clean: Recorded


def screen(recorded: Recorded, nominal: Simulation, tell: Tell = quietly) -> Screened:
    """Artefacts first, so that they are never called physics; then, on clean data, the rest."""
    found = artefacts.screen(recorded, nominal)
    clean = artefacts.correct(recorded, found)
    by_level = levels.screen(clean, nominal, tell=tell)
    by_time = () if by_level else drift.screen(clean, nominal)
    return Screened((*found, *by_level, *by_time), clean)
