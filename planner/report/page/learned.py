"""The chapter of the report on what the recordings taught the simulation."""

from planner.report.page.facts import Facts
from planner.report.page.html import Markup, paragraphs, section, table
from planner.report.refitted_springs import COLUMNS, NOT_KNOWN


def learned(facts: Facts) -> Markup:
    """Each stiffness as stated and refitted; nothing where the simulation does not learn."""
    springs = facts.status.springs
    if not springs:
        return Markup("")
    rows = [spring.cells for spring in springs]
    said = "Stiffnesses of the simulation, refitted to all recordings"
    parts = table(COLUMNS, rows, said), paragraphs(NOT_KNOWN)
    return section("What the simulation learned", *parts, id_="learned")
