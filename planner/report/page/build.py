"""The report of a campaign as the text of one HTML file."""

from datetime import UTC, datetime
from pathlib import Path

from planner.campaign.campaign import Campaign
from planner.design.stopping import percent
from planner.report.page.chapters import asked, decisions, meaning, measured, reproduce
from planner.report.page.explained import diagnosis
from planner.report.page.facts import Facts
from planner.report.page.html import Markup, document, joined, tag
from planner.report.page.learned import learned
from planner.report.page.pictures import frfs, maps, quality
from planner.report.text import SIMULATED
from planner.version import __version__

CHAPTERS = (
    ("asked", "asked"), ("measured", "measured"), ("quality", "quality"), ("maps", "maps"),
    ("frfs", "FRFs"), ("learned", "simulation"), ("diagnosis", "diagnosis"), ("log", "log"),
    ("again", "reproduce"), ("meaning", "reading"),
)  # fmt: skip


def page(campaign: Campaign, kept_diagnosis: Path | None = None) -> str:
    """All chapters; `kept_diagnosis` is the answer of a diagnosis in JSON."""
    facts = Facts.of(campaign)
    parts = [asked(facts), measured(facts), quality(facts), maps(facts), frfs(facts)]
    parts.append(learned(facts))
    parts += [diagnosis(kept_diagnosis, facts.status.springs)] if kept_diagnosis else []
    parts += [decisions(facts), reproduce(facts), meaning()]
    name = campaign.directory.name
    without = {"diagnosis"} if kept_diagnosis is None else set()
    without |= set() if facts.status.springs else {"learned"}
    return document(f"{name}: report", _head(facts, name, without), *parts)


def _head(facts: Facts, name: str, without: set[str]) -> Markup:
    now = datetime.now(UTC).isoformat(timespec="minutes")[:16].replace("T", " ")
    label = [tag("div", SIMULATED.plain, class_="label")] if facts.simulated else []
    links = [tag("a", text, href=f"#{id_}") for id_, text in CHAPTERS if id_ not in without]
    said = f"{facts.status.robot} · {now} UTC · planner {__version__}"
    return joined(
        (
            tag("h1", f"Hammer tests of {name}"),
            tag("p", said, class_="soft"),
            *label,
            _cards(facts),
            tag("nav", *links),
        )
    )


def _cards(facts: Facts) -> Markup:
    used, hits = facts.used, sum(len(m.accepted) for m in facts.used)
    known = facts.status.forecast
    rmse = percent(known.rmse_percent) if known.measurements else "–"
    lacks = f"; what lacks: {facts.status.waits_for}" if facts.status.waits_for else ""
    cards = [
        (str(len(used)), "poses measured and used"),
        (str(hits), "hits used"),
        (str(len(facts.status.refused)), "recordings refused"),
        (rmse, "expected RMSE of frequencies over the workspace"),
        (
            "reached" if facts.status.done else "not reached",
            f"target of {facts.status.target_frequency_sd_percent:g} %{lacks}",
        ),
    ]
    made = (tag("div", tag("b", big), tag("span", small), class_="card") for big, small in cards)
    return tag("div", *made, class_="cards")
